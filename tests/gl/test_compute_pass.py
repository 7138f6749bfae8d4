"""A compute pass: its names are checked against the shader, and its dispatch covers its output."""

import numpy as np
import pytest

from pointglass.viewer.render.device import compute_pass, shader
from pointglass.viewer.render.device.compute_pass import MAX_GROUPS, Pass, rows_of_groups
from pointglass.viewer.render.device.shader import Programs

pytestmark = pytest.mark.gl

SOURCE = """layout(local_size_x = TILE_X, local_size_y = TILE_Y) in;
layout(r32f, binding = 0) uniform writeonly image2D sum;
layout(std430, binding = KEYS_BINDING) readonly buffer Keys { float keys[]; };
uniform sampler2D first;
#ifdef MORE
uniform sampler2D second;
#endif
uniform float factor;
uniform float unused;
void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(sum)))) return;
    float value = texelFetch(first, at, 0).x;
#ifdef MORE
    value += texelFetch(second, at, 0).x;
#endif
    imageStore(sum, at, vec4(factor * value + keys[at.x]));
}
"""
SIZE = (37, 21)
NAMES = {"outputs": ("sum",), "inputs": ("first", "second"), "buffers": ("KEYS",), "uniforms": ("factor", "unused"), "MORE": 1}


@pytest.fixture
def programs(context, tmp_path, monkeypatch):
    (tmp_path / "added.comp").write_text(SOURCE)
    monkeypatch.setattr(shader, "shaders_dir", lambda: tmp_path)
    made = Programs(context)
    yield made
    made.release()
    compute_pass.names_of.cache_clear()
    shader._lines.cache_clear()


@pytest.fixture
def resources(context):
    """Two inputs and an output of SIZE, a buffer, and what they hold."""
    values = np.random.default_rng(3).random((2, SIZE[1], SIZE[0])).astype(np.float32)
    keys = np.arange(SIZE[0], dtype=np.float32)
    made = [*(context.texture(SIZE, 1, value.tobytes(), dtype="f4") for value in values), context.texture(SIZE, 1, dtype="f4"),
            context.buffer(keys.tobytes())]
    yield *made, values, keys
    for resource in made:
        resource.release()


def test_a_pass_covers_its_output(programs, resources):
    first, second, out, buffer, values, keys = resources
    step = Pass(programs, "adding", "added.comp", **NAMES)
    step.run(out, inputs={"first": first, "second": second}, buffers={"KEYS": buffer}, factor=2.0, unused=0.0)
    made = np.frombuffer(out.read(), np.float32).reshape(SIZE[1], SIZE[0])
    np.testing.assert_allclose(made, 2 * values.sum(axis=0) + keys, rtol=1e-6)
    step.set_uniforms(factor=0.0)
    step.run(out, inputs={"second": second, "first": first}, buffers={"KEYS": buffer}, unused=0.0)
    made = np.frombuffer(out.read(), np.float32).reshape(SIZE[1], SIZE[0])
    assert np.array_equal(made, np.broadcast_to(keys, made.shape))


@pytest.mark.parametrize(("change", "name"), [
    ({"inputs": ("first", "second", "third")}, "third"), ({"inputs": ("first",)}, "second"),
    ({"outputs": ("total",)}, "total"), ({"uniforms": ("factor", "unused", "power")}, "power"),
    ({"uniforms": ("unused",)}, "factor"), ({"buffers": ("KEYS", "SUMS")}, "SUMS"), ({"buffers": ()}, "Keys"),
])  # fmt: skip
def test_declaring_what_the_shader_does_not_have_or_not_all_that_it_has(programs, change, name):
    with pytest.raises(ValueError, match=rf"pass 'adding' \(added.comp\): .*'{name}'"):
        Pass(programs, "adding", "added.comp", **{**NAMES, **change})


@pytest.mark.parametrize(("change", "name"), [
    ({"inputs": ("first",)}, "second"), ({"inputs": ("first", "second", "third")}, "third"),
    ({"uniforms": ("factor",)}, "unused"), ({"uniforms": ("factor", "unused", "power")}, "power"),
    ({"buffers": ()}, "KEYS"), ({"outputs": 0}, "sum"), ({"outputs": 2}, "output 2"),
])  # fmt: skip
def test_running_with_a_name_too_many_or_too_few(programs, resources, change, name):
    first, _, out, buffer, _, _ = resources
    given = {"inputs": NAMES["inputs"], "uniforms": NAMES["uniforms"], "buffers": NAMES["buffers"], "outputs": 1, **change}
    step = Pass(programs, "adding", "added.comp", **NAMES)
    with pytest.raises(ValueError, match=rf"pass 'adding' \(added.comp\): .*'{name}'"):
        step.run(*[out] * given["outputs"], inputs=dict.fromkeys(given["inputs"], first), over=SIZE,  # type: ignore[arg-type]
                 buffers=dict.fromkeys(given["buffers"], buffer), **dict.fromkeys(given["uniforms"], 1.0))  # type: ignore[arg-type]


def test_passes_of_one_program_have_its_units(programs):
    Pass(programs, "adding", "added.comp", **NAMES)
    Pass(programs, "the same", "added.comp", **NAMES)
    with pytest.raises(ValueError, match=r"pass 'turned' \(added.comp\): 'first', 'second' has other units"):
        Pass(programs, "turned", "added.comp", **{**NAMES, "inputs": ("second", "first")})


@pytest.mark.parametrize("count", [1, MAX_GROUPS, MAX_GROUPS + 1, 3 * MAX_GROUPS - 1])
def test_rows_of_groups_hold_them_all(count):
    across, down, deep = rows_of_groups(count)
    assert across <= MAX_GROUPS and deep == 1 and (down - 1) * across < count <= down * across
