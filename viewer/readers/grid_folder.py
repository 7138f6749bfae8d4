"""Recognises a folder that holds a built grid; used by the grid and by the readers."""

import json
from pathlib import Path

MAGIC = "pointglass grid"
META = "meta.json"


def is_grid(folder: Path) -> bool:
    """True where ``folder`` holds a pointglass grid, whole or torn."""
    try:
        return (folder / META).is_file() and json.loads((folder / META).read_text("utf-8")).get("magic") == MAGIC
    except (OSError, ValueError, AttributeError, TypeError, RecursionError):
        return False
