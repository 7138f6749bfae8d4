"""The window's state without a window: settings that wait, loads, failures, captures, controls."""

import csv
import threading
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, cast

import numpy as np
import pytest
from window_session import FEW, finish, frame_cost, room, session

from pointglass.viewer.common.errors import InputError, Option
from pointglass.viewer.common.progress import progress
from pointglass.viewer.picture.background import composite
from pointglass.viewer.picture.camera import from_fov, look_at
from pointglass.viewer.picture.composition import split_column
from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.preprocess.scan_description import ExposureSummary, RunSummary, ScanWarning
from pointglass.viewer.window.file_dialog.file_dialogs import FileDialogs
from pointglass.viewer.window.flight.start_viewpoint import survey
from pointglass.viewer.window.interaction import controls
from pointglass.viewer.window.kit.notices import KeepAsScanned
from pointglass.viewer.window.saving.capture import save_png, stamped
from pointglass.viewer.window.saving.save_actions import SaveActions
from pointglass.viewer.window.session.loading import Loaded, expanded, open_each
from pointglass.viewer.window.session.scan_notice_actions import act_on_notice
from pointglass.viewer.window.session.session import Session
from pointglass.viewer.window.session.time_recording import FrameTimes

if TYPE_CHECKING:
    from pointglass.viewer.window.viewport.viewport import Viewport


def test_a_still_session_needs_one_picture():
    made, clock = session()
    assert made.screen.needs_picture
    made.drew(made.screen.plan, frame_cost())
    clock.now += 5
    assert not made.advance() and not made.screen.needs_picture and made.next_change() is None
    made.flight.held.add("forward")
    made.advance()
    clock.now += 0.1
    assert made.advance() and made.screen.needs_picture


def test_neural_waits_for_its_network_and_shows_what_was_asked():
    gate = threading.Event()
    made, _ = session(loader=lambda settings: gate.wait(60) and None)
    made.view_settings.show("neural")
    assert made.view_settings.settings.view == "filled" and made.view_settings.shown_settings.view == "neural"
    gate.set()
    finish(made)
    assert made.view_settings.settings.view == "neural" and made.picture.dirty
    made.view_settings.show("raw")
    made.view_settings.show("neural")
    assert made.view_settings.settings.view == "neural" and made.view_settings.network_load is None, "a network is loaded once"


def test_a_device_that_is_not_there_is_said_at_once_and_in_the_windows_words():
    def none(settings):
        raise InputError("no CUDA here", option=Option("--device", "cuda"), remedy=(
            "use ", Option("--device", "cpu"), " or a smaller ", Option("--size"), ", or raise ", Option("--gpu-memory")))

    made, _ = session(loader=none)
    made.view_settings.request(replace(made.view_settings.settings, device="cuda"))
    finish(made)
    assert made.notices.message is not None and made.view_settings.shown_settings.device == "auto"
    assert made.notices.message.text == (
        "device cuda: no CUDA here; use device cpu or a smaller window, or raise --gpu-memory"
    )


def test_missing_weights_say_so_and_change_nothing():
    def none(settings):
        raise InputError("no weights are shipped for quality 'best'")

    made, _ = session(loader=none, settings=Settings(view="neural"))
    finish(made)
    assert made.notices.message is not None and "best" in made.notices.message.text
    assert made.view_settings.shown_settings.view == "filled"
    made.view_settings.request(replace(made.view_settings.settings, quality="best"))
    finish(made)
    assert made.view_settings.shown_settings.quality == "balanced"


def test_comparison_never_shows_the_same_view_twice_at_first():
    made, _ = session()
    for view in ("raw", "filtered", "filled"):
        made.view_settings.show(view)
        made.view_settings.compare(True)
        assert made.view_settings.sides[0] == "raw" and made.view_settings.sides[1] != "raw"
        made.view_settings.compare(False)


def gated():
    """A loader of networks that waits until its gate opens, and knows no weights of quality paper."""
    gate = threading.Event()

    def load(settings):
        gate.wait(60)
        if settings.quality == "paper":
            raise InputError("no weights are shipped for quality 'paper'")

    return gate, load


