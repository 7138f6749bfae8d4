"""How good the pictures are: rooms with registered truth, at several densities, by every way of making a picture.

``room_scores`` runs it; ``methods`` are the ways, ``outside`` and ``open3d_points`` other people's; ``figures`` judges one
picture against its truth, ``flip`` is one of its judges; ``worse`` counts the views in which a network's picture is worse
than the filled one; ``heldout`` judges any scan by points withheld from it; ``flicker`` judges neighbouring pictures of a
camera move, ``precision`` the networks in half precision; ``report`` writes it all down; ``command`` is the command line's
part. Importing this loads nothing heavy: names come when used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from model.evaluation.methods import true_visibility
    from model.evaluation.precision import precision_table
    from model.evaluation.report import format_table, save
    from model.evaluation.room_scores import evaluate

__all__ = ["evaluate", "format_table", "precision_table", "save", "true_visibility"]

_WHERE = {
    "evaluate": "room_scores", "format_table": "report", "precision_table": "precision", "save": "report",
    "true_visibility": "methods",
}


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_WHERE[name]}"), name)
