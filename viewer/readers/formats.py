"""The table of formats that can be opened, and the reader for a path.  Imports nothing heavy: help and messages read it too.

The format of a file is recognised by its first bytes; text files of points have no magic bytes and are recognised by their
suffix.  Octrees of many files are folders (Potree, EPT), opened by the folder or by the file in it that describes them.
"""

import re
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

from ..common.errors import InputError, Option
from .grid_folder import is_grid
from .remote.address import SCHEMES, address_in, is_address
from .splats.glb_head import MAGIC as GLB
from .splats.glb_head import holds_splats
from .splats.spz_stream import FRONT, GZIP, spz_front
from .splats.spz_stream import MAGIC as SPZ
from .text.utf16 import as_utf8

if TYPE_CHECKING:
    from .moved_source import Moves
    from .source import Source


@dataclass(frozen=True)
class Format:
    """names: as in messages.  reader: module in this package, and class or function.  magic: first bytes of a file.
    entry: for folders, the file that describes the folder, and other files of which one must be beside it."""

    names: tuple[str, ...]
    reader: tuple[str, str]
    suffixes: tuple[str, ...] = ()
    magic: tuple[bytes, ...] = ()
    entry: tuple[str, tuple[str, ...]] | None = None
    takes_columns: bool = False


FORMATS = (
    Format(("E57",), ("e57.e57_source", "E57Source"), (".e57",), (b"ASTM",)),
    Format(("LAS", "LAZ", "COPC"), ("las.las_source", "LasSource"), (".las", ".laz"), (b"LASF",)),
    Format(("PLY",), ("ply.splat_ply_source", "open_ply"), (".ply",), (b"ply\n", b"ply\r")),
    Format(("SPZ",), ("splats.spz_source", "SpzSource"), (".spz",), (SPZ,)),
    Format(("GLB of splats",), ("splats.glb_source", "SplatGlbSource"), (".glb",), (GLB,)),
    Format(("PCD",), ("pcd.pcd_source", "PcdSource"), (".pcd",), (b"# .PCD", b"VERSION 0.", b"VERSION .")),
    Format(("PTS",), ("text.pts", "open_pts"), (".pts",), takes_columns=True),
    Format(("PTX",), ("text.ptx", "PtxSource"), (".ptx",)),
    Format(("ESRI grid",), ("text.esri_grid", "EsriGridSource"), (".asc",), (b"ncols", b"NCOLS", b"nrows", b"NROWS")),
    Format(("XYZ", "TXT", "CSV", "ASC"), ("text.xyz", "XyzSource"), (".xyz", ".txt", ".csv", ".asc"), takes_columns=True),
    Format(("Potree",), ("octree.potree1", "Potree1Source"), entry=("cloud.js", ())),
    Format(("Potree",), ("octree.potree2", "Potree2Source"), entry=("metadata.json", ("octree.bin", "hierarchy.bin"))),
    Format(("EPT",), ("octree.ept", "EptSource"), entry=("ept.json", ())),
)
_FILES = [name for row in FORMATS if not row.entry for name in row.names]
_FOLDERS = list(dict.fromkeys(name for row in FORMATS if row.entry for name in row.names))
KNOWN = f"{', '.join(_FILES[:-1])} or {_FILES[-1]} file, or a {' or '.join(_FOLDERS)} folder"
"""The text after "give a" in messages."""
KNOWN_FILES = ", ".join(_FILES)
"""The formats that are single files, for the help."""
KNOWN_FOLDERS = " or ".join(_FOLDERS)
_TEXTS = tuple(suffix for row in FORMATS if not (row.magic or row.entry) for suffix in row.suffixes)
_ADDRESS = re.compile(r"([A-Za-z][A-Za-z0-9+.-]+):/+(.*)", re.DOTALL)  # of one slash or more: a Path has lost one of two
_GDAL_ADDRESS = re.compile(r"/vsi\w+/")
_DESCRIBING = (".js", ".json")  # suffixes of files that describe a folder
_MOST_DESCRIBING, _DESCRIPTION_BYTES = 20, 1 << 16
"""Files of a folder that are looked at, and bytes of each, to find the one that describes it: 1.3 MB at most."""
_KEYS = {"octree.potree1": (b"octreeDir", b"boundingBox"), "octree.potree2": (b"hierarchy", b"encoding"),
         "octree.ept": (b"schema", b"dataType")}
"""JSON keys by which the file that describes a folder is recognised, by module of its reader."""
_UTF_16 = (b"\xff\xfe", b"\xfe\xff")  # byte order marks
_ANYTHING = (".txt", ".csv", ".asc")
_HEAD = 64  # bytes read of a file to recognise its format


