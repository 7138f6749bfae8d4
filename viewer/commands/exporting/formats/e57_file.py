"""An E57 that is being written through libe57: header, nodes copied from another file, errors.

Frame and units: those of E57, metres in the file's frame.
"""

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from ....readers.e57.e57_nodes import first_line, library, value_of
from ....readers.e57.e57_records import BLOCK, OWN, arrays_for, buffers_of, fields_of, raw_blocks

EXTENSION = (OWN, "urn:pointglass:columns:1")
"""Prefix and name of the extension that holds columns for which E57 has no field."""
_BLOB = 1 << 22
"""Bytes of a photograph copied at a time."""


COLOURS = ("colorRed", "colorGreen", "colorBlue")


def as_stored(ends: tuple[float, float], scale: float | None, offset: float) -> tuple[float, float]:
    """Values as a field stores them; scale, offset: of scaled integers."""
    return ends if scale is None else ((ends[0] - offset) / scale, (ends[1] - offset) / scale)


@contextmanager
def new_file(path: Path) -> Iterator[Any]:
    """A file for writing, closed at the end.  Errors of libe57 in writing become OSError.  On failure what was written is of no
    use, and the caller removes it."""
    libe57 = library()
    image = None
    try:
        image = libe57.ImageFile(os.fsencode(path), "w")
        image.extensionsAdd("", libe57.E57_V1_0_URI)
        yield image
        image.close()
    except libe57.E57Exception as error:
        raise OSError(errno.EIO, f"libe57: {first_line(error)}", str(path)) from None
    finally:
        if image is not None and image.isOpen():
            image.cancel()


@contextmanager
def writer_of(points, buffers) -> Iterator[Any]:
    """A writer of a CompressedVector that is closed before the file is."""
    writer = points.writer(buffers)
    try:
        yield writer
    finally:
        if writer.isOpen():
            writer.close()


def header(image: Any, texts: dict[str, str]) -> None:
    """The root's fields of a new file; ``texts`` adds to them."""
    libe57, root = library(), image.root()
    known = {
        "formatName": "ASTM E57 3D Imaging Data File",
        "guid": new_guid(),
        "e57LibraryVersion": libe57.E57_LIBRARY_ID,
    } | texts
    for name, text in known.items():
        root.set(name, libe57.StringNode(image, text))
    for name, number in (("versionMajor", libe57.E57_FORMAT_MAJOR), ("versionMinor", libe57.E57_FORMAT_MINOR)):
        root.set(name, libe57.IntegerNode(image, number))


def new_guid() -> str:
    return f"{{{uuid4()}}}"


