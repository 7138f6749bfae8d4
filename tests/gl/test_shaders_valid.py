"""Every shader, complete with its includes and constants, against the reference compiler and the limits of the standard.

The text is the one the program gives to the driver (viewer.render.device.shader.source), collected while every program runs.
"""

import os
import re
import shutil
import subprocess
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import moderngl
import pytest
from clouds import camera_in, room
from driver_pictures import sources

from pointglass.viewer.common.paths import shaders_dir
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render import renderer as module
from pointglass.viewer.render.device.shader import BINDINGS, EXTENDED_VERSION
from pointglass.viewer.render.renderer import Renderer

pytestmark = pytest.mark.gl

VERSIONS = (430, 440, 450, 460)
SPIRV_ENVIRONMENTS = ("opengl4.3", "opengl4.5")
"""Of OpenGL 4.3 to 4.6 those that spirv-val (2023.1) knows."""

STORAGE_BLOCKS = {"comp": 8, "frag": 8, "vert": 0}
"""OpenGL 4.3, tables 23.57 to 23.62, least value of MAX_*_SHADER_STORAGE_BLOCKS: a vertex shader is promised none."""
IMAGES = {"comp": 8, "frag": 8, "vert": 0}
"""MAX_*_IMAGE_UNIFORMS."""
TEXTURES = 16
"""MAX_*_TEXTURE_IMAGE_UNITS."""
UNIFORM_BLOCK_BYTES = 16384
"""MAX_UNIFORM_BLOCK_SIZE."""
UNIFORM_BLOCKS = 12
"""MAX_*_UNIFORM_BLOCKS (14 in compute shaders)."""
UNIFORM_COMPONENTS = {"comp": 512, "frag": 1024, "vert": 1024}
"""MAX_*_UNIFORM_COMPONENTS of the default block."""
GROUP_SIZE, GROUP_INVOCATIONS = (1024, 1024, 64), 1024
"""MAX_COMPUTE_WORK_GROUP_SIZE and _INVOCATIONS."""
SHARED_BYTES = 32768
"""MAX_COMPUTE_SHARED_MEMORY_SIZE."""
STORAGE_BLOCK_BYTES = 1 << 24
"""MAX_SHADER_STORAGE_BLOCK_SIZE."""
STORAGE_BINDINGS = 8
"""MAX_SHADER_STORAGE_BUFFER_BINDINGS."""

_COMPONENTS = {"1406": 1, "1404": 1, "1405": 1, "8b56": 1, "8b50": 2, "8b53": 2, "8dc6": 2, "8b51": 3, "8b54": 3, "8dc7": 3,
               "8b52": 4, "8b55": 4, "8dc8": 4, "8b5b": 9, "8b5c": 16}
"""Components by the hexadecimal code of a uniform's type; samplers and images count one."""


@pytest.fixture(scope="module")
def files(context, tmp_path_factory) -> list[Path]:
    """One file for each text that the program compiles."""
    if shutil.which("glslangValidator") is None or shutil.which("spirv-val") is None:
        pytest.skip("glslangValidator and spirv-val are not installed (apt install glslang-tools spirv-tools)")
    with pytest.MonkeyPatch.context() as patch:
        texts = sources(context, patch)
    there = {path.name for path in shaders_dir().iterdir() if path.suffix in (".comp", ".vert", ".frag")}
    assert set(texts.values()) == there, "a shader that no test compiles"
    folder = tmp_path_factory.mktemp("shaders")
    paths = []
    for number, (text, name) in enumerate(texts.items()):
        # glslang knows 64-bit atomics of buffers by the name of the later, equal extension
        text = text.replace("GL_NV_shader_atomic_int64", "GL_EXT_shader_atomic_int64")
        paths.append(folder / f"{number}-{name}")
        paths[-1].write_text(text)
    return paths


def output_of(*command: object) -> tuple[int, str]:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, timeout=60)
    return done.returncode, done.stdout + done.stderr