def entry_of(path: Path) -> Path:
    """The file that describes a Potree or EPT folder, where ``path`` is one; else ``path``.  It may have another name than
    usual."""
    if path.is_dir():
        for row in FORMATS:
            if row.entry and (path / row.entry[0]).is_file() and _is_beside(path / row.entry[0], row):
                return path / row.entry[0]
        try:
            files = [file for file in sorted(path.iterdir()) if file.suffix.lower() in _DESCRIBING][:_MOST_DESCRIBING]
        except OSError:
            return path
        return next((file for file in files if folder_format(file)), path)
    return path


def folder_format(path: Path) -> Format | None:
    """The format of the folder that ``path`` is the describing file of, by its name, else by its contents."""
    named = [row for row in FORMATS if row.entry and row.entry[0] == path.name.lower() and _is_beside(path, row)]
    if named or path.suffix.lower() not in _DESCRIBING or not path.is_file():
        return named[0] if named else None
    try:
        with path.open("rb") as file:
            head = file.read(_DESCRIPTION_BYTES)
    except OSError:
        return None
    rows = (row for row in FORMATS if row.entry and all(b'"%b"' % key in head for key in _KEYS[row.reader[0]]))
    return next((row for row in rows if _is_beside(path, row)), None)


def _is_beside(path: Path, row: Format) -> bool:
    others = row.entry[1] if row.entry else ()
    return not others or any((path.parent / other).exists() for other in others)


def scans_inside(path: Path) -> list[Path]:
    """The scans in a folder that is no scan itself, by name; where it has none, the grids that ``convert --each`` made in it;
    none for any other path."""
    if not path.is_dir() or is_grid(path) or entry_of(path) != path:
        return []
    try:
        inside = [file for file in sorted(path.iterdir()) if not file.name.startswith(".")]
        return [file for file in inside if is_scan(file)] or [file for file in inside if is_grid(file)]
    except OSError:
        return []


def name_of(path: Path) -> str:
    """The name of a scan: that of its file without the suffix, or that of its folder."""
    return path.absolute().parent.name if folder_format(path) else path.stem


def is_scan(path: Path) -> bool:
    """Whether a path has the suffix of a scan, or is a Potree or EPT folder.  The contents are not checked.

    Files with suffixes of _ANYTHING count as scans only where a person names them.
    """
    if path.is_dir():
        return entry_of(path) != path
    suffix = path.suffix.lower()
    if suffix == ".glb" and not holds_splats(path):
        return False  # a mesh
    return suffix not in _ANYTHING and any(suffix in row.suffixes for row in FORMATS) and (path.is_file() or is_address(path))


def refuse_address(path: Path, why: str = "only scans are read from addresses") -> None:
    """Raises InputError where ``path`` is an address, such as https://host/c.json, and not a file."""
    if path.exists():
        return
    address = str(path) if _GDAL_ADDRESS.match(str(path)) else None
    if match := _ADDRESS.match(str(path)):
        if match[1].lower() == "file":
            raise InputError(f"file:///{match[2]}: give the path without file://")
        address = f"{match[1]}://{match[2]}"
    if address:
        raise InputError(f"{address.split('?')[0]}: is an address; {why}",
                         remedy="download it, and give the path of the file or folder")


def check_address(path: Path) -> None:
    """Raises InputError where ``path`` is an address from which no scan can be read: of another scheme than SCHEMES."""
    if address_in(path) is None:
        refuse_address(path, f"scans are read from {', '.join(f'{scheme}://' for scheme in SCHEMES)}")


def check_file(path: Path) -> None:
    """Raises InputError unless ``path`` is a readable file that is not empty."""
    refuse_address(path)
    try:
        if not path.exists():
            raise InputError("no such file", file=path)
        if path.is_dir():
            if is_grid(path):
                raise InputError("a folder made by convert is not a scan", file=path,
                                 remedy="give the scans it was made from")
            raise InputError("is a folder, not a scan", file=path, remedy=f"give an {KNOWN}, or a folder made by convert")
        if not path.is_file():
            raise InputError("not a regular file", file=path, remedy="copy it to disk first")
        if path.stat().st_size == 0:
            raise InputError("the file is empty (0 bytes)", file=path, remedy="copy or export it again")
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", file=path) from None


