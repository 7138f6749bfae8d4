"""Which files in a folder a publication wrote: these alone may be replaced or removed by the next one.

Names do not tell: `index.html` and `places` are names of other people's pages, too.  In a folder whose page is ours, files with
our names are ours, also damaged ones; in any other folder each file must begin as we begin it.
"""

import os
import re
from pathlib import Path

from ...common.errors import InputError, Option
from .coming_files import BEFORE, COMPLETE, NAME

PAGE_FILES = ("page.css", "page.js", "index.html")
OVERVIEW = "overview.html"
ENTRIES = ("places", "notes", "scene.js", OVERVIEW, *PAGE_FILES)
"""All that may be in the folder of a publication."""
PARTS = ("first", "full", "depth", "second")
"""Of a place, a file each."""

_DATA = rb"\A/\*[^*]*\*/POINTGLASS\("
_HTML = rb'(?is)\A<!doctype html>.*<meta name="generator" content="pointglass'
_BEGINS = {
    "index.html": _HTML,
    OVERVIEW: _HTML,
    "page.css": rb"\A/\* The page of pointglass publish",
    "page.js": rb"\A/\* sources [0-9a-f]{64} \*/",
    "scene.js": _DATA,
    rf"places/\d{{3,}}\.({'|'.join(PARTS)})\.js": _DATA,
    r"notes/\d{3,}\.picture\.js": _DATA,
}
"""Pattern of a path in the folder of a publication -> how the file begins."""
_HEAD = 4096
_COMING = re.compile(rf"{NAME}/(?:{BEFORE}-)?")
_PARTIAL = re.compile(r"(?:.*/)?\.[^/]+\.[0-9a-f]{16}\.\d+\.partial(?:\.\w+)?")
"""Temporary files of a process that was killed (model/common/files/temporary.py)."""
_SYSTEM = {".DS_Store", "Thumbs.db", "desktop.ini"}
"""What file managers leave in folders."""


def check_folder(out: Path) -> None:
    """Raises InputError, naming it, where something is in the folder that no publication wrote.

    Hidden entries of the folder itself, such as `.git`, are never touched, and allowed."""
    if not out.exists():
        return
    if not out.is_dir():
        raise InputError("a file has this name", file=out, remedy=("choose another ", Option("--out")))
    if (other := _foreign(out)) is not None:
        raise InputError(f"holds other files ({other})", file=out, remedy="give a new or empty folder, or one of publish")


def _foreign(out: Path) -> str | None:
    """The first file that is not ours, as a path within ``out``."""
    pages = (out / "index.html", out / NAME / "index.html", out / NAME / f"{BEFORE}-index.html")
    marked = any(_begins(page, _BEGINS["index.html"]) for page in pages)
    for folder, folders, files in os.walk(out):
        here = Path(folder).relative_to(out)
        if folder == str(out):
            folders[:] = [name for name in folders if not name.startswith(".")]
            files = [name for name in files if not name.startswith(".")]
        for name in sorted(files):
            path = (here / name).as_posix()
            if name not in _SYSTEM and not _PARTIAL.fullmatch(path) and not _is_ours(out / path, path, marked):
                return path
        for name in sorted(folders):
            if _COMING.sub("", (here / name).as_posix()) not in (NAME, "places", "notes"):
                return (here / name).as_posix()
    return None


def _is_ours(file: Path, path: str, marked: bool) -> bool:
    """path: within the folder of the publication.  marked: the page there is ours."""
    if path == f"{NAME}/{COMPLETE}":
        return True
    name = _COMING.sub("", path)
    pattern = next((begin for known, begin in _BEGINS.items() if re.fullmatch(known, name)), None)
    return pattern is not None and ((marked and path != "index.html") or _begins(file, pattern))


def _begins(file: Path, pattern: bytes) -> bool:
    try:
        with file.open("rb") as opened:
            return re.match(pattern, opened.read(_HEAD)) is not None
    except OSError:
        return False