def each(check: Callable[[Path], list], paths: list[Path]) -> list:
    """What ``check`` returns for the files, as one list in their order; several files at a time."""
    with ThreadPoolExecutor(min(4, os.cpu_count() or 1)) as pool:
        return [result for results in pool.map(check, paths) for result in results]


def texts_of(paths: list[Path]) -> dict[Path, str]:
    """The files' texts after the preprocessor, by one call: it takes longer to start than to read them all."""
    status, said = output_of("glslangValidator", "-E", *paths)
    assert status == 0, said
    texts = re.findall(r"^#version .*?(?=^#version |\Z)", said, re.M | re.S)
    return dict(zip(paths, texts, strict=True))


def as_version(files: list[Path], folder: Path, version: int) -> list[Path]:
    """The files with another version in their first line, in a folder of their own; without those that ask for a later one,
    which are given only to drivers that have it."""
    there = folder / str(version)
    there.mkdir()
    for path in files:
        first, rest = path.read_text().split("\n", 1)
        asked = int(re.fullmatch(r"#version (\d+) core", first)[1])  # type: ignore[index]
        assert asked == (EXTENDED_VERSION if "#extension" in rest else 430)
        if asked <= version:
            (there / path.name).write_text(f"#version {version} core\n{rest}")
    return sorted(there.iterdir())


@pytest.mark.parametrize("version", VERSIONS)
def test_every_shader_is_valid_glsl(files, tmp_path, version):
    paths = as_version(files, tmp_path, version)
    status, said = output_of("glslangValidator", *paths)
    assert status == 0 and "ERROR" not in said and "WARNING" not in said, said


@pytest.fixture(scope="module")
def compiled(files) -> dict[Path, tuple[int, str]]:
    """Exit status and output of the compiler for each file: its SPIR-V is beside it, its list of uniforms is printed.

    SPIR-V for OpenGL asks for a location of every uniform, input and output, which GLSL 4.30 leaves to the linker: glslang
    numbers them (--auto-map-locations), and nothing else is changed."""
    outputs = each(lambda path: [output_of("glslangValidator", "-G", "-g0", "-l", "-q", "--auto-map-locations", "-o",
                                           spirv_of(path), path)], files)  # fmt: skip
    return dict(zip(files, outputs, strict=True))


def spirv_of(path: Path) -> Path:
    return path.with_suffix(".spv" + path.suffix)


def test_every_shader_is_valid_spirv(compiled):
    """In the version that the driver is given; the others are compiled as GLSL above."""

    def problems(path: Path) -> list[str]:
        status, said = compiled[path]
        if status:
            return [f"{path.name}: {said}"]
        checked = [(name, output_of("spirv-val", "--target-env", name, spirv_of(path))) for name in SPIRV_ENVIRONMENTS]
        return [f"{path.name}, {name}: {said}" for name, (status, said) in checked if status]

    assert each(problems, list(compiled)) == []


def shared_bytes(text: str) -> int:
    """Of variables of one word each, and arrays of them whose length is a number or a define."""
    defines = dict(re.findall(r"^#define (\w+) (\d+)$", text, re.M))
    words = 0
    for declared in re.findall(r"^\s*shared\s+(.*);", text, re.M):
        kind, names = declared.split(None, 1)
        assert kind in ("int", "uint", "float"), declared
        for length in re.findall(r"\w+(?:\[(\w+)\])?", names):
            words += int(defines.get(length, length)) if length else 1
    return 4 * words


