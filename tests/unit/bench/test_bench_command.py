"""The benches' command line: bad usage, help, kinds that are loaded late, and what a plot says of its machine."""

import json

import pytest
from bench_run import run

from pointglass.viewer import bench
from pointglass.viewer.bench import KINDS
from pointglass.viewer.bench.bench_input import Subject, described
from pointglass.viewer.bench.procedural_scan import ProceduralScan


@pytest.mark.parametrize(("arguments", "said"), [
    (("frame", "--procedural", "many"), "--procedural 'many': expected a whole number of points"),
    (("frame", "--procedural", "0.5"), "expected a whole number of points"),
    (("scale", "--points", "1M,,2M"), "--points ''"),
    (("frame", "--size", "64"), "--size '64': expected WIDTHxHEIGHT"),
    (("frame", "a.laz", "--procedural", "1M"), "give one or the other"),
    (("grid", "a.laz"), "a.laz: `bench grid` makes its own points"),
    (("frame", "--repeats", "0"), "--repeats 0: expected at least 1"),
    (("open", "--procedural", "1M", "--rooms", "0"), "--rooms 0: expected at least 1"),
    (("open", "--json", "/nowhere/at/all/x.json"), "--json /nowhere/at/all/x.json: no such folder"),
    (("frame", "--plot", "x.foo"), "--plot x.foo: the name must end in .png, .svg"),
    (("frame", "--plot", "x"), "--plot x: the name must end in"),
    (("versus", "--frames", "-1", "--size", "64x48"), "--frames -1: expected at least 1"),
    (("versus", "--frames", "0"), "--frames 0: expected at least 1"),
    (("occlusion", "--points", "50K", "--frames", "2", "--size", "64x48"), "--frames 2: expected at least 3"),
    (("occlusion", "--rooms", "0"), "--rooms 0: expected at least 1"),
    (("frame", "--procedural", "100K", "--seed", "-1"), "--seed -1: expected 0 to 4294967295"),
    (("raster", "--seed", "4294967296"), "--seed 4294967296: expected 0 to 4294967295"),
    (("scale", "--keep", __file__), "is a file; give a folder"),
    (("open", "missing.laz"), "missing.laz: no such file"),
])
def test_bad_usage_is_one_line(arguments, said, capsys):
    assert run("bench", *arguments) == 2
    out = capsys.readouterr().err
    assert said in out and out.count("\n") == 1


@pytest.mark.parametrize(("arguments", "said"), [
    (("error", "--quality", "fast", "--raster", "points"), "`bench error` ignores --raster points, --quality fast"),
    (("open", "--size", "64x48,96x64"), "`bench open` ignores more than one --size"),
    (("frame", "--frames", "2", "--points", "5"), "`bench frame` ignores --frames 2, --points 5"),
    (("grid", "--seed", "3"), "--seed 3"),
    (("occlusion", "--lod", "4", "--rooms", "2", "--repeats", "2"), "ignores --repeats 2"),
    (("frame", "--quality", "fast", "--along", "views", "--repeats", "2", "--size", "64x48,96x64", "--seed", "2"), None),
    (("versus", "--frames", "2", "--precision", "fp32"), None),
    (("scale", "--points", "1M", "--lod", "2", "--filter-levels", "3"), None),
    (("raster",), None),
])
def test_options_that_a_bench_has_no_use_for_are_named(monkeypatch, capsys, arguments, said):
    monkeypatch.setitem(bench._RUN, arguments[0], lambda *_: ({}, lambda result: [], None))
    assert run("bench", *arguments) == 0
    heard = capsys.readouterr().err
    assert said in heard if said else not heard


def test_the_picture_formats_are_those_that_matplotlib_writes():
    from pointglass.viewer.bench import PLOT_SUFFIXES
    from pointglass.viewer.bench.plots import figure

    made, _ = figure()
    assert {suffix[1:] for suffix in PLOT_SUFFIXES} <= made.canvas.get_supported_filetypes().keys()


def test_occlusion_runs_on_as_few_frames_as_it_takes(tmp_path, capsys):
    found = tmp_path / "o.json"
    run("bench", "occlusion", "--rooms", "1", "--points", "50K", "--frames", "3", "--size", "64x48", "--json", found)
    assert json.loads(found.read_text())["frames"] == 3 and "heaviest frame" in capsys.readouterr().out


def test_too_few_points_for_the_rooms_are_refused(capsys):
    assert run("bench", "open", "--procedural", "5", "--rooms", "3") == 2
    assert "5 points in 3 rooms: at least 6" in capsys.readouterr().err


@pytest.mark.gl
def test_stability_holds_and_a_broken_claim_is_exit_code_1(monkeypatch, capsys, tmp_path):
    from pointglass.viewer.bench.cases import stability

    found, drawn = tmp_path / "s.json", tmp_path / "s.png"
    command = ("bench", "stability", "--size", "64x48", "--seed", "7", "--json", found, "--plot", drawn)
    assert run(*command) == 0
    result, said = json.loads(found.read_text()), capsys.readouterr().out
    assert result["size"] == [64, 48] and result["failed"] == [] and len(result["rows"]) == 26
    assert "0 (limit 0)" in said and "(at least 0.98)" in said and drawn.read_bytes().startswith(b"\x89PNG")
    monkeypatch.setattr(stability, "repeated", lambda *_: [stability.row("bytes changed", 3, 0)])
    assert run(*command) == 1 and "3 (limit 0)   BEYOND ITS LIMIT" in capsys.readouterr().out
    assert json.loads(found.read_text())["failed"] == ["bytes changed"]


@pytest.mark.parametrize("rooms", [1, 4])
def test_occlusion_walks_through_its_rooms(rooms, capsys, tmp_path):
    found, drawn = tmp_path / "occlusion.json", tmp_path / "occlusion.png"
    options = ("--rooms", rooms, "--points", "100k", "--frames", "6", "--size", "64x48", "--json", found, "--plot", drawn)
    status = run("bench", "occlusion", *options)
    result, said = json.loads(found.read_text()), capsys.readouterr().out
    assert result["points"] == 100_000 and result["rooms"] == rooms and len(result["rows"]) == 6 and result["jump"] == 4
    assert bool(status) == result["failed"] == (max(row["wrong"] for row in result["rows"]) >= result["limit"])
    assert f"{100 * result['wrong_worst']:.4f} % (limit 0.1 %)" in said and len(said.splitlines()) < 20
    assert drawn.read_bytes().startswith(b"\x89PNG")


def test_every_kind_has_its_help(capsys):
    with pytest.raises(SystemExit):
        run("bench", "--help")
    said = " ".join(capsys.readouterr().out.split())
    assert all(f"{name}: {kind.text}" in said for name, kind in KINDS.items())


def test_facts_name_machine_driver_versions_scan_and_size():
    machine = {"processor": "P", "cores": 3, "gpu": {"name": "G", "cuda": "13"}, "versions": {"torch": "2", "x": None}}
    result = {"machine": machine,
              "opengl": "soft", "driver": "9.9", "scans": ["/some/where/a.laz"], "size": [64, 48]}
    said = described(result)
    assert all(part in said for part in ("P, 3 cores", "G, CUDA 13", "soft (9.9)", "torch 2", "a.laz", "64x48"))
    assert "/some/where" not in said and Subject(procedural=ProceduralScan(10, 1)).names == [
        "procedural scan, 10 points, 1 rooms, seed 1"]