def test_the_left_side_is_what_was_chosen_last_though_a_network_comes_later():
    gate, load = gated()
    made, _ = session(loader=load)
    made.view_settings.compare(True)
    made.view_settings.choose_left("neural")
    made.view_settings.choose_left("filtered")
    gate.set()
    finish(made)
    assert made.view_settings.left == "filtered"


def test_the_left_side_gets_its_network_though_the_right_one_changes_meanwhile():
    gate, load = gated()
    made, _ = session(loader=load)
    made.view_settings.compare(True)
    made.view_settings.choose_left("neural")
    made.view_settings.show("filtered")
    assert made.view_settings.sides == ("raw", "filtered")
    gate.set()
    finish(made)
    assert made.view_settings.sides == ("neural", "filtered")


def test_a_network_that_cannot_be_had_takes_back_no_later_choice():
    gate, load = gated()
    made, _ = session(loader=load)
    made.view_settings.request(replace(made.view_settings.settings, quality="paper"))
    made.view_settings.request(replace(made.view_settings.settings, view="neural", quality="fast"))
    gate.set()
    finish(made)
    assert made.notices.message is not None and "paper" in made.notices.message.text
    assert (made.view_settings.settings.view, made.view_settings.settings.quality) == ("neural", "fast")


def test_what_is_odd_about_a_scan_is_said():
    made, _ = session()
    scene = room()
    scene = replace(scene, meta=replace(
        scene.meta, warnings=(ScanWarning("3 points without coordinates left out"),),
        exposures=ExposureSummary(2, 2, False, 1.0, 1.0), passes=RunSummary(0.5, True),
    ))  # fmt: skip
    made.accept(Loaded(scene, survey(scene)))
    assert [notice.text for notice in made.notices.of_scan] == [
        "3 points without coordinates left out", "The brightness of runs of points was made equal.",
    ]  # fmt: skip
    assert [notice.offer.label for notice in made.notices.of_scan if notice.offer] == ["Keep colours as scanned"]
    assert len(made.notices.toasts) == 2, "the rest stays in the scene list"


def test_colours_as_scanned_are_asked_of_the_load_and_the_camera_stays():
    asked = []

    def opened(paths, **colours):
        asked.append((tuple(paths), colours))
        return room()

    made, _ = session()
    made.loads.open_scene = opened
    for action in (lambda: made.open([Path("a.laz")]), lambda: act_on_notice(made, KeepAsScanned())):
        action()
        assert made.loads.current is not None and made.loads.current.join(20)
        loaded = made.poll()
        assert loaded is not None
        made.accept(loaded)
        made.flight.state = replace(made.flight.state, position=made.flight.state.position + 0.5)
        camera = made.camera
    assert asked == [((Path("a.laz"),), {}), ((Path("a.laz"),), {"match": False})]
    made.accept(loaded)
    assert np.array_equal(made.camera.camera_to_world, camera.camera_to_world)


def test_of_several_files_the_bad_ones_are_named_and_the_good_ones_are_shown():
    bad = {Path("b.ply"), Path("d.ply")}

    def opened(paths):
        for path in paths:
            if path in bad:
                raise InputError("damaged", file=path)
        return room()

    files = [Path(name) for name in ("a.ply", "b.ply", "c.ply", "d.ply")]
    _, good, problems = open_each(files, opened)
    assert good == [files[0], files[2]] and [str(problem) for problem in problems] == ["b.ply: damaged", "d.ply: damaged"]
    with pytest.raises(InputError, match=r"d\.ply"):
        open_each([Path("b.ply"), Path("d.ply")], opened)
    with pytest.raises(InputError, match="no room"):
        open_each(files, lambda paths: (_ for _ in ()).throw(InputError("/tmp: no room")))