def test_every_shader_stays_within_the_limits_that_opengl_4_3_guarantees(compiled):
    """Counted in the text after the preprocessor and in the compiler's own list of uniforms."""
    preprocessed = texts_of(list(compiled))

    def problems(path: Path) -> list[str]:
        kind, text = path.suffix[1:], preprocessed[path]
        found = []

        def at_most(what: str, value: int, limit: int) -> None:
            if value > limit:
                found.append(f"{path.name}: {what} {value}, OpenGL 4.3 guarantees {limit}")

        blocks = re.findall(r"binding\s*=\s*(\d+)\s*\)[^;{]*\bbuffer\s+\w+\s*\{", text)
        assert len(blocks) == len(re.findall(r"\bbuffer\s+\w+\s*\{", text)), "a storage block without a binding"
        at_most("storage blocks", len(blocks), STORAGE_BLOCKS[kind])
        at_most("highest storage binding", max(map(int, blocks), default=0), STORAGE_BINDINGS - 1)
        assert len(set(blocks)) == len(blocks), f"{path.name}: two storage blocks share a binding"
        images = re.findall(r"\buniform\b[^;]*\b[iu]?image\dD\b", text)
        at_most("images", len(images), IMAGES[kind])
        at_most("textures", len(re.findall(r"\buniform\s+[iu]?sampler\dD\b", text)), TEXTURES)
        if kind == "comp":
            size = {axis: int(value) for axis, value in re.findall(r"local_size_([xyz])\s*=\s*(\d+)", text)}
            sides = [size.get(axis, 1) for axis in "xyz"]
            for side, limit in zip(sides, GROUP_SIZE):
                at_most("side of a workgroup", side, limit)
            at_most("invocations of a workgroup", sides[0] * sides[1] * sides[2], GROUP_INVOCATIONS)
            at_most("bytes of shared memory", shared_bytes(text), SHARED_BYTES)
        status, told = compiled[path]
        assert status == 0, told
        storage = set(re.findall(r"\bbuffer\s+(\w+)\s*\{", text))
        uniforms, rest = told.split("Uniform block reflection:")
        told_blocks = re.findall(r"^(\w+): .*?size (\d+)", rest.split("Buffer variable")[0], re.M)
        rows = [row for row in told_blocks if row[0] not in storage]
        at_most("uniform blocks", len(rows), UNIFORM_BLOCKS)
        for name, size in rows:
            at_most(f"bytes of {name}", int(size), UNIFORM_BLOCK_BYTES)
        plain = re.findall(r"^[\w\[\].]+: offset -1, type (\w+), size (\d+)", uniforms, re.M)
        at_most("uniform components", sum(_COMPONENTS.get(code, 1) * int(size) for code, size in plain),
                UNIFORM_COMPONENTS[kind])
        return found

    assert max(BINDINGS.values()) < STORAGE_BINDINGS
    assert [problem for path in compiled for problem in problems(path)] == []


def test_no_shader_is_given_a_larger_buffer_than_opengl_4_3_guarantees(context, monkeypatch):
    """On a device whose storage blocks have the least size of the standard: points in pages, pictures in bands, and the same
    bytes as with one page and one band."""
    largest: list[int] = []
    bind = moderngl.Buffer.bind_to_storage_buffer

    def noted(self, binding=0, offset=0, size=-1):
        largest.append(self.size if size < 0 else size)
        return bind(self, binding, offset, size)

    monkeypatch.setattr(moderngl.Buffer, "bind_to_storage_buffer", noted)
    scene = room(5, 1_500_000)  # 18 MB of points
    camera, pictures = camera_in(scene, 5, (1280, 960)), []  # 19.7 MB of carries
    known = module.describe_device
    for limit in (None, STORAGE_BLOCK_BYTES):
        largest.clear()
        if limit is not None:
            limited = replace(known(context), storage_limit=limit)
            monkeypatch.setattr(module, "describe_device", lambda _, limited=limited: limited)
        renderer = Renderer(context, scene, raster="compute")
        frame = renderer.render(camera, Settings(), ("raw", "filled"))
        pictures.append([frame.image(view).tobytes() for view in ("raw", "filled")] + [frame.depth().tobytes()])
        assert limit is None or max(largest) <= limit
        assert largest
        renderer.release()
    assert pictures[0] == pictures[1]