def open_source(path: Path, columns: str | None = None) -> "Source":
    """The reader for ``path``, with a warning where the suffix belongs to another format.

    columns: the columns of a text file (viewer.readers.text.text_columns); None: they are recognised.  Other formats ignore
    them.  Raises InputError for files of unknown format, and the errors of the reader.
    """
    path = entry_of(path)
    check_file(path)
    try:
        with path.open("rb") as file:
            head = file.read(_HEAD)
            if head.startswith(GZIP):
                head = SPZ if path.suffix.lower() == ".spz" else spz_front(head + file.read(FRONT))
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", file=path) from None
    suffix = path.suffix.lower()
    if suffix in _TEXTS:
        head = as_utf8(head)
    row = folder_format(path) or next((row for row in FORMATS if head.startswith(row.magic or (b"\0" * _HEAD,))), None)
    if row is None and suffix in _TEXTS:
        from .text.esri_grid import is_grid_text, other_grid

        if grid := other_grid(head):
            raise InputError(f"is a {grid}, which is not read", file=path,
                             remedy="export it as ESRI ASCII grid or as points x y z")
        row = next(row for row in FORMATS if row.reader[0] == "text.esri_grid") if is_grid_text(head) else None
    if row is None:
        row = next((row for row in FORMATS if suffix in row.suffixes and not row.magic), None)
        if row is None or b"\0" in head or _packed(head):
            raise InputError(f"{_guess(head, suffix)}; expected an {KNOWN}", file=path)
    reader = getattr(import_module(f".{row.reader[0]}", __package__), row.reader[1])
    source = reader(path, columns) if row.takes_columns else reader(path)
    if row.magic and suffix not in row.suffixes:
        named = f"named {suffix}" if suffix else "named without a suffix"
        source.warnings.insert(0, f"{path.name}: {named} but holds {source.format}; read as that")
    return source


def takes_columns(path: Path) -> bool:
    """Whether a path has the suffix of a text file of points, whose columns a person may name."""
    return any(path.suffix.lower() in row.suffixes for row in FORMATS if row.takes_columns)


def open_sources(paths: list[Path], columns: str | None = None, moves: "Moves | None" = None) -> "list[Source]":
    """The readers for several paths.  moves: transformations of their coordinates.  Raises InputError as open_source, and where
    columns are named and no file is text."""
    from .moved_source import placed

    _check_columns(paths, columns)
    return [placed(open_source(path, columns), moves) for path in paths]


def open_readable(paths: list[Path], columns: str | None = None,
                  moves: "Moves | None" = None) -> "tuple[list[Source], list[InputError]]":
    """The readers for those of several paths that can be opened, and why each of the others cannot.

    moves: transformations of their coordinates.  Raises InputError where none can be opened, and where columns are named and no
    file is text.
    """
    from .moved_source import placed

    _check_columns(paths, columns)
    sources, left_out = [], []
    for path in paths:
        try:
            sources.append(placed(open_source(path, columns), moves))
        except InputError as error:
            left_out.append(error)
    if not sources and left_out:
        raise left_out[0] if len(paths) == 1 else none_opens(paths, left_out[0])
    return sources, left_out


def none_opens(paths: list[Path], first: InputError) -> InputError:
    """The error where none of several files can be opened.  first: of the first one."""
    return InputError((f"none of the {len(paths)} files can be opened; the first: ", first))


def _check_columns(paths: list[Path], columns: str | None) -> None:
    if columns is not None and not any(map(takes_columns, paths)):
        texts = ", ".join(name for row in FORMATS if row.takes_columns for name in row.names)
        raise InputError((Option("--columns"), f" is for text files of points ({texts})"), file=paths[0],
                         remedy="open this file without it")


def _packed(head: bytes) -> str | None:
    if head.startswith(b"PK\x03\x04"):
        return "is a zip archive, unpack it first"
    if head.startswith(b"\x1f\x8b"):
        return "is gzip-compressed, unpack it first"
    return None


def _guess(head: bytes, suffix: str) -> str:
    if stated := _packed(head):
        return stated
    bare = head.replace(b"\0", b"")
    if suffix in _TEXTS and (head.startswith(_UTF_16) or (0 < len(bare) < len(head) and bare.isascii())):
        return "is UTF-16 text, save it as UTF-8 first (iconv -f UTF-16 -t UTF-8)"
    if any(suffix in row.suffixes for row in FORMATS):
        return f"named {suffix} but does not begin like one (first bytes {head[:4]!r}), damaged or another format"
    if suffix == ".pointglass":  # viewer.work.project.SUFFIX
        return "a project, which only the window, `info`, `section` and `export` open: name its scan"
    return f"not a scan format known here (first bytes {head[:4]!r})"
