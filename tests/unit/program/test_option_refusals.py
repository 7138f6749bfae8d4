"""Invalid options are refused at once: one line, exit code 2, no files."""

import numpy as np
import pytest

from pointglass.viewer.cli import main
from pointglass.viewer.command_table import COMMANDS


def refused(capsys, *arguments) -> str:
    """The one line with which a command line is refused."""
    assert main([str(a) for a in arguments]) == 2
    said = capsys.readouterr()
    assert said.err.startswith("pointglass: ") and said.err.count("\n") == 1 and not said.out, said
    return said.err


@pytest.mark.parametrize(("options", "said"), [
    (("--procedural", "-3"), "--procedural -3: expected at least 0"),
    (("--seed", "-1"), "--seed -1: expected at least 0"),
    (("--seed", "4294967296"), "--seed 4294967296: expected at most"),
    (("--batch", "0"), "--batch 0: expected at least 1"),
    (("--steps", "0"), "--steps 0: expected at least 1"),
    (("--crop", "7"), "--crop 7: expected at least 32"),
    (("--crop", "300"), "--crop 300: thing 1 has pictures of 640x480"),
    (("--rate", "nan"), "--rate nan"),
    (("--rate", "0"), "--rate 0"),
    (("--minutes", "nan"), "--minutes nan"),
    (("--minutes", "-1"), "--minutes -1"),
    (("--start-from", "/nope"), "--start-from /nope: no such weights"),
    (("--perceptual", "/nope"), "--perceptual /nope: sqz_notop.mat is missing"),
    (("--device", "cuda"), "--device cuda: "),
])
def test_training_refuses_options_before_a_place_is_built(options, said, tmp_path, capsys, monkeypatch):
    import pointglass.model.data.procedural as procedural
    import pointglass.model.network.reconstruct as reconstruct

    monkeypatch.setattr(procedural.ProceduralPlace, "place", property(lambda self: pytest.fail("a place was built")))
    monkeypatch.setattr(reconstruct, "cuda_problem", lambda: "none here")
    assert said in refused(capsys, "train", "--procedural", "1", "--out", tmp_path / "out", *options)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("options", "said"), [
    (("--recipe", "gpu", "--minutes", "0"), "--minutes 0: --recipe needs more than 0 minutes"),
    (("--tune", "scan.e57", "--minutes", "0"), "--minutes 0: --tune needs more than 0 minutes"),
])
def test_zero_minutes_are_refused_where_steps_do_not_count(options, said, tmp_path, capsys):
    assert said in refused(capsys, "train", *options, "--out", tmp_path / "out")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("way", [("--recipe", "night"), ("--tune", "scan.e57")])
