"""The seeds of every format that the program reads, made once in a child process.  The same bytes each time."""

import os
import pickle
import tempfile
import traceback
from functools import cache
from pathlib import Path

from .other_seeds import cameras, grid, meshes, rooms, weights, window_files
from .scan_seeds import FOLDERS, ONE_FILE, texts
from .seed import Seed, files_of

KEPT = Path(__file__).parent / "kept"
"""Mutants that failed once, each a folder; which files have changed and what runs is in its ``case.json``."""


def seeds(form: str) -> tuple[Seed, ...]:
    """The seeds of one format."""
    return tuple(seed for seed in _group(next((group for group in _GROUPS if form in group), form)) if seed.format == form)


@cache
def _group(form: str | tuple[str, ...]) -> tuple[Seed, ...]:
    """The seeds of formats that are made together, in a child process, since lazrs' threads are missing in forks."""
    with tempfile.NamedTemporaryFile() as file:
        child = os.fork()
        if child == 0:
            code = 1
            try:
                Path(file.name).write_bytes(pickle.dumps(_made(form)))
                code = 0
            except BaseException:
                traceback.print_exc()
            os._exit(code)
        if os.waitpid(child, 0)[1]:
            raise RuntimeError(f"the seeds of {form} cannot be made")
        return pickle.loads(Path(file.name).read_bytes())


_GROUPS = (("nerfstudio", "colmap", "tum"), ("like", "project", "state"))
"""Formats whose seeds are made together: what makes them takes long to import."""


def _made(form: str | tuple[str, ...]) -> tuple[Seed, ...]:
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        if form in ONE_FILE:
            for name, make in ONE_FILE[form].items():
                make(folder / name)
            return tuple(Seed(form, name, "scan", {name: data}, name) for name, data in files_of(folder).items())
        if form in FOLDERS:
            found = []
            for name, make in FOLDERS[form].items():
                make(folder / name)
                found.append(Seed(form, name, "scan", files_of(folder / name), ""))
            return tuple(found)
        if form == _GROUPS[0]:
            return tuple(cameras(folder).values())
        if form == _GROUPS[1]:
            return tuple(window_files())
        assert isinstance(form, str), form
        if form == "text":
            return tuple(Seed(form, name, "scan", {name: data}, name) for name, data in texts().items())
        if form == "grid":
            grid(folder)
            return (Seed(form, "grid", "grid", files_of(folder / "grid"), ""),)
        if form == "mesh":
            return tuple(meshes())
        if form == "weights":
            return (weights(folder),)
        if form == "rooms":
            return tuple(rooms(folder))
    raise KeyError(form)


FORMATS = (*ONE_FILE, "text", *FOLDERS, "grid", "nerfstudio", "colmap", "tum", "like", "project", "state", "weights", "rooms",
           "mesh")
"""Everything that is read."""