@dataclass
class NodeCopy:
    """Copies nodes into ``image``.  Blobs and CompressedVectors get their content by :meth:`finish`, once their parents belong
    to the file.  texts: paths of point fields that were left out, since pye57 does not read texts."""

    image: Any
    texts: list[str] = field(default_factory=list)
    _later: list[tuple[Any, Any, Any]] = field(default_factory=list)

    def copied(self, node: Any, source: Any, without: tuple[str, ...] = ()) -> Any:
        """A copy of a node of the file ``source``.  without: names of children of a Structure that are left out."""
        libe57, image = library(), self.image
        if isinstance(node, libe57.StructureNode):
            made = libe57.StructureNode(image)
            for index in range(node.childCount()):
                child = node[index]
                if child.elementName() not in without:
                    made.set(child.elementName(), self.copied(child, source))
            return made
        if isinstance(node, libe57.VectorNode):
            made = libe57.VectorNode(image, node.allowHeteroChildren())
            for index in range(node.childCount()):
                made.append(self.copied(node[index], source))
            return made
        if isinstance(node, libe57.BlobNode):
            made = libe57.BlobNode(image, node.byteCount())
            self._later.append((node, made, source))
            return made
        if isinstance(node, libe57.CompressedVectorNode):
            made = self.vector(node)
            self._later.append((node, made, source))
            return made
        return self._leaf(node)

    def limits(self, node: Any, source: Any, ends: tuple[float, float]) -> Any:
        """A copy of a scan's colorLimits, widened where they do not hold ``ends``, values of black and full."""
        libe57 = library()
        made = libe57.StructureNode(self.image)
        for index in range(node.childCount()):
            child = node[index]
            name, stated = child.elementName(), value_of(child)
            wanted = None
            if stated is not None:
                wanted = min(stated, ends[0]) if name.endswith("Minimum") else max(stated, ends[1])
            if wanted is None or wanted == stated:
                made.set(name, self.copied(child, source))
            elif isinstance(child, libe57.IntegerNode):
                made.set(name, libe57.IntegerNode(self.image, round(wanted)))
            else:
                made.set(name, libe57.FloatNode(self.image, wanted, libe57.E57_DOUBLE))
        return made

    def vector(self, node: Any, colours: tuple[float, float] | None = None) -> Any:
        """An empty CompressedVector with the same fields.  colours: values of black and full, which the ranges of the colour
        fields are widened to hold."""
        libe57 = library()
        prototype = self._prototype(libe57.StructureNode(node.prototype()), "", colours)
        return libe57.CompressedVectorNode(self.image, prototype, libe57.VectorNode(self.image, True))

    def _prototype(self, structure: Any, prefix: str, colours: tuple[float, float] | None = None) -> Any:
        libe57 = library()
        made = libe57.StructureNode(self.image)
        for index in range(structure.childCount()):
            child = structure[index]
            name = child.elementName()
            if isinstance(child, libe57.StructureNode):
                made.set(name, self._prototype(child, f"{prefix}{name}/"))
            elif isinstance(child, (libe57.IntegerNode, libe57.ScaledIntegerNode, libe57.FloatNode)):
                made.set(name, self._leaf(child, colours if not prefix and name in COLOURS else None))
            else:
                self.texts.append(prefix + name)
        return made

    def _leaf(self, node: Any, held: tuple[float, float] | None = None) -> Any:
        """held: values that its range is widened to hold."""
        libe57, image = library(), self.image
        if isinstance(node, libe57.StringNode):
            return libe57.StringNode(image, node.value())
        low, high = node.minimum(), node.maximum()
        scaled = isinstance(node, libe57.ScaledIntegerNode)
        if held is not None:
            ends = as_stored(held, node.scale() if scaled else None, node.offset() if scaled else 0.0)
            kind = float if isinstance(node, libe57.FloatNode) else round
            low, high = min(low, kind(min(ends))), max(high, kind(max(ends)))
        if isinstance(node, libe57.IntegerNode):
            return libe57.IntegerNode(image, node.value(), low, high)
        if scaled:
            return libe57.ScaledIntegerNode(image, node.rawValue(), low, high, node.scale(), node.offset())
        return libe57.FloatNode(image, node.value(), node.precision(), low, high)

    def finish(self) -> None:
        """Copies the content of blobs and CompressedVectors."""
        libe57 = library()
        later, self._later = self._later, []
        for node, made, source in later:
            if isinstance(node, libe57.BlobNode):
                size = node.byteCount()
                buffer = np.empty(min(size, _BLOB), np.uint8)
                for start in range(0, size, _BLOB):
                    count = min(_BLOB, size - start)
                    node.read(buffer, start, count)
                    made.write(buffer, start, count)
            else:
                self._copy_all(node, made, source)

    def _copy_all(self, node: Any, made: Any, source: Any) -> None:
        fields, _ = fields_of(library().StructureNode(node.prototype()))
        count = int(node.childCount())
        if not fields or count == 0:
            return
        arrays = arrays_for(fields, min(count, BLOCK))
        with writer_of(made, buffers_of(self.image, fields, arrays, len(next(iter(arrays.values()))))) as writer:
            for n in raw_blocks(source, node, fields, arrays):
                writer.write(n)
