"""JSON files, written atomically."""

import json
import math
from pathlib import Path
from typing import Any

from .atomic_write import write_atomic


def write_json(path: Path, data: object) -> None:
    """Writes indented JSON; numbers that are not finite, such as the PSNR of equal pictures, become null.  Raises OSError."""
    text = json.dumps(_finite(data), indent=1, allow_nan=False) + "\n"
    write_atomic(path, lambda beside: beside.write_text(text, encoding="utf-8"))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(held) for key, held in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(held) for held in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
