"""What ``render`` leaves on the disk: the files of a picture together, or none of them and one line that says why."""

import errno
import json
import os
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pointglass.viewer.commands.render_pictures import export_pictures
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.camera import from_fov
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.picture.spec import PictureSpec
from pointglass.viewer.preprocess.scan_description import ScanDescription

CAMERAS = [from_fov(8, 6, 60, np.eye(4), name) for name in ("a", "b")]
ENDINGS = ("depth.npy", "mask.npy", "png", "provenance.png", "stats.json")


class FakeRenderer:
    """Remembers the views it was asked for."""

    def __init__(self):
        self.asked, self.context, self.choice = [], None, SimpleNamespace(timed=None)
        self.scene = SimpleNamespace(meta=ScanDescription(("a.laz",)), count=5)

    def render(self, camera, settings, views=None, *_, **__):
        self.asked.append(views)
        shape = (camera.height, camera.width)
        return SimpleNamespace(image=lambda view: np.zeros((*shape, 4), np.uint8), depth=lambda: np.ones(shape, np.float32),
                               mask=lambda: np.ones(shape, bool), from_photographs=lambda view: None, stats={"total_ms": 1.0})


def fake() -> Any:
    return FakeRenderer()


def specs(settings):
    return [PictureSpec(camera, settings, background="black") for camera in CAMERAS]


def names(folder):
    return sorted(p.name for p in folder.iterdir())


@pytest.mark.parametrize("view, aux, views", [
    ("raw", False, ("raw",)), ("raw", True, ("raw", "filtered")), ("filled", True, ("filled",)),
])
def test_the_filter_runs_where_a_mask_is_written_and_not_otherwise(tmp_path, view, aux, views):
    renderer = fake()
    assert export_pictures(renderer, specs(Settings(view=view)), tmp_path, aux=aux) == 2
    assert renderer.asked == [views] * 2
    assert names(tmp_path) == sorted(f"{c}.{e}" for c in "ab" for e in (ENDINGS if aux else ["png"]))
    if aux:
        assert json.loads((tmp_path / "b.stats.json").read_text()) == {"total_ms": 1.0}
        assert np.load(tmp_path / "b.mask.npy").all()


@pytest.mark.parametrize("error", [
    OSError("4000000 requested and 1387488 written"), OSError(errno.ENOSPC, "No space left on device"),
])
def test_a_full_disk_is_named_and_leaves_no_half_of_a_picture(tmp_path, monkeypatch, error):
    def full(file, array, **_):
        if "b.mask" in str(file.name):
            file.write(b"half")
            raise error
        file.write(b"whole")

    monkeypatch.setattr(np, "save", full)
    with pytest.raises(InputError) as caught:
        export_pictures(fake(), specs(Settings(view="raw")), tmp_path, aux=True)
    said = str(caught.value)
    assert said.startswith(f"{tmp_path / 'b.mask.npy'}: cannot be written (") and "partial" not in said
    assert "space" in said and f"free space in {tmp_path}" in said
    assert names(tmp_path) == [f"a.{e}" for e in ENDINGS]


def test_a_folder_that_takes_no_files_is_named(tmp_path, monkeypatch):
    def refuse(path, *_):
        raise OSError(errno.EROFS, "Read-only file system", path)

    (tmp_path / "out").mkdir()
    monkeypatch.setattr("os.mkdir", refuse)
    with pytest.raises(InputError) as caught:
        export_pictures(fake(), specs(Settings()), tmp_path / "out")
    assert str(caught.value).startswith(f"{tmp_path / 'out'}: cannot be written to (Read-only file system); ")
    assert str(caught.value).endswith("choose another --out")


def test_what_a_killed_run_of_the_same_number_left_is_removed(tmp_path):
    """In a container process numbers come again."""
    left = tmp_path / f".a.png.{os.getpid()}.partial"
    left.mkdir()
    export_pictures(fake(), specs(Settings(view="raw")), tmp_path, aux=True)
    assert (tmp_path / "a.png").is_file() and not list(tmp_path.glob(".*"))


def test_a_folder_in_the_place_of_a_file_leaves_none_of_the_others(tmp_path):
    (tmp_path / "a.mask.npy").mkdir()
    with pytest.raises(InputError, match=r"a\.mask\.npy: is a folder"):
        export_pictures(fake(), specs(Settings(view="raw")), tmp_path, aux=True)
    assert names(tmp_path) == ["a.mask.npy"]
