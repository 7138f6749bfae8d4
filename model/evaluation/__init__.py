"""Evaluation of picture quality: reconstruction methods compared on rooms with ground truth, at several point densities.

- ``room_scores``: runs the evaluation of a room.
- ``methods``: the compared methods; ``outside`` and ``open3d_points``: those of others.
- ``figures``: metrics of one picture against the truth; ``metrics`` and ``flip`` compute some of them.
- ``worse``: counts the views in which a network's picture is worse than the filled picture.
- ``heldout``: evaluates any scan at points withheld from it.
- ``flicker``: compares neighbouring pictures along a camera path.
- ``precision``: the networks in half precision.
- ``paper_table``: the table of the paper.
- ``report``: writes the results; ``command``: the command line.

Importing this package loads no heavy module; each name is imported on first use.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .methods import true_visibility
    from .precision import precision_table
    from .report import format_table, save
    from .room_scores import evaluate

__all__ = ["evaluate", "format_table", "precision_table", "save", "true_visibility"]

_WHERE = {
    "evaluate": "room_scores", "format_table": "report", "precision_table": "precision", "save": "report",
    "true_visibility": "methods",
}


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_WHERE[name]}"), name)