def test_a_scan_is_fingerprinted_by_its_load_and_not_by_the_window(tmp_path, monkeypatch):
    made, _ = session()
    file, scene, reading = tmp_path / "a.laz", made.scene, []
    file.write_bytes(b"a scan")
    made.loads.preview_scene = lambda files, **_: None
    made.loads.open_scene = lambda files, **_: scene
    opened = Path.open

    def noted(path, *arguments, **options):
        reading.extend([threading.current_thread()] if path == file else [])
        return opened(path, *arguments, **options)

    monkeypatch.setattr(Path, "open", noted)
    made.loads.open([file])
    made.loads.current.join(10.0)
    made.accept(made.poll())
    assert len(reading) == 1 and reading[0] is not threading.current_thread()


def test_a_folder_of_scans_stands_for_the_scans_in_it(tmp_path):
    for name in ("b.laz", "a.ply", "notes.pdf", ".hidden.ply"):
        (tmp_path / name).write_bytes(b"LASF" if name.endswith("laz") else b"ply\n")
    single = tmp_path / "a.ply"
    assert expanded([tmp_path, single]) == [tmp_path / "a.ply", tmp_path / "b.laz", single]
    empty = tmp_path / "empty"
    empty.mkdir()
    assert expanded([empty]) == [empty], "opening it says what is wrong"


def test_what_was_said_about_a_scene_goes_with_it_and_what_was_saved_stays():
    made, _ = session()
    odd, plain = room(), room()
    odd = replace(odd, meta=replace(odd.meta, warnings=(ScanWarning("3 points without coordinates left out"),)))
    made.accept(Loaded(odd, survey(odd)))
    made.notices.toast("Saved a.png")
    made.accept(Loaded(plain, survey(plain)))
    assert [toast.text for toast in made.notices.toasts] == ["Saved a.png"]


def test_a_cancelled_load_leaves_the_scene():
    started = threading.Event()

    def endless(paths):
        with progress(0, "Reading") as meter:
            while True:
                started.set()
                meter.update(1)

    made, _ = session()
    scene, made.loads.open_scene = made.scene, endless
    made.loads.open([Path("x.laz")])
    work = made.loads.current
    assert started.wait(60) and work is not None
    made.escape()
    assert made.loads.current is None and work.join(60) and made.poll() is None
    assert made.scene is scene and made.notices.message is None


def test_a_failed_picture_goes_back_to_the_last_good_settings_and_then_stops():
    made, _ = session()
    made.drew(made.screen.plan, frame_cost())
    made.view_settings.request(replace(made.view_settings.settings, raster="points"))
    made.failed("no")
    assert made.view_settings.settings.raster == "auto" and made.screen.needs_picture
    for _ in range(4):
        made.failed("no")
    assert not made.screen.needs_picture, "a broken device must not be asked for ever"


def test_composite_is_exact_at_both_ends_and_takes_colours_premultiplied():
    image = np.zeros((1, 4, 4), np.uint8)
    image[0, 0], image[0, 1], image[0, 2], image[0, 3] = (9, 200, 255, 255), 0, (128, 128, 128, 128), (100, 50, 0, 128)
    assert composite(image).tolist() == [[[9, 200, 255], [23, 25, 29], [139, 140, 142], [111, 62, 14]]]
    assert split_column(0.0, 7) == 0 and split_column(1.0, 7) == 7


def test_captures_never_overwrite_and_leave_nothing_half_written(tmp_path):
    image = np.zeros((2, 2, 3), np.uint8)
    paths = []
    for _ in range(3):
        with stamped("pointglass", ".png", tmp_path) as path, stamped("pointglass", ".png", tmp_path) as other:
            paths.append(path)
            save_png(path, image)
            assert other != path, "as by another window in the same second"
    assert len(set(paths)) == 3 and sorted(tmp_path.iterdir()) == sorted(paths), "the other names are free again"
    with pytest.raises(InputError, match="cannot be written"), stamped("pointglass", ".png", tmp_path / "no"):
        raise AssertionError("no name was reserved")
    with pytest.raises(InputError, match="cannot be written"):
        save_png(tmp_path / "no" / "folder.png", image)


class NoViewport:
    """Stands in where no picture is to be made."""

    def settle(self):
        pass


