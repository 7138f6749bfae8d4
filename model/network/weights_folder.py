"""Where the shipped weights are and what their files are called.  Loads no torch: the window asks this while it opens."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parents[1]  # model/
MIRRORED = {"best": "balanced"}
"""Qualities that average another quality's network over mirrored pictures (model/network/reconstruct.py)."""


def weights_dir() -> Path:
    """Folder of the shipped weights: of a wheel, model/_data/weights; of a checkout, assets/weights."""
    bundled = _PACKAGE / "_data" / "weights"
    return bundled if bundled.is_dir() else _PACKAGE.parent / "assets" / "weights"


def weights_name(quality: str, *, filtered: bool) -> str:
    """Name of a shipped weights file, without its folder and suffix."""
    quality = MIRRORED.get(quality, quality)
    return f"{quality}-{'filtered' if filtered else 'unfiltered'}"


def weights_file(quality: str, *, filtered: bool) -> Path:
    """Path of the shipped weights of a quality, whether they are there or not."""
    return weights_dir() / f"{weights_name(quality, filtered=filtered)}.safetensors"


def shipped() -> list[str]:
    """Names of the shipped weights."""
    return sorted(p.stem for p in weights_dir().glob("*.safetensors"))
