"""Where the project's own files and the cache live, in a checkout and in an installed wheel alike."""

import os
from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]  # viewer/
_BUNDLED = _PACKAGE / "_data"  # a wheel carries shaders/ and assets/ here; a checkout has them beside viewer/


def _root() -> Path:
    return _BUNDLED if _BUNDLED.is_dir() else _PACKAGE.parent


def import_root() -> Path:
    """Folder from which ``import pointglass`` finds this code: of the checkout, or site-packages."""
    return _PACKAGE.parent.parent if _BUNDLED.is_dir() else _PACKAGE.parent


def shaders_dir() -> Path:
    """Folder of the GLSL files."""
    return _root() / "shaders"


def assets_dir() -> Path:
    """Folder of the demo scan and its cameras."""
    return _root() / "assets"


def weights_home() -> Path:
    """Folder of a person's own weights: POINTGLASS_WEIGHTS if set, else the user's data folder.  Not created here."""
    if configured := os.environ.get("POINTGLASS_WEIGHTS"):
        return Path(configured).expanduser()
    from platformdirs import user_data_path

    return user_data_path("pointglass", appauthor=False) / "weights"


def own_weights() -> dict[str, Path]:
    """A person's own weights by name."""
    return {path.stem: path for path in sorted(weights_home().glob("*.safetensors"))}


def cache_dir() -> Path:
    """Folder of the built grids: POINTGLASS_CACHE if set, else the user's cache folder.  Not created here."""
    if configured := os.environ.get("POINTGLASS_CACHE"):
        return Path(configured).expanduser()
    from platformdirs import user_cache_path

    return user_cache_path("pointglass", appauthor=False)
