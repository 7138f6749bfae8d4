"""Shader sources: includes, line numbers and errors that a person can follow."""

import pytest

from pointglass.viewer.common.errors import DeviceError
from pointglass.viewer.render.device import shader

pytestmark = pytest.mark.gl


def test_each_include_comes_once_and_keeps_line_numbers():
    text, files = shader.source("raster_colour.comp", {})
    assert files.count("common_project.glsl") == 1
    assert text.startswith("#version 430 core\n")
    assert "#line 1 0" in text and f"#line 1 {files.index('common_sums.glsl')}" in text


def test_a_broken_shader_names_file_and_line(context, tmp_path, monkeypatch):
    (tmp_path / "broken.comp").write_text("layout(local_size_x = 1) in;\nvoid main() {\n  int a = banana;\n}\n")
    monkeypatch.setattr(shader, "shaders_dir", lambda: tmp_path)
    programs = shader.Programs(context)
    with pytest.raises(DeviceError, match=r"0 = shaders/broken.comp.*0:3"):
        programs.compute("broken.comp")