def test_without_a_scan_there_is_nothing_to_keep_and_it_says_so(tmp_path):
    made = Session(Settings(view="filled"), (640, 400), load_network=lambda settings: None)
    save_actions = SaveActions(made, cast("Viewport", NoViewport()), FileDialogs(), tmp_path)
    assert save_actions.screenshot() is None and save_actions.record() is None and made.recording is None
    assert [toast.text for toast in made.notices.toasts] == ["Nothing to record yet: drop a scan here first"]
    assert not list(tmp_path.iterdir())


def test_a_recording_without_a_frame_leaves_no_empty_file(tmp_path):
    made, _ = session()
    save_actions = SaveActions(made, cast("Viewport", NoViewport()), FileDialogs(), tmp_path)
    save_actions.record()
    assert made.recording is not None and save_actions.record() is None and made.recording is None
    assert [toast.text for toast in made.notices.toasts] == ["No frame was drawn meanwhile: nothing saved"]
    assert not list(tmp_path.iterdir())
    save_actions.record()
    assert made.recording is not None
    made.recording.add(1.0, frame_cost(raster=1.0), (64, 48), ("raw",))
    path = save_actions.record()
    assert path is not None and made.notices.toasts[-1].text == f"Saved 1 frame to {path}"
    assert not [toast for toast in made.notices.toasts if "F9 stops" in toast.text]


def test_recording_has_a_row_a_frame(tmp_path):
    times = FrameTimes()
    for number in range(3):
        times.add(10 + number / 10, frame_cost(cull=0.5, raster=2.0), (64, 48), ("raw",))
    (tmp_path / "t.csv").write_bytes(times.csv())
    rows = list(csv.DictReader((tmp_path / "t.csv").open()))
    assert [row["interval_ms"] for row in rows] == ["", "100.000", "100.000"]
    assert rows[0]["raster_ms"] == "2.000" and rows[0]["network_ms"] == ""


def test_a_cost_told_later_is_recorded_when_and_as_large_as_its_picture_was(tmp_path):
    made, clock = session()
    made.recording = FrameTimes()
    plans = []
    for width in (640, 650, 660):
        made.resize((width, 400))
        plans.append(made.screen.plan)
        made.shown(plans[-1], hides=False, approximations=("coarse",) if width == 660 else ())
        clock.now += 0.5
    assert made.screen.approximations[:1] == ["coarse"], "of the picture on the screen, whatever it cost"
    clock.now += 100
    for plan in plans:
        made.learn(plan, frame_cost(raster=3.0))
    (tmp_path / "times.csv").write_bytes(made.recording.csv())
    rows = list(csv.DictReader((tmp_path / "times.csv").open()))
    assert [row["width"] for row in rows] == ["640", "650", "660"]
    assert [float(row["seconds"]) for row in rows] == pytest.approx([0.0, 0.5, 1.0])


def test_after_a_failure_nothing_is_owed():
    made, _ = session()
    plan = made.screen.plan
    made.shown(plan, hides=False, approximations=())
    made.failed("no memory")
    made.learn(plan, frame_cost(raster=3.0))  # whoever tells it all the same is heard
    made.drew(plan, frame_cost(raster=3.0))
    assert made.picture.cost is not None and made.picture.cost.stages == {"raster": 3.0}


def test_every_key_does_one_thing():
    keys = [key for control in controls.ALL for key in control.keys]
    assert len(keys) == len(set(keys))
    table = controls.table_markdown()
    assert all(control.help in table for control in controls.ALL)


def test_a_visit_begins_where_it_is_told_and_the_next_one_where_that_makes_sense():
    scene, told = room(points=FEW), from_fov(640, 400, 60.0, look_at((1.0, 1.5, 1.2), (6.0, 4.0, 0.8)))
    made = Session(Settings(view="filled"), (640, 400), load_network=lambda settings: None, start=told)
    made.accept(Loaded(scene, survey(scene)))
    assert np.allclose(made.camera.camera_to_world, told.camera_to_world)
    made.accept(Loaded(scene, survey(scene)))
    plain, _ = session()
    assert np.array_equal(made.camera.camera_to_world, plain.camera.camera_to_world)
