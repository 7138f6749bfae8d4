"""The folder of what this program remembers from one start to the next."""

import os
from pathlib import Path


def state_dir() -> Path:
    """POINTGLASS_STATE if set, else the user's state folder.  Not created here."""
    if configured := os.environ.get("POINTGLASS_STATE"):
        return Path(configured).expanduser()
    from platformdirs import user_state_path

    return user_state_path("pointglass", appauthor=False)
