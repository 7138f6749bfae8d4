"""The error where a selection leaves no point: classes that no point has, or else clips and what is hidden."""

from ...common.errors import InputError
from ..selection import Selection
from .set_changes import class_counts

_NAMED = 20
"""Classes that the error names."""


def empty_selection(selection: Selection) -> InputError:
    """The error where a selection leaves no point.  Bounds in file coordinates."""
    scene, asked = selection.scene, selection.classes
    there = sorted(class_counts(scene, selection.marks))
    if asked is not None and asked.isdisjoint(there or [0]):
        named = ", ".join(map(str, there[:_NAMED])) + (f" and {len(there) - _NAMED} more" if len(there) > _NAMED else "")
        remedy = f"give some of those that there are: {named}" if there else "leave it out: the scan has no classes"
        return InputError(f"no point has {_classes(asked)}", option="--class", value=",".join(map(str, sorted(asked))),
                          remedy=remedy)
    low, high = ([f"{value:.3f}" for value in corner] for corner in scene.bounds)
    which = "no point" if asked is None else f"no point of {_classes(asked)}"
    return InputError(f"the clips and what is hidden leave {which}; the scan lies between "
                      f"{','.join(low)} and {','.join(high)} (file coordinates)")


def _classes(codes: frozenset[int]) -> str:
    listed = [str(code) for code in sorted(codes)]
    return f"class {listed[0]}" if len(listed) == 1 else f"class {', '.join(listed[:-1])} or {listed[-1]}"
