"""The command line's contracts: what it writes, what it says, and the exit codes other programs rely on."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from las_files import coloured_corner
from PIL import Image

from pointglass.viewer import cli
from pointglass.viewer.cli import main
from pointglass.viewer.command_table import make_parser
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.paths import assets_dir
from pointglass.viewer.work.cameras import camera_files

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture(scope="module")
def scan(tmp_path_factory) -> Path:
    return coloured_corner(tmp_path_factory.mktemp("scan") / "corner.laz")


@pytest.fixture(scope="module")
def cameras(tmp_path_factory) -> Path:
    pose = [[1, 0, 0, 2.0], [0, 0, -1, 0.5], [0, 1, 0, 1.4], [0, 0, 0, 1]]
    frames = [{"file_path": f"images/{n}.jpg", "transform_matrix": pose} for n in ("a", "b", "c")]
    path = tmp_path_factory.mktemp("cameras") / "transforms.json"
    path.write_text(json.dumps({"fl_x": 60, "w": 80, "h": 60, "frames": frames}))
    return path


def run(*arguments) -> int:
    return main([str(a) for a in arguments])


def one_line(capsys) -> str:
    out = capsys.readouterr()
    assert out.err.startswith("pointglass: ") and out.err.count("\n") == 1, out.err
    return out.err


@pytest.mark.gl
@pytest.mark.parametrize("view", ["raw", "filtered", "filled", "neural"])
def test_render_writes_a_picture_a_frame_with_its_name(scan, cameras, tmp_path, view):
    assert run("render", scan, "--cameras", cameras, "--out", tmp_path / "out", "--view", view) == 0
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == ["a.png", "b.png", "c.png"]
    picture = np.asarray(Image.open(tmp_path / "out" / "a.png"))
    assert picture.shape == (60, 80, 3) and picture.any()


@pytest.mark.gl
def test_aux_files_hold_what_the_contract_says(scan, cameras, tmp_path):
    assert run("render", scan, "--cameras", cameras, "--out", tmp_path, "--view", "filtered", "--aux", "--size", "53x31") == 0
    depth, mask = np.load(tmp_path / "a.depth.npy"), np.load(tmp_path / "a.mask.npy")
    assert depth.dtype == np.float32 and mask.dtype == bool and depth.shape == mask.shape == (31, 53)
    assert np.isinf(depth).any() and (depth[np.isfinite(depth)] > 0).all() and not mask[np.isinf(depth)].any()
    stats = json.loads((tmp_path / "a.stats.json").read_text())
    assert stats["total_ms"] > 0 and {"raster", "filter"} <= set(stats["stages"])
    assert 0 < stats["points_drawn"] <= stats["points_total"] == 16000 and stats["cells_drawn"] > 0
    assert stats["approximations"] == []


@pytest.mark.gl
def test_the_mask_is_the_filters_whatever_the_view(scan, cameras, tmp_path):
    for view in ("raw", "filtered"):
        out = tmp_path / view
        assert run("render", scan, "--cameras", cameras, "--out", out, "--view", view, "--aux", "--shard", "0/3",
                   "--filter-strength", "0.001") == 0
    raw, filtered = np.load(tmp_path / "raw" / "a.mask.npy"), np.load(tmp_path / "filtered" / "a.mask.npy")
    assert np.array_equal(raw, filtered)
    assert (raw != np.isfinite(np.load(tmp_path / "raw" / "a.depth.npy"))).any()  # or nothing was filtered here
    assert "filter" in json.loads((tmp_path / "raw" / "a.stats.json").read_text())["stages"]


@pytest.mark.gl
def test_the_same_call_twice_gives_the_same_bytes_and_shards_make_the_whole(scan, cameras, tmp_path):
    for name, extra in {"one": (), "two": (), "s0": ("--shard", "0/2"), "s1": ("--shard", "1/2")}.items():
        assert run("render", scan, "--cameras", cameras, "--out", tmp_path / name, "--view", "filled", *extra) == 0
    one, two = ({p.name: p.read_bytes() for p in (tmp_path / n).iterdir()} for n in ("one", "two"))
    shards = [{p.name: p.read_bytes() for p in (tmp_path / n).iterdir()} for n in ("s0", "s1")]
    assert one == two == shards[0] | shards[1] and not set(shards[0]) & set(shards[1])


@pytest.mark.gl
def test_a_converted_folder_draws_the_same_picture(scan, cameras, tmp_path):
    assert run("convert", scan, "--out", tmp_path / "grid") == 0
    for source, name in ((scan, "a"), (tmp_path / "grid", "b")):
        assert run("render", source, "--cameras", cameras, "--out", tmp_path / name, "--view", "filtered") == 0
    assert (tmp_path / "a" / "a.png").read_bytes() == (tmp_path / "b" / "a.png").read_bytes()


def test_info_counts_every_point(scan, capsys):
    assert run("info", scan, "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["points"] == 16000 and facts["format"] == "LAZ"
    assert run("info", scan) == 0
    assert "16,000" in capsys.readouterr().out


def test_options_stand_anywhere_between_files():
    """Before, between and after; what follows -- is a file, whatever it begins with."""
    parse = make_parser().parse_args
    places = ["bench frame A B --size 64x48", "bench --size 64x48 frame A B", "bench frame --size 64x48 A B",
              "bench frame A --size 64x48 B"]
    first, *others = [parse(line.split()) for line in places]
    assert first.scans == [Path("A"), Path("B")] and first.kind == "frame" and first.size == ["64x48"]
    assert all(vars(other) == vars(first) for other in others)
    assert parse(["render", "A", "--cameras", "C", "B", "--out", "O", "D"]).scans == [Path("A"), Path("B"), Path("D")]
    assert parse(["info", "--json", "--", "-x.las", "--json"]).scans == [Path("-x.las"), Path("--json")]
    with pytest.raises(InputError, match="unrecognized arguments: --lots"):
        parse(["info", "A", "--lots", "B"])


@pytest.mark.parametrize("first", [("--view", "raw"), ("--no-cache",), ("--lod", "2")])
def test_to_look_at_a_scan_options_may_come_first(scan, monkeypatch, first):
    seen = []
    monkeypatch.setitem(cli._RUN, "view", lambda options: seen.append((options.command, options.scans)) or 0)
    assert main([*first, str(scan)]) == main(["view", str(scan), *first]) == 0
    assert seen[0] == seen[1] == ("view", [scan])


@pytest.mark.parametrize("command", ["info", pytest.param("render", marks=pytest.mark.gl)])
def test_no_cache_keeps_nothing(scan, cameras, tmp_path, monkeypatch, command):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    extra = ("--cameras", cameras, "--out", tmp_path / "out", "--view", "raw") if command == "render" else ()
    assert run(command, scan, "--no-cache", *extra) == 0
    assert not (tmp_path / "cache").exists()
    assert run(command, scan, *extra) == 0
    assert len(list((tmp_path / "cache").iterdir())) == 1


@pytest.mark.parametrize("arguments, said", [
    (("render", "{scan}", "--cameras", "{cameras}"), "--out"),
    (("render", "{scan}", "--cameras", "{cameras}", "--out", "{out}", "--view", "pretty"), "pretty"),
    (("render", "{scan}", "--cameras", "{cameras}", "--out", "{out}", "--size", "big"), "--size 'big'"),
    (("render", "{scan}", "--cameras", "{cameras}", "--out", "{out}", "--size", "\u00b2x5"), "expected WIDTHxHEIGHT"),
    (("render", "{scan}", "--cameras", "{cameras}", "--out", "{out}", "--size", "9" * 5000 + "x5"), "expected WIDTHxHEIGHT"),
    (("render", "{scan}", "--cameras", "{cameras}", "--out", "{out}", "--shard", "3/2"), "--shard '3/2'"),
    (("render", "{scan}", "--cameras", "{cameras}", "--out", "{out}", "--shard", "2/2"), "--shard '2/2'"),
    (("render", "{scan}", "--cameras", "{cameras}", "--out", "{out}", "--shard", "\u00b2/3"), "expected i/n"),
    (("render", "{scan}", "--cameras", "{cameras}", "--out", "{out}", "--filter-strength", "0"), "filter strength 0.0"),
    (("render", "{scan}", "--cameras", "{cameras}", "--out", "{out}", "--filter-levels", "99"), "filter levels 99"),
    (("render", "{scan}", "--cameras", "missing.json", "--out", "{out}"), "missing.json: no such camera file"),
    (("render", "missing.laz", "--cameras", "{cameras}", "--out", "{out}"), "missing.laz"),
    (("render", "{empty}", "--cameras", "{cameras}", "--out", "{out}"), "empty.laz"),
    (("info", "missing.laz"), "missing.laz"),
    (("info", "{text}"), "notes.laz"),
    (("convert", "{scan}", "--out", "{full}"), "full"),
    (("render", "{scan}", "{grid}", "--cameras", "{cameras}", "--out", "{out}", "--no-cache"), "opened together by way of the"),
    (("convert", "{grid}", "--out", "{out}"), "give the scans it was made from"),
    (("evaluate", "{out}"), "no such folder"),
    (("info", "{scan}", "--jsn"), "(see `pointglass info --help`)"),
    (("render", "{scan}", "--cameras", "{cameras}", "--out", "{text}"), "notes.laz: cannot make this folder (a file has"),
    (("dance",), "dance"),
])
def test_bad_input_is_one_line_exit_2_and_leaves_nothing(scan, cameras, tmp_path, capsys, arguments, said):
    (tmp_path / "empty.laz").write_bytes(b"")
    (tmp_path / "notes.laz").write_text("dear diary")
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "precious.txt").write_text("keep me")
    if any("{grid}" in argument for argument in arguments):
        assert run("convert", scan, "--out", tmp_path / "grid") == 0
        capsys.readouterr()
    before = sorted(tmp_path.rglob("*"))
    places = {"scan": scan, "cameras": cameras, "out": tmp_path / "out", "empty": tmp_path / "empty.laz",
              "text": tmp_path / "notes.laz", "full": tmp_path / "full", "grid": tmp_path / "grid"}
    assert main([a.format(**places) for a in arguments]) == 2
    assert said in one_line(capsys)
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.gl
def test_a_picture_too_large_for_the_network_is_refused_before_it_is_drawn(scan, cameras, tmp_path, capsys, monkeypatch):
    from pointglass.viewer.render.device import context
    from pointglass.viewer.render.renderer import Culler

    monkeypatch.setattr(context.Device, "buffer_limit", 16 * 80 * 60 - 1)
    monkeypatch.setattr(Culler, "select", None)
    assert run("render", scan, "--cameras", cameras, "--out", tmp_path / "out", "--view", "neural") == 3
    assert "a neural picture of 80x60 needs" in one_line(capsys)


def test_a_name_the_terminal_cannot_show_is_escaped(scan, tmp_path):
    path = tmp_path / "\u00fcn\u00ef.laz"
    path.write_bytes(scan.read_bytes())
    for given, code in ((path, 0), (tmp_path / "\u00f6.laz", 2)):
        done = subprocess.run([sys.executable, "-m", "pointglass", "info", str(given)], cwd=ROOT,
                              capture_output=True, timeout=120, env={**os.environ, "PYTHONIOENCODING": "ascii"})
        said = (done.stdout or done.stderr).decode("ascii")
        assert done.returncode == code and "Traceback" not in said and ("\\xfcn\\xef.laz" if code == 0 else "\\xf6") in said


def test_what_opengl_cannot_do_is_exit_3_and_one_line(monkeypatch, capsys):
    import moderngl

    def fail(_):
        raise moderngl.Error("cannot map the buffer")

    monkeypatch.setitem(cli._RUN, "info", fail)
    assert run("info", "any.laz") == 3
    assert "OpenGL: cannot map the buffer; choose a smaller --size" in one_line(capsys)


@pytest.mark.gl
def test_weights_that_are_not_shipped_are_named(scan, cameras, tmp_path, capsys):
    assert run("render", scan, "--cameras", cameras, "--out", tmp_path / "out", "--quality", "paper") == 2
    assert "no weights are shipped for quality 'paper'" in one_line(capsys)
    assert not list((tmp_path / "out").glob("*"))


@pytest.mark.gl
def test_cuda_asked_for_where_there_is_none_is_exit_3(scan, cameras, tmp_path, capsys):
    import torch

    if torch.cuda.is_available():
        pytest.skip("this machine has CUDA")
    assert run("render", scan, "--cameras", cameras, "--out", tmp_path / "out", "--device", "cuda") == 3
    assert "--device cuda" in one_line(capsys)


@pytest.mark.slow
def test_no_opengl_is_exit_3_and_one_line(scan, cameras, tmp_path):
    broken = {**os.environ, "__EGL_VENDOR_LIBRARY_FILENAMES": str(tmp_path / "none.json")}
    done = subprocess.run(
        [sys.executable, "-m", "pointglass.viewer", "render", str(scan), "--cameras", str(cameras), "--out",
         str(tmp_path / "out")],
        env=broken, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 3, done.stderr
    assert done.stderr.startswith("pointglass: OpenGL 4.3") and done.stderr.count("\n") == 1


@pytest.mark.parametrize("blocked", [
    "by a file in its way",
    pytest.param("by its rights", marks=pytest.mark.skipif(os.geteuid() == 0, reason="root writes anywhere")),
])  # fmt: skip
def test_an_unwritable_cache_says_what_to_do(scan, cameras, tmp_path, capsys, monkeypatch, blocked):
    locked = tmp_path / "locked"
    if blocked == "by its rights":
        locked.mkdir(mode=0o500)
    else:
        locked.write_text("no folder")
    monkeypatch.setenv("POINTGLASS_CACHE", str(locked / "cache"))
    assert run("info", scan) == 0  # info needs no cache
    capsys.readouterr()
    assert run("render", scan, "--cameras", cameras, "--out", tmp_path / "out") == 2
    assert "POINTGLASS_CACHE" in one_line(capsys) and not (tmp_path / "out").exists()


def test_importing_the_command_line_loads_nothing_heavy():
    code = ("import sys, pointglass.viewer.cli;"
            "heavy = {'torch', 'numpy', 'moderngl', 'open3d', 'numba', 'scipy', 'imgui_bundle'};"
            "sys.exit(', '.join(heavy & set(sys.modules)) or 0)")
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, timeout=60).returncode == 0


def test_start_page_loads_ahead_what_a_scan_needs_and_no_torch():
    code = ("import sys; from pointglass.viewer.window.shell.warm_up import WarmUp; assert WarmUp().wait(60);"
            "wanted = {'laspy', 'lazrs', 'numba', 'pointglass.viewer.grid.preview', 'pointglass.viewer.render.renderer'};"
            "sys.exit(', '.join(wanted - set(sys.modules)) or ('torch' in sys.modules and 'torch') or 0)")
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, timeout=90).returncode == 0


@pytest.mark.gl
@pytest.mark.slow
def test_demo_without_a_display_makes_all_pictures(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    read = camera_files.read_cameras  # small: the pictures' contents are other tests' claim
    monkeypatch.setattr(camera_files, "read_cameras", lambda path: [camera.resized(160, 120) for camera in read(path)])
    (tmp_path / "file").touch()
    assert run("demo", "--out", tmp_path / "file") == 2
    assert "file: cannot make this folder (a file has this name); choose another --out\n" in one_line(capsys)
    assert run("demo", "--out", tmp_path / "demo") == 0
    cameras = json.loads((assets_dir() / "demo_cameras.json").read_text())["camera_path"]
    assert len(list((tmp_path / "demo").glob("*.png"))) == 4 * len(cameras) + 1
    assert "contact-sheet.png" in capsys.readouterr().out
    assert (assets_dir() / "demo.laz").stat().st_size <= 8 * 2**20


def test_what_a_message_quotes_is_neither_endless_nor_a_command_to_the_terminal(tmp_path, capsys):
    path = tmp_path / "\x1b[31m\x9bm" / ("a" * 3000)
    assert main(["info", str(path)]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and len(said) < 1600 and said.rstrip("\n").isprintable()
    assert str(tmp_path) in said and "x1b[31m" in said and said.endswith("a: no such file\n")