def test_training_in_one_process_is_refused_under_torchrun(way, tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("WORLD_SIZE", "2")
    said = refused(capsys, "train", *way, "--out", tmp_path / "out")
    assert f"{way[0]} trains in one process, not in 2" in said and not list(tmp_path.iterdir())


@pytest.mark.parametrize(("options", "said"), [
    (("--recipe", "night", "room", "--seed", "2", "--steps", "5", "--unfiltered", "--start-from", "/nope", "--rate", "0.1"),
     "`train --recipe` ignores --unfiltered, --steps 5, --rate 0.1, --start-from /nope"),
    (("--recipe", "night", "--quality", "fast", "--batch", "2", "--crop", "64", "--procedural", "3"),
     "`train --recipe` ignores --procedural 3, --quality fast, --batch 2, --crop 64"),
    (("--tune", "scan.e57", "room", "--recipe", "gpu", "--validation", "box", "--quality", "fast"),
     "`train --tune` ignores room, --recipe gpu, --validation box"),
    (("room", "--validation", "box", "--minutes", "0"), "`train` ignores --validation box"),
    (("--recipe", "night", "--validation", "box", "--minutes", "3"), ""),
    (("--tune", "scan.e57", "--quality", "fast", "--seed", "4"), ""),
    (("room", "--steps", "5", "--start-from", "WEIGHTS", "--unfiltered"), ""),
])
def test_training_names_the_options_it_ignores(options, said, tmp_path, capsys, monkeypatch):
    from pointglass.model.network.weights_folder import weights_dir
    from pointglass.model.train import command as train_command
    from pointglass.model.train import recipes
    from pointglass.viewer.commands.tuning import tune

    done = []
    monkeypatch.setattr(recipes, "follow", lambda *_, **__: done.append("recipe"))
    monkeypatch.setattr(tune, "tune", lambda *_, **__: done.append("tune"))
    monkeypatch.setattr(train_command, "_pairs", lambda *_: done.append("pairs") or [])
    monkeypatch.setattr("pointglass.model.train.trainer.train", lambda _config: "weights")
    options = [str(weights_dir() / "fast-filtered.safetensors") if o == "WEIGHTS" else o for o in options]
    assert main(["train", *options, "--out", str(tmp_path / "out")]) == 0 and len(done) == 1
    assert capsys.readouterr().err == (f"pointglass: {said}\n" if said else "")


def test_an_empty_list_of_pairs_does_not_stop_a_later_training(tmp_path, capsys, monkeypatch):
    """As earlier versions left it after `--procedural -3`."""
    import pointglass.model.data.procedural as procedural

    class Built(Exception):
        pass

    def build(_place):
        raise Built

    monkeypatch.setattr(procedural.ProceduralPlace, "views", property(build))
    (tmp_path / "pairs-filtered.txt").write_text("\n")
    with pytest.raises(Built):
        main(["train", "--procedural", "1", "--out", str(tmp_path)])


@pytest.mark.parametrize(("options", "said"), [
    (("--points", "-5"), "--points -5: expected 1000 to"),
    (("--points", "0"), "--points 0: expected 1000 to"),
    (("--points", "1"), "--points 1: expected 1000 to"),
    (("--points", "1000000000000"), "--points 1000000000000: expected 1000 to"),
    (("--seed", "-1"), "--seed -1: expected 0 to"),
    (("--seed", "18446744073709551616"), "--seed 18446744073709551616: expected 0 to"),
    (("--out", "{folder}/x.ply"), "x.ply: the name must end in .laz or .las"),
    (("--out", "{folder}/x"), "x: the name must end in .laz or .las"),
    (("--out", "/dev/null/a/x.laz"), "/dev/null/a/x.laz: cannot be written"),
])
def test_simulate_refuses_options_before_any_work(options, said, tmp_path, capsys, monkeypatch):
    from pointglass.model.synth import demo

    monkeypatch.setattr(demo, "simulate", lambda *_, **__: pytest.fail("simulated"))
    options = [text.format(folder=tmp_path) for text in options]
    out = [] if "--out" in options else ["--out", tmp_path / "new" / "x.laz"]
    assert said in refused(capsys, "simulate", *out, *options)
    assert not list(tmp_path.iterdir())


def test_a_full_disk_leaves_no_files_of_a_simulation(tmp_path, capsys, monkeypatch):
    import errno

    from pointglass.model.synth import demo

    def full(_scan, _path):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(demo, "simulate", lambda *_, **__: None)
    monkeypatch.setattr(demo, "write_laz", full)
    said = refused(capsys, "simulate", "--out", tmp_path / "a" / "b" / "x.laz")
    assert "x.laz: cannot be written (No space left on device)" in said and not list(tmp_path.iterdir())


@pytest.mark.slow
def test_simulate_names_both_files_and_counts_its_pulses(tmp_path, capsys, monkeypatch):
    from functools import partial

    from pointglass.model.synth import demo
    from pointglass.model.synth.place import Place
    from pointglass.viewer.common.progress import set_sink

    monkeypatch.setattr(demo, "Place", partial(Place, probe_rays=0))
    seen = []
    set_sink(lambda label, done, total: seen.append((label, done, total)) or True)
    try:
        assert main(["simulate", "--out", str(tmp_path / "x.las"), "--points", "2000"]) == 0
    finally:
        set_sink(None)
    said = capsys.readouterr().out
    assert f"scan in {tmp_path / 'x.las'}, cameras in {tmp_path / 'x_cameras.json'}" in said
    assert sorted(p.name for p in tmp_path.iterdir()) == ["x.las", "x_cameras.json"]
    assert len(seen) >= 3 and all(label == "scanning" and 0 < done <= total == 2200 for label, done, total in seen)
    assert seen[-1][1] > 0.8 * 2200


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_a_command_describes_it_and_every_option(command, capsys):
    from pointglass.viewer.command_table import make_parser

    with pytest.raises(SystemExit):
        main([command, "--help"])
    assert capsys.readouterr().out.splitlines()[0].startswith(f"usage: pointglass {command} ")
    commands = next(action for action in make_parser()._actions if isinstance(action.choices, dict))
    assert isinstance(commands.choices, dict)
    of_this = commands.choices[command]
    assert of_this.description and of_this.description.endswith(".")
    assert not [action.dest for action in of_this._actions if not action.help]


def test_the_help_of_simulate_names_the_cameras_file(capsys):
    with pytest.raises(SystemExit):
        main(["simulate", "--help"])
    assert "_cameras.json" in capsys.readouterr().out


def test_empty_folders_of_a_failure_are_removed(tmp_path):
    from pointglass.model.common.files.folders import made_folder

    with pytest.raises(KeyboardInterrupt), made_folder(tmp_path / "a" / "b"):
        raise KeyboardInterrupt
    assert not list(tmp_path.iterdir())
    with pytest.raises(ValueError, match="later"), made_folder(tmp_path / "a" / "b"):
        (tmp_path / "a" / "kept.txt").touch()
        raise ValueError("later")
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["kept.txt"]
    with made_folder(tmp_path / "c"):
        pass
    assert (tmp_path / "c").is_dir()


@pytest.mark.parametrize("stop", ["SIGINT", "SIGTERM"])
@pytest.mark.parametrize("module", ["argparse", "torch"])
def test_an_interrupt_during_imports_gives_one_line(tmp_path, module, stop):
    """A slow module simulates a slow disk; an exception raised there would crash, as in torch's imports."""
    import os
    import signal
    import subprocess
    import sys

    from pointglass.viewer.common.paths import assets_dir

    (tmp_path / f"{module}.py").write_text(
        "import os, time\ntry:\n    print('importing', flush=True)\n    time.sleep(60)\nexcept BaseException:\n    os.abort()\n"
    )
    environment = {**os.environ, "PYTHONPATH": f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
    cameras = assets_dir() / "demo_cameras.json"
    command = [sys.executable, "-m", "pointglass.viewer", "render", "x.laz", "--cameras", str(cameras),
               "--out", str(tmp_path / "out")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment,
                          preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)) as process:
        assert process.stdout is not None and process.stdout.readline() == "importing\n"
        process.send_signal(getattr(signal, stop))
        _, said = process.communicate(timeout=30)
    assert process.returncode == 130 and said == "pointglass: stopped\n"


@pytest.mark.parametrize(("command", "policy"), [("info", "passive"), ("train", None)])
def test_openmp_threads_wait_passively_except_in_training(monkeypatch, command, policy):
    import os

    from pointglass.viewer import cli

    monkeypatch.setenv("OMP_WAIT_POLICY", "")  # so that monkeypatch restores it
    monkeypatch.delenv("OMP_WAIT_POLICY")
    monkeypatch.setitem(cli._RUN, command, lambda _options: 0)
    assert cli.main([command, "--out", "x", "y"] if command == "train" else [command, "y"]) == 0
    assert os.environ.get("OMP_WAIT_POLICY") == policy


def test_ctrl_c_is_recognised_in_the_error_of_a_compiled_loop(monkeypatch, capsys):
    from pointglass.viewer import cli

    def stopped(_options):
        try:
            raise KeyboardInterrupt
        except KeyboardInterrupt as error:
            raise SystemError("returned a result with an exception set") from error

    monkeypatch.setitem(cli._RUN, "doctor", stopped)
    assert cli.main(["doctor"]) == 130 and capsys.readouterr().err == "pointglass: stopped\n"


@pytest.mark.parametrize("stop", ["SIGINT", "SIGTERM"])
def test_an_interrupt_in_a_compiled_loop_waits_for_its_results(monkeypatch, stop):
    """Raised earlier, it would crash the process: numba does not check every one of several results."""
    import signal

    from pointglass.model.synth import shapes
    from pointglass.model.synth.place import Place

    whole = []

    def interrupted(*_):
        signal.raise_signal(number)
        whole.append(True)

    number, place, before = getattr(signal, stop), Place(1, probe_rays=0), signal.default_int_handler
    monkeypatch.setattr(shapes, "trace_rays", interrupted)
    given = signal.signal(number, before)  # a shell's background jobs ignore it
    try:
        with pytest.raises(KeyboardInterrupt):
            place.shapes.trace(np.ones((1, 3)), np.array([[0.0, 0.0, 1.0]]))
        assert whole and signal.getsignal(number) is before
    finally:
        signal.signal(number, given)


def test_convert_of_a_truncated_scan_leaves_no_folders(tmp_path, capsys):
    from pointglass.viewer.common.paths import assets_dir

    torn = tmp_path / "torn.laz"
    torn.write_bytes((assets_dir() / "demo.laz").read_bytes()[:200_000])
    assert "torn.laz" in refused(capsys, "convert", torn, "--out", tmp_path / "a" / "b" / "c")
    assert [p.name for p in tmp_path.iterdir()] == ["torn.laz"]


def test_render_without_weights_reads_no_scan_and_makes_no_folder(tmp_path, capsys, monkeypatch):
    from pointglass.viewer.common.paths import assets_dir
    from pointglass.viewer.grid import open_scene

    monkeypatch.setattr(open_scene, "open_scene", lambda *_, **__: pytest.fail("the scan was opened"))
    scan, cameras = assets_dir() / "demo.laz", assets_dir() / "demo_cameras.json"
    line = ("render", scan, "--cameras", cameras, "--out", tmp_path / "a" / "b", "--view", "neural")
    assert "no weights are shipped for quality 'paper'" in refused(capsys, *line, "--quality", "paper")
    assert "/nope: no such weights" in refused(capsys, *line, "--weights", "/nope")
    assert not list(tmp_path.iterdir())


def test_pictures_that_cannot_be_written_leave_no_folder(tmp_path):
    from typing import Any

    from pointglass.viewer.commands.render_pictures import export_pictures
    from pointglass.viewer.picture.camera import from_fov
    from pointglass.viewer.picture.settings import Settings
    from pointglass.viewer.picture.spec import PictureSpec

    class Interrupted:
        def __getattr__(self, _name):
            raise KeyboardInterrupt

    spec = PictureSpec(from_fov(8, 6, 60.0, np.eye(4), "a"), Settings())
    renderer: Any = Interrupted()
    with pytest.raises(KeyboardInterrupt):
        export_pictures(renderer, [spec], tmp_path / "a" / "b")
    assert not list(tmp_path.iterdir())


def test_a_training_interrupted_while_places_are_built_leaves_no_folder(tmp_path, monkeypatch, capsys):
    import pointglass.model.data.procedural as procedural

    def stopped(_place):
        raise KeyboardInterrupt

    monkeypatch.setattr(procedural.ProceduralPlace, "views", property(stopped))
    assert main(["train", "--procedural", "1", "--out", str(tmp_path / "a" / "b")]) == 130
    assert capsys.readouterr().err == "pointglass: stopped\n" and not list(tmp_path.iterdir())


@pytest.mark.parametrize(("words", "said"), [
    (("render", "x.laz", "--camras", "f", "--out", "o"), "--camras, did you mean --cameras? (see `pointglass render --help`)"),
    (("train", "--out", "o", "--minute=3", "--perceptul=d"), "--perceptul, did you mean --perceptual?"),  # --minute is short
    (("demo", "--size", "9x9"), "unrecognized arguments: --size (see `pointglass demo --help`)"),  # not --view
    (("bench", "frame", "--zzz"), "unrecognized arguments: --zzz (see `pointglass bench --help`)"),
])
def test_misspelt_options_are_reported_before_missing_ones(words, said, capsys):
    assert said in refused(capsys, *words)
