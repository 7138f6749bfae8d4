"""GLSL from files: includes that keep line numbers, and constants that host and shaders share.

``#include "common_x.glsl"`` is resolved here, with ``#line`` so that a driver's message names a line of a file; the file
numbers it uses are listed in the error raised.  Binding points and workgroup sizes live in this module and reach every
shader as ``#define``s.
"""

import re
from collections.abc import Callable
from functools import cache
from typing import NoReturn

import moderngl

from ...common.errors import DeviceError
from ...common.paths import shaders_dir

TILE = (16, 8)
"""Pixels (width, height) that a workgroup of an image pass covers: 128 invocations, a multiple of every GPU's wave."""
BATCH = 256
"""Points of a batch at most, all of one cell.  128 to 512 differ by 5 % in software OpenGL; open on GPUs."""
STRETCH = 8
"""Consecutive workgroups that go to one thread of software OpenGL.  Both passes over four scans took 0.92 to 1 of the time of
one contiguous half for each of two threads; with 1 up to 1.06, because both threads then draw into the same pixels."""

BINDINGS = {
    "FRAME": 0, "STATIONS": 1, "EDITS": 2,
    "POINTS": 0, "BATCHES": 1, "CELLS": 2, "KEYS": 3, "SUMS": 4, "NETWORK": 5,
    "APPENDED": 2, "PYRAMID": 4, "COMMANDS": 5, "MARKS": 6, "FLAGS": 7, "CARRY": 7, "PHOTOS": 6, "PHOTO_RECORDS": 7,
}  # fmt: skip
"""Binding points: FRAME, STATIONS and EDITS are uniform blocks, the rest storage blocks.  OpenGL 4.3 guarantees eight of
those, so blocks that no pass uses together share a number."""

UNITS = {"TO_LINEAR": 14, "TO_SRGB": 15}
"""Texture units of the tables of linear light; passes number their own textures from 0.  OpenGL guarantees 16."""

EXTENSIONS = {"WIDE_SUMS": ("GL_ARB_gpu_shader_int64", "GL_NV_shader_atomic_int64")}
"""GLSL extensions that a shader with the named define needs."""
EXTENDED_VERSION = 440
"""GLSL version of shaders with extensions: the first in which the reference compiler has 64-bit atomics."""

_INCLUDE = re.compile(r'^\s*#include\s+"([\w.]+)"\s*$')


@cache
def _lines(name: str) -> tuple[str, ...]:
    return tuple((shaders_dir() / name).read_text(encoding="ascii").splitlines())


def _expand(name: str, files: list[str]) -> list[str]:
    """The lines of a file with its includes in place, each file once."""
    number = len(files)
    files.append(name)
    out = [f"#line 1 {number}"]
    for index, line in enumerate(_lines(name)):
        if match := _INCLUDE.match(line):
            if match[1] not in files:
                out += _expand(match[1], files)
            out.append(f"#line {index + 2} {number}")
        else:
            out.append(line)
    return out


def expanded(name: str) -> list[str]:
    """The lines of a shader with its includes in place."""
    return _expand(name, [])


def source(name: str, defines: dict[str, object] | None = None) -> tuple[str, list[str]]:
    """Full text of a shader and the names behind its file numbers.  Floats among the defines keep all their digits."""
    constants: dict[str, object] = {f"{key}_BINDING": value for key, value in BINDINGS.items()}
    constants |= {f"{key}_UNIT": value for key, value in UNITS.items()}
    constants |= {"TILE_X": TILE[0], "TILE_Y": TILE[1], **(defines or {})}
    files: list[str] = []
    body = _expand(name, files)
    needed = [name for key, names in EXTENSIONS.items() if constants.get(key) is not None for name in names]
    head = [f"#version {EXTENDED_VERSION if needed else 430} core", *(f"#extension {name} : require" for name in needed)]
    head += [f"#define {key} {value!r}" for key, value in constants.items() if value is not None]
    return "\n".join([*head, *body]) + "\n", files


def _explain(error: Exception, names: list[list[str]]) -> DeviceError:
    listing = "; ".join(", ".join(f"{i} = shaders/{name}" for i, name in enumerate(files)) for files in names)
    return DeviceError(f"a shader does not compile on this driver (files {listing}): {' '.join(str(error).split())}")


class Programs:
    """Owns the programs of a context; each is compiled once, whatever picture sizes are used."""

    def __init__(self, context: "moderngl.Context"):
        self.context = context
        self._made: dict[tuple, moderngl.ComputeShader | moderngl.Program] = {}
        self._units: dict[int, dict[str, int]] = {}  # of the samplers, by program

    def compute(self, name: str, **defines: object) -> "moderngl.ComputeShader":
        """A compute program from ``shaders/name``.  Raises DeviceError naming file and line."""
        key = (name, *sorted(defines.items(), key=str))
        if key not in self._made:
            text, files = source(name, defines)
            try:
                self._made[key] = self.context.compute_shader(text)
            except moderngl.Error as error:
                raise _explain(error, [files]) from None
        return self._made[key]  # type: ignore[return-value]

    def agree_on_units(self, program: "moderngl.ComputeShader", units: dict[str, int],
                       refuse: Callable[[list[str], str], NoReturn]) -> None:
        """Gives the samplers of a program their texture units, once; calls ``refuse`` where they have others."""
        before = self._units.setdefault(program.glo, units)
        if before is units:
            for name, unit in units.items():
                if name in program:
                    program[name] = unit
        elif before != units:
            refuse([*units], "has other units in another pass of the program")

    def drawing(self, vertex: str, fragment: str, **defines: object) -> "moderngl.Program":
        """A vertex and fragment program.  Raises DeviceError naming file and line."""
        key = (vertex, fragment, *sorted(defines.items(), key=str))
        if key not in self._made:
            (vertex_text, vertex_files), (fragment_text, fragment_files) = (
                source(name, defines) for name in (vertex, fragment)
            )
            try:
                self._made[key] = self.context.program(vertex_shader=vertex_text, fragment_shader=fragment_text)
            except moderngl.Error as error:
                raise _explain(error, [vertex_files, fragment_files]) from None
        return self._made[key]  # type: ignore[return-value]

    def release(self) -> None:
        for made in self._made.values():
            made.release()
        self._made.clear()
        self._units.clear()


def groups(width: int, height: int) -> tuple[int, int, int]:
    """Workgroups that cover a picture with TILE."""
    return -(-width // TILE[0]), -(-height // TILE[1]), 1
