"""What both readers of an E57 need of libe57: a file opened with its errors in one line, numbers and poses out of its tree."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from viewer.errors import InputError


def library() -> Any:
    """libe57 as pye57 brings it, a compiled module without types."""
    import pye57

    return getattr(pye57, "libe57")  # noqa: B009  (not declared by the package)


def first_line(error: Exception) -> str:
    """What an error of the library says, short enough for a message."""
    return (str(error).strip().splitlines() or [type(error).__name__])[0][:160]


@contextmanager
def open_e57(path: Path) -> Iterator[Any]:
    """libe57's file, closed at the end.  Raises InputError where the library refuses it, now or while it is read."""
    libe57 = library()
    file = None
    try:
        file = libe57.ImageFile(str(path), "r")
        yield file
    except libe57.E57Exception as error:
        raise InputError(f"{path}: {first_line(error)}; copy or export it again") from None
    except RuntimeError as error:
        raise InputError(f"{path}: cannot be read as E57: {first_line(error)}; copy or export it again") from None
    finally:
        if file is not None and file.isOpen():
            file.close()


def value_of(node) -> float | None:
    """The value of an integer, float or scaled-integer node."""
    value = getattr(node, "scaledValue", None) or getattr(node, "value", None)
    return float(value()) if value else None


def pose_of(node) -> tuple[np.ndarray, np.ndarray] | None:
    """Rotation (3, 3) and translation (3,) to the file's frame of a scan or an image; None where it has none that is usable."""
    if not node.isDefined("pose"):
        return None
    quaternion = _vector(node["pose"], "rotation", "wxyz", (1.0, 0.0, 0.0, 0.0))
    translation = _vector(node["pose"], "translation", "xyz", (0.0, 0.0, 0.0))
    length = np.linalg.norm(quaternion)
    if not (np.isfinite(translation).all() and np.isfinite(length) and length > 1e-6):
        return None
    from scipy.spatial.transform import Rotation

    return Rotation.from_quat(np.roll(quaternion, -1)).as_matrix(), translation  # x, y, z, w


def _vector(parent, name: str, parts: str, otherwise) -> np.ndarray:
    if not parent.isDefined(name):
        return np.array(otherwise)
    node = parent[name]
    return np.array([value_of(node[part]) if node.isDefined(part) else 0.0 for part in parts], np.float64)
