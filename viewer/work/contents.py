"""What a document holds beside its scans, in words: for ``pointglass info``, and before unsaved work is restored."""

from ..common.text import counted
from .document import Document


def contents(document: Document) -> list[str]:
    """Such as "2 measurements" or "a new class for 3 points"; empty where a document holds scans and a view only."""
    parts = [(document.measurements, "measurement"), (document.clips, "clip"), (document.viewpoints, "bookmark"),
             (document.path.keyframes, "keyframe"), (document.annotations, "note"), (document.regions, "region"),
             (document.meshes, "mesh file"), (document.photographs, "placed photograph"),
             ([scan for scan in document.scans if scan.transform], "moved scan")]  # fmt: skip
    texts = [counted(len(items), name) for items, name in parts if items]
    if not_shown := sum(region.points.count for region in document.regions if not region.shown):
        texts.append(f"{counted(not_shown, 'point')} in regions that are not shown")
    if classified := sum(change.points.count for change in document.reclassified):
        texts.append(f"a new class for {counted(classified, 'point')}")
    if document.comparison is not None:
        texts.append("a comparison with a model" if document.comparison.with_model else "a comparison of two dates")
    if document.selection:
        texts.append(counted(document.selection.count, "selected point"))
    return texts
