"""A file that is exported to its own format without a selection: its bytes.

Nothing is decoded, so that nothing is lost, not even what no library reads: texts beside E57 points, the octree of COPC, the
waveforms of compressed point formats 9 and 10, which lazrs decodes wrongly where several scanner channels alternate.
"""

from pathlib import Path

from ...common.progress import progress
from ...readers.moved_source import unmoved
from .record_stream import SourceRecords
from .target import Target

_BLOCK = 1 << 24
"""Bytes copied at a time."""


def can_copy(stream: SourceRecords, target: Target) -> bool:
    """Whether the file to write is the only source as it is: nothing left out, recoloured, moved or assigned."""
    source = stream.sources[0]
    marks = stream.selection.marks
    same = stream.everything and (marks is None or not marks.reclassifies)
    plain = same and stream.colours is None and not stream.scene.meta.assigned and unmoved(source)[1] is None
    return len(stream.sources) == 1 and plain and source.format in target.same and source.path.is_file()


def copy_file(path: Path, stream: SourceRecords) -> int:
    """Copies the file; returns the number of its records."""
    source = stream.sources[0]
    with source.path.open("rb") as file, path.open("wb") as out, progress(source.path.stat().st_size, "copying", "B") as meter:
        while block := file.read(_BLOCK):
            out.write(block)
            meter.update(len(block))
    return source.count or stream.scene.count
