"""What the figures of an evaluation were made with, for its JSON: version, seed, weights."""

from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ..network.weights import digest


def made_with(weights: dict[str, Path], seed: int) -> dict:
    """``version`` of pointglass (None where it is not installed), ``seed``, and ``weights``: name -> file and the first 12 hex
    digits of its SHA-256."""
    try:
        installed = version("pointglass")
    except PackageNotFoundError:
        installed = None
    held = {name: {"file": path.name, "sha256": digest(path)} for name, path in weights.items()}
    return {"version": installed, "seed": seed, "weights": held}
