"""Where the shipped weights are and what their files are called.  Loads no torch: the window asks this while it opens."""

from pathlib import Path

from .qualities import QUALITIES

_PACKAGE = Path(__file__).resolve().parents[1]  # model/


def weights_dir() -> Path:
    """Folder of the shipped weights: of a wheel, model/_data/weights; of a checkout, assets/weights."""
    bundled = _PACKAGE / "_data" / "weights"
    return bundled if bundled.is_dir() else _PACKAGE.parent / "assets" / "weights"


def weights_name(quality: str, *, filtered: bool) -> str:
    """Name of a shipped weights file, without its folder and suffix."""
    row = QUALITIES.get(quality)
    return f"{row.mirrors if row and row.mirrors else quality}-{'filtered' if filtered else 'unfiltered'}"


def weights_file(quality: str, *, filtered: bool) -> Path:
    """Path of the shipped weights of a quality, whether they are there or not."""
    return weights_dir() / f"{weights_name(quality, filtered=filtered)}.safetensors"


def weights_path(text: str) -> Path:
    """The file that a person named: a shipped one by its name, such as balanced-filtered, else a path."""
    return weights_dir() / f"{text}.safetensors" if text in shipped() and not Path(text).exists() else Path(text)


def shipped() -> list[str]:
    """Names of the shipped weights."""
    return sorted(p.stem for p in weights_dir().glob("*.safetensors"))


def shipped_qualities(*, trainable: bool = False) -> list[str]:
    """Qualities whose weights for filtered pictures are shipped, in the order of the table.

    trainable: only those with a network of their own.
    """
    there = shipped()
    return [quality for quality, row in QUALITIES.items()
            if weights_name(quality, filtered=True) in there and not (trainable and row.mirrors)]
