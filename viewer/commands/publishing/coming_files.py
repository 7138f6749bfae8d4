"""The files of a publication while it is being made: in ``coming/``, from where they replace the earlier one all at once.

Until all files are there, the publication that the folder shows stays as it is to the byte, also where the process is killed.
Then the folders and files are renamed, a few renames one after the other.  A list of what belongs to the new publication,
``coming/complete.json``, is written before the first rename; the next run finishes the renames of a process that was killed
between two of them.
"""

import contextlib
import json
import os
import shutil
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

from ....model.common.files.atomic_write import write_atomic
from ....model.common.process.signals import undone, uninterrupted
from ....model.common.system import locked
from ...common.errors import InputError, Option
from ...common.failures import tell
from ...common.files import out_folder
from ...common.text import counted

NAME = "coming"
COMPLETE = "complete.json"
BEFORE = "before"


@dataclass(frozen=True)
class ComingFiles:
    """out: the folder of the publication.  entries: names of all files and folders that a publication may have in it; the one
    without which it does not open is the last, and is renamed last."""

    out: Path
    entries: tuple[str, ...]

    @property
    def folder(self) -> Path:
        """Where the new files are written."""
        return self.out / NAME

    @property
    def places(self) -> Path:
        """Where those of places are written."""
        return self.folder / "places"

    @contextlib.contextmanager
    def opened(self, finished: Callable[[], int], places: int) -> Iterator[None]:
        """Makes the folders, and keeps other publications out of ``out`` until the block ends or the process does.

        A replacement that an earlier process began is finished first.  Where the block fails or the process is stopped, says
        what stays.  finished: counts the places that are there, as far as they are of this publication.  places: how many there
        will be.
        Raises InputError where another process publishes into the folder, or it cannot be written."""
        with out_folder(self.out), alone(self.out):
            self.finish()
            for entry in self.folder.iterdir() if self.folder.is_dir() else ():
                if entry != self.places:  # of a run that was killed while it wrote the page
                    _remove(entry)
            with out_folder(self.places), undone(lambda: self._say_kept(finished(), places)):
                yield

    def _say_kept(self, made: int, places: int) -> None:
        if made:
            shown = f"; {self.out} shows the earlier publication" if (self.out / self.entries[-1]).is_file() else ""
            tell(f"{made} of {counted(places, 'place')} stay in {self.folder}, and the same command goes on from there{shown}")

    def keep(self, name: str) -> None:
        """Takes the file of a place from the present publication into the new one."""
        here, there = self.places / name, self.out / "places" / name
        here.unlink(missing_ok=True)
        try:
            os.link(there, here)
        except OSError:  # no links on this file system
            write_atomic(here, lambda path: shutil.copy2(there, path))

    def replace(self, places: Iterable[str], others: Iterable[str]) -> None:
        """Replaces the publication of ``out`` by the new one.  places, others: names of all its files of places and of all its
        other entries.  What else lies in the folder of its places is removed before."""
        kept = set(places)
        for left_over in self.places.iterdir():
            if left_over.name not in kept:
                _remove(left_over)
        complete = json.dumps(["places", *others])
        write_atomic(self.folder / COMPLETE, lambda path: path.write_text(complete))
        self.finish()

    def finish(self) -> None:
        """Renames the files of a publication that is complete into ``out``; does nothing where none is."""
        complete = self.folder / COMPLETE
        if not complete.is_file():
            return
        wanted = set(json.loads(complete.read_text()))
        with uninterrupted():
            for name in self.entries:
                here, there, before = self.folder / name, self.out / name, self.folder / f"{BEFORE}-{name}"
                if name in wanted and here.exists():
                    if there.exists():
                        _remove(before)
                        there.replace(before)
                    here.replace(there)
                elif name not in wanted and there.exists():
                    _remove(before)
                    there.replace(before)
        complete.unlink()
        _remove(self.folder)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


@contextlib.contextmanager
def alone(out: Path) -> Iterator[None]:
    """Keeps other publications out of the folder until the block ends or the process does.  Raises InputError where one is
    being written."""
    try:
        held = locked(out)
    except BlockingIOError:
        raise InputError("another publication is being written into this folder", file=out,
                         remedy=("wait for it, or choose another ", Option("--out"))) from None
    except OSError as error:
        raise InputError(f"cannot be opened ({error.strerror or error})", file=out) from None
    try:
        yield
    finally:
        if held is not None:
            os.close(held)
