"""GPU behaviour that software OpenGL can imitate: the programs chosen for a GPU, missing barriers, uninitialised memory.

See test_shaders_valid.py for stricter compilers and test_other_drivers.py for other implementations of OpenGL.
"""

import moderngl
import numpy as np
import pytest
from driver_pictures import FEW, look_like_a_gpu, pictures

pytestmark = pytest.mark.gl


@pytest.fixture(scope="module")
def expected(context):
    return pictures(context, *FEW)


def demand_barriers(monkeypatch) -> list:
    """A GPU begins a pass before the last one has ended, and reads caches that it has not written back, unless a barrier stands
    between them.  Only runs of one program may follow each other without.  Returns the programs that ran, in order."""
    ran, since = [], []

    def following(owner: type, name: str) -> None:
        given = getattr(owner, name)

        def called(self, *arguments, **named):
            program = getattr(self, "program", self)
            assert all(other is program for other in since), f"no barrier before {owner.__name__}.{name}"
            if "read" not in name:
                since.append(program)
                ran.append(program)
            return given(self, *arguments, **named)

        monkeypatch.setattr(owner, name, called)

    def barrier(self, *arguments, given=moderngl.Context.memory_barrier):
        since.clear()
        given(self, *arguments)

    for owner, names in {moderngl.ComputeShader: ("run", "run_indirect"), moderngl.VertexArray: ("render", "render_indirect"),
                         moderngl.Buffer: ("read", "read_into"), moderngl.Texture: ("read",)}.items():
        for name in names:
            following(owner, name)
    monkeypatch.setattr(moderngl.Context, "memory_barrier", barrier)
    return ran


def test_a_gpus_programs_change_no_byte_and_wait_for_each_other(context, monkeypatch):
    expected = pictures(context)
    look_like_a_gpu(monkeypatch)
    ran = demand_barriers(monkeypatch)
    assert pictures(context) == expected and len(set(ran)) > 30


@pytest.mark.parametrize("word", [0xFFFFFFFF, 0x7F800000, 0x01020304])
def test_what_nobody_wrote_changes_no_byte(context, expected, monkeypatch, word):
    """Buffers and textures begin full of NaN, of infinity, or of small numbers."""
    look_like_a_gpu(monkeypatch)
    given = {name: getattr(moderngl.Context, name) for name in ("buffer", "texture")}
    written = []

    def fill(made, size: int) -> None:
        made.write(np.full(size // 4 + 1, word, "<u4").tobytes()[:size])
        written.append(size)

    def buffer(self, data=None, **named):
        made = given["buffer"](self, data, **named)
        if data is None:
            fill(made, made.size)
        return made

    def texture(self, size, components, data=None, **named):
        made = given["texture"](self, size, components, data, **named)
        if data is None:
            fill(made, size[0] * size[1] * components * int(named.get("dtype", "f1")[1]))
        return made

    def orphan(self, size=-1, given=moderngl.Buffer.orphan):
        given(self, size)
        fill(self, self.size)

    monkeypatch.setattr(moderngl.Context, "buffer", buffer)
    monkeypatch.setattr(moderngl.Context, "texture", texture)
    monkeypatch.setattr(moderngl.Buffer, "orphan", orphan)
    assert pictures(context, *FEW) == expected and len(written) > 100
