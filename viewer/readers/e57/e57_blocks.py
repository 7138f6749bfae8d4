"""Records from the middle of an E57, in blocks, through the packets of its points (viewer.readers.e57.e57_packets).

An index holds how many points each block of records has, since records without a return are not points.  It is made once, from
the fields that say so.
"""

import threading
import xml.etree.ElementTree as ElementTree
from typing import TYPE_CHECKING

import numpy as np

from ..record_blocks import RecordBlocks
from ..source import Records
from .e57_nodes import library, open_e57
from .e57_packets import PacketReader, UnknownPacking
from .e57_records import RawField, columns_of, fields_of

if TYPE_CHECKING:
    from .e57_source import E57Source

BLOCK = 1 << 16
"""Records of a block: those of pumpA.e57 are decoded in about 20 ms of CPU time, with all their fields."""


def e57_blocks(source: "E57Source", vectors: list[ElementTree.Element | None],
               deciding: list[list[str]]) -> RecordBlocks | None:  # fmt: skip
    """The blocks of a file; None where points are packed in a way that only libe57 decodes.

    vectors: the ``points`` elements of its scans.  deciding: of each scan, the fields by which its records are points or not.
    Raises InputError where the file is damaged.
    """
    file, lock = source.path.open("rb"), threading.Lock()
    readers: list[PacketReader | None] = []
    try:
        readers += [None if vector is None else PacketReader(source.path, file, vector) for vector in vectors]
    except UnknownPacking:
        file.close()
        return None
    with open_e57(source.path) as opened:
        data = opened.root()["data3D"]
        fields = [[] if reader is None else fields_of(library().StructureNode(data[number]["points"].prototype()))[0]
                  for number, reader in enumerate(readers)]  # fmt: skip
    if any(reader is not None and not {field.name for field in known} <= {field.name for field in reader.fields}
           for reader, known in zip(readers, fields, strict=True)):  # fmt: skip
        file.close()
        return None
    places: list[tuple[int, int]] = []
    points: list[int] = []
    for number, reader in enumerate(readers):
        for start in range(0, 0 if reader is None else reader.count, BLOCK):
            assert reader is not None
            valid = source.valid_records(number, reader.read(start, BLOCK, deciding[number]))
            places.append((number, start))
            points.append(min(BLOCK, reader.count - start) if valid is None else int(valid.sum()))

    def read(block: int) -> Records:
        number, start = places[block]
        reader = readers[number]
        assert reader is not None
        with lock:  # the file has one position
            scaled = reader.read(start, BLOCK, [field.name for field in fields[number]])
        return _records(source, number, fields[number], scaled)

    return RecordBlocks(np.append(0, np.cumsum(points)), read)


def _records(source: "E57Source", number: int, fields: list[RawField], scaled: dict[str, np.ndarray]) -> Records:
    """scaled: (n,) float64 of each field."""
    plain = [RawField(field.name, field.dtype, field.kind) for field in fields]
    valid, chunk = source.placed(number, plain, scaled)
    if valid is not None:
        scaled = {name: values[valid] for name, values in scaled.items()}
    return Records(chunk.xyz, chunk.rgb, number, columns_of(plain, scaled))
