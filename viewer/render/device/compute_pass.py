"""One compute pass: a shader, with the textures, buffers and uniforms that it is given by the shader's own names.

A pass declares its names once.  A name that the shader does not have, and one that the compiled program has and the pass does
not declare, raise where the pass is made (the latter in software OpenGL, where the tests run); a name left out or added in a
call raises there.  A declared name that a driver's compiler has found unused is passed over.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, NoReturn, Protocol

import moderngl

from .context import describe_device
from .shader import BINDINGS, Programs, expanded, groups

if TYPE_CHECKING:
    Size = tuple[int, int]

MAX_GROUPS = 32768
"""Workgroups along x of a dispatch: half of the 65,535 that OpenGL guarantees, and a power of two."""

_IMAGE = re.compile(r"layout\(\w+, *binding *= *(\d+)\) *uniform +(?:(writeonly|readonly) +)?\w*image\w+ +(\w+) *;")
_SAMPLER = re.compile(r"^ *uniform +\w*sampler\w* +(\w+) *;", re.M)
_FIXED = re.compile(r"layout\(binding *= *\w+_UNIT\) *uniform +\w+ +(\w+) *;")
_PLAIN = re.compile(r"^ *uniform +(?!\w*sampler)\w+ +(\w+) *(?:\[\w+\])? *;", re.M)
_BLOCK = re.compile(r"binding *= *(\w+)_BINDING\)[\w ]*\bbuffer +(\w+)")


class Storage(Protocol):
    """A storage buffer, or a part of one."""

    def bind_to_storage_buffer(self, binding: int = 0) -> None: ...


@dataclass(frozen=True)
class Names:
    """What a shader's text declares, all its variants together.

    images: (binding, name) -> whether it is read too.  samplers, uniforms: names.  fixed: samplers whose unit the text gives.
    blocks: name of a storage block -> key of BINDINGS.
    """

    images: dict[tuple[int, str], bool]
    samplers: frozenset[str]
    uniforms: frozenset[str]
    fixed: frozenset[str]
    blocks: dict[str, str]


@cache
def names_of(shader: str) -> Names:
    """The names in the text of ``shaders/shader`` and the files that it includes."""
    text = "\n".join(expanded(shader))
    return Names(
        images={(int(binding), name): access != "writeonly" for binding, access, name in _IMAGE.findall(text)},
        samplers=frozenset(_SAMPLER.findall(text)), uniforms=frozenset(_PLAIN.findall(text)),
        fixed=frozenset(_FIXED.findall(text)), blocks={name: key for key, name in _BLOCK.findall(text)},
    )  # fmt: skip


class Pass:
    """name: of the pass, for errors.  shader: file.  outputs: images in the order of their bindings.  inputs: textures; each
    gets the unit of its place here, so that passes of one program declare the same ones.  buffers: keys of BINDINGS.
    uniforms: the others.  block: pixels along a side that an invocation writes.  defines: of the shader.

    Raises ValueError for a name that the shader does not have, or that is missing here.
    """

    def __init__(self, programs: Programs, name: str, shader: str, *, outputs: Sequence[str] = (), inputs: Sequence[str] = (),
                 buffers: Sequence[str] = (), uniforms: Sequence[str] = (), block: int = 1, **defines: object):
        self.name, self.shader, self.block = name, shader, block
        self.context = programs.context
        self.program = programs.compute(shader, **defines)
        known = names_of(shader)
        self._inputs = {sampler: unit for unit, sampler in enumerate(inputs)}
        self._outputs, self._buffers = tuple(outputs), {key: BINDINGS[key] for key in buffers}
        self._uniforms, self._preset = frozenset(uniforms), frozenset[str]()
        pictures = list(enumerate(outputs))
        undeclared = [*(set(inputs) - known.samplers), *(name for at, name in pictures if (at, name) not in known.images),
                      *(self._uniforms - known.uniforms), *(set(buffers) - set(known.blocks.values()))]
        bound = {block for block, key in known.blocks.items() if key in buffers}
        declared = {*inputs, *outputs, *uniforms, *known.fixed, *bound}
        active = {member: self.program[member] for member in self.program}
        if describe_device(programs.context).software:  # a GPU's driver may list a name that its compiler found unused
            undeclared += [member for member, made in active.items()
                           if member not in declared and isinstance(made, (moderngl.Uniform, moderngl.StorageBlock))]
        if undeclared:
            self._refuse(undeclared, "is unknown to the shader, or declared by it alone")
        self._read = [known.images[picture] for picture in pictures]
        self._members = {member: made for member, made in active.items()
                         if member in self._uniforms and isinstance(made, moderngl.Uniform)}
        programs.agree_on_units(self.program, self._inputs, self._refuse)

    def _refuse(self, names: Sequence[str], why: str) -> NoReturn:
        raise ValueError(f"pass {self.name!r} ({self.shader}): {', '.join(map(repr, sorted(names)))} {why}")

    def set_uniforms(self, **uniforms: object) -> None:
        """Sets uniforms that the following runs need not give, in the program: passes of one shader and constants share it."""
        if not uniforms.keys() <= self._uniforms | self._preset:
            self._refuse([*(uniforms.keys() - self._uniforms - self._preset)], "is no uniform of it")
        self._preset |= uniforms.keys()
        self._uniforms -= uniforms.keys()
        self._set(uniforms)

    def _set(self, uniforms: Mapping[str, object]) -> None:
        for name, value in uniforms.items():
            if (member := self._members.get(name)) is not None:
                member.value = value

    def bind(self, outputs: "Sequence[moderngl.Texture]", inputs: "Mapping[str, moderngl.Texture | moderngl.Texture3D]",
             buffers: Mapping[str, Storage], uniforms: Mapping[str, object]) -> None:
        """Binds what the next dispatch uses.  Raises ValueError where it is not what the pass declares."""
        if inputs.keys() != self._inputs.keys() or uniforms.keys() != self._uniforms or buffers.keys() != self._buffers.keys() \
                or len(outputs) != len(self._outputs):
            given = {*inputs, *uniforms, *buffers, *self._outputs[:len(outputs)]}
            named = {*self._inputs, *self._uniforms, *self._buffers, *self._outputs}
            self._refuse([*(given ^ named)] or [f"output {len(outputs)}"], "is missing, or not declared")
        for name, texture in inputs.items():
            texture.use(self._inputs[name])
        for name, buffer in buffers.items():
            buffer.bind_to_storage_buffer(self._buffers[name])
        for unit, texture in enumerate(outputs):
            texture.bind_to_image(unit, read=self._read[unit], write=True)
        self._set(uniforms)

    def run(self, *outputs: "moderngl.Texture", inputs: "Mapping[str, moderngl.Texture | moderngl.Texture3D]" = {},  # noqa: B006
            buffers: Mapping[str, Storage] = {}, over: "Size | None" = None, **uniforms: object) -> None:
        """Runs it over the first output, or a picture of the size ``over``.  What it wrote can be read by what follows."""
        self.bind(outputs, inputs, buffers, uniforms)
        width, height = outputs[0].size if over is None else over
        self.program.run(*groups(-(-width // self.block), -(-height // self.block)))
        self.context.memory_barrier()

    def run_indirect(self, command: moderngl.Buffer, /, *outputs: "moderngl.Texture",
                     inputs: "Mapping[str, moderngl.Texture]", buffers: Mapping[str, Storage]) -> None:
        """Runs as many workgroups as the first three words of ``command`` say; a pass without uniforms."""
        self.bind(outputs, inputs, buffers, {})
        self.program.run_indirect(command)
        self.context.memory_barrier()

    def run_groups(self, count: int, /, *, buffers: Mapping[str, Storage], **uniforms: object) -> None:
        """Runs ``count`` workgroups, in rows of MAX_GROUPS at most; a pass over buffers.  Without the barrier that what reads
        them needs: several calls may share one."""
        self.bind((), {}, buffers, uniforms)
        if count:
            self.program.run(*rows_of_groups(count))


def rows_of_groups(count: int) -> tuple[int, int, int]:
    """The dispatch of ``count`` workgroups, one at least: in rows of MAX_GROUPS at most."""
    across = min(count, MAX_GROUPS)
    return across, -(-count // across), 1
