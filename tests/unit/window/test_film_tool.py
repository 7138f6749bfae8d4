"""The Film and Section tools without a window: bookmarks and keyframes are steps of the history, paths go to files and back,
and sheets are saved beside the window."""

import io
import time

import numpy as np
import pytest
from window_session import frame_cost, session

from pointglass.viewer.commands.film.command import read_path
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.camera import look_at
from pointglass.viewer.window.flight.navigation import view_along
from pointglass.viewer.window.interaction.editing import copy_camera, paste_camera
from pointglass.viewer.window.interaction.film.camera_path_editor import fly_to
from pointglass.viewer.window.interaction.film.film_tool import Film
from pointglass.viewer.window.interaction.film.timeline import column, nearest_marker, seconds_at
from pointglass.viewer.window.interaction.section.section_tool import SectionTool
from pointglass.viewer.window.interaction.tool import KeyEvent, ToolContext
from pointglass.viewer.work.cameras.camera_files import read_cameras
from pointglass.viewer.work.cameras.keyframes import cameras_along, passing_seconds, path_seconds
from pointglass.viewer.work.document import CameraPath, Document, FilmFormat, FilmTitle, Keyframe
from pointglass.viewer.work.pictures.shot_metadata import camera_line
from pointglass.viewer.work.project import read_project, write_project
from pointglass.viewer.work.viewpoint import Viewpoint


@pytest.fixture
def context(tmp_path):
    made, _ = session()
    found = ToolContext(made, None, None)  # type: ignore[arg-type]
    found.folder = tmp_path
    return found


def stand(context, place, ahead):
    flight = context.session.flight
    flight.go(view_along(place, ahead, flight.state.speed))


def with_path(context, film, count=3, seed=2):
    rng = np.random.default_rng(seed)
    places = rng.uniform((1, 1, 1), (7, 5, 2), (count, 3))
    for place in places:
        stand(context, place, rng.normal(size=3) * (1, 1, 0.2))
        film.path.add_keyframe(context)
    return places


def test_bookmarks_and_keyframes_are_steps_that_can_be_undone(context):
    film = Film()
    stand(context, (1.0, 2.0, 1.5), (1.0, 0.5, 0.0))
    before = context.camera.camera_to_world
    film.add_bookmark(context)
    film.add_bookmark(context)
    assert [view.name for view in context.document.viewpoints] == ["View", "View 2"]
    stand(context, (5.0, 4.0, 1.0), (-1.0, 0.0, 0.3))
    fly_to(context, context.document.viewpoints[0])
    assert np.allclose(context.camera.camera_to_world, before, atol=1e-12)
    places = with_path(context, film)
    assert [key.time for key in context.document.path.keyframes] == [0.0, 3.0, 6.0]
    film.path.set_length(context, 12.0)
    assert path_seconds(context.document.path) == pytest.approx(12.0)
    film.path.show_at(context, 0.0)
    assert np.allclose(context.camera.position, places[0])
    film.path.show_at(context, 99.0)
    assert film.path.at == pytest.approx(12.0) and np.allclose(context.camera.position, places[-1])
    for _ in range(6):
        context.session.work.undo()
    assert context.document.viewpoints == () and context.document.path == CameraPath()


def test_a_camera_path_goes_to_a_file_and_back_and_is_the_film_of_the_command(context, tmp_path):
    film = Film()
    film.change_format(context, size=(320, 180))
    with_path(context, film, 4)
    film.path.set_length(context, 2.0)
    path = context.document.path
    film.path.write_path(context, tmp_path / "path.json")
    film_path = read_path(tmp_path / "path.json")
    cameras, rate = film_path.cameras, film_path.rate
    assert rate == path.fps and len(cameras) == 60
    for made, own in zip(cameras, film.job(context, tmp_path / "film.mp4").cameras, strict=True):
        assert np.allclose(made.camera_to_world, own.camera_to_world, atol=1e-9) and made.fx == pytest.approx(own.fx)
    film.path.read_path(context, tmp_path / "path.json")
    for key, before in zip(context.document.path.keyframes, path.keyframes, strict=True):
        assert np.allclose(key.view.camera_to_world, before.view.camera_to_world, atol=1e-12)
    assert len(read_cameras(tmp_path / "path.json")) == 4
    film.path.write_path(context, tmp_path / "gone" / "path.json")
    told = context.session.notices.message.text
    assert told.startswith(f"{tmp_path / 'gone' / 'path.json'}: cannot be written (No such file or directory); choose")


def test_what_the_panel_says_of_the_video_is_kept_in_the_project_and_undone(context, tmp_path):
    film, work = Film(), context.session.work

    def changed() -> bool:
        return work.changed(work.document.settings, work.document.background)

    assert not changed()
    film.change_format(context, size=(320, 180), view="filled")
    film.change_format(context, size=(320, 180), view="filled")  # nothing new is no step
    for width in (3, 32, 320):
        film.change_format(context, "film size", size=(width // 2 * 2 + 16, 180))
    wanted = FilmFormat((336, 180), view="filled")
    assert context.document.path.format == wanted and changed()
    write_project(tmp_path / "a.pointglass", context.document)
    assert read_project(tmp_path / "a.pointglass").path.format == wanted
    with_path(context, film)
    made = film.job(context, tmp_path / "film.mp4")
    assert (made.cameras[0].width, made.cameras[0].height, made.settings.view) == (336, 180, "filled")
    for _ in range(4):
        work.undo()
    assert context.document.path.format.size == (320, 180)
    work.undo()
    assert context.document.path == CameraPath()
    for wrong in ({"size": (321, 180)}, {"view": "film"}, {"quality": "good"}, {"supersample": 9}):
        with pytest.raises(InputError, match="expected"):
            FilmFormat(**wrong)


def test_titles_go_with_a_path_to_its_file_and_back_and_are_undone(context, tmp_path):
    film = Film()
    with_path(context, film, 3)
    film.path.change_title(context, FilmTitle("Halle 7\n漢字", 2.5))
    film.path.change_title(context, FilmTitle("The end"), 2)
    film.path.change_title(context, FilmTitle("The end"), 2)  # nothing new is no step
    film.path.change_stay(context, 1, 0.5)
    path = context.document.path
    shown = film.job(context, tmp_path / "film.mp4").titles.shown
    assert [(title.text, title.begin, title.seconds, title.opening) for title in shown] == [
        ("Halle 7\n漢字", 0.0, 2.5, True), ("The end", 2.0, 4.0, False)], "the caption of the end is shown as long as it says"
    film.path.write_path(context, tmp_path / "path.json")
    for _ in range(3):
        context.session.work.undo()
    assert context.document.path.title is None and not any(key.caption for key in context.document.path.keyframes)
    film.path.read_path(context, tmp_path / "path.json")
    read = context.document.path
    assert (read.title, [key.caption for key in read.keyframes]) == (path.title, [None, None, FilmTitle("The end")])
    assert [key.stay for key in read.keyframes] == [0.0, 0.5, 0.0]
    write_project(tmp_path / "a.pointglass", Document(path=path))
    assert read_project(tmp_path / "a.pointglass").path == path


def test_a_keyframe_is_selected_reordered_given_a_lens_replaced_and_deleted(context):
    film = Film()
    places = with_path(context, film, 4)
    path, editor = context.document.path, film.path
    editor.select(context, 2)
    assert np.allclose(context.camera.position, places[2]) and editor.at == passing_seconds(path)[2]
    editor.show_at(context, editor.at)
    along = path_seconds(path) * path.fps
    assert np.linalg.norm(context.camera.position - places[2]) < 2 * np.linalg.norm(np.ptp(places, axis=0)) * 3 / along
    editor.change_lens(context, 25.0)
    assert context.camera.vertical_fov == pytest.approx(25.0)
    assert [round(key.view.vertical_fov) for key in context.document.path.keyframes] == [60, 60, 25, 60]
    film.add_bookmark(context)
    assert context.document.viewpoints[-1].vertical_fov == pytest.approx(25.0)
    editor.show_at(context, 0.0)
    assert context.camera.vertical_fov == pytest.approx(60.0)  # the preview has the lens of the film
    fly_to(context, context.document.viewpoints[-1])
    assert context.camera.vertical_fov == pytest.approx(25.0)
    editor.shift(context, -2)
    assert editor.timeline.selected == 0
    assert [key.view.name for key in context.document.path.keyframes] == ["Key 3", "Key", "Key 2", "Key 4"]
    assert [key.time for key in context.document.path.keyframes] == [key.time for key in path.keyframes]
    editor.shift(context, -1)  # the first one stays
    stand(context, (2.0, 2.0, 1.0), (0.0, 1.0, 0.0))
    editor.replace_view(context)
    assert np.allclose(context.document.path.keyframes[0].view.camera(16, 9).position, (2.0, 2.0, 1.0))
    assert film.key_event(KeyEvent("DELETE", "press"), context) and not film.key_event(KeyEvent("DELETE", "press"), context)
    assert [key.view.name for key in context.document.path.keyframes] == ["Key", "Key 2", "Key 4"]
    for _ in range(3):
        context.session.work.undo()
    assert [round(key.view.vertical_fov) for key in context.document.path.keyframes] == [60, 60, 25, 60]
    context.session.flight.go_home()
    assert context.camera.vertical_fov == pytest.approx(60.0)


@pytest.mark.parametrize("ease", [False, True])
@pytest.mark.parametrize("closed", [False, True])
def test_the_film_passes_its_keyframes_when_the_timeline_says(seed, closed, ease):
    rng = np.random.default_rng(seed)
    places = enumerate(rng.uniform(0, 9, (5, 3)))
    stays = rng.choice([0.0, 0.4], 5) * ease
    keys = tuple(Keyframe(float(n), Viewpoint.of(look_camera(place), str(n)), float(stays[n])) for n, place in places)
    path = CameraPath(keys, closed=closed, ease=ease)
    cameras = cameras_along(path, 2001, (160, 90))
    for key, seconds in zip(keys, passing_seconds(path), strict=True):
        there = cameras[round(seconds / path_seconds(path) * 2000)]
        assert np.linalg.norm(there.position - key.view.camera(160, 90).position) < 0.05
    before_end = passing_seconds(path)[-1] < path_seconds(path) - 0.01
    assert passing_seconds(path)[0] == 0.0 and before_end == (closed or stays[-1] > 0)


def test_columns_of_the_timeline_and_times_are_inverse():
    for seconds in np.linspace(0.0, 7.0, 9):
        assert seconds_at(column(seconds, 7.0, 200.0, 8.0), 7.0, 200.0, 8.0) == pytest.approx(seconds)
    assert seconds_at(-5.0, 7.0, 200.0, 8.0) == 0.0 and seconds_at(999.0, 7.0, 200.0, 8.0) == 7.0
    assert nearest_marker(12.0, [10.0, 50.0], 5.0) == 0 and nearest_marker(30.0, [10.0, 50.0], 5.0) is None


def test_a_closed_path_ends_where_it_began():
    keys = tuple(Keyframe(float(n), Viewpoint.of(look_camera(place), str(n)))
                 for n, place in enumerate([(0, 0, 1), (4, 0, 1), (4, 3, 1)]))
    cameras = cameras_along(CameraPath(keys, closed=True), 50, (160, 90))
    assert np.allclose(cameras[0].position, cameras[-1].position, atol=1e-9)
    assert path_seconds(CameraPath(keys, closed=True)) == pytest.approx(3.0)


def look_camera(place):
    from pointglass.viewer.picture.camera import from_fov

    return from_fov(160, 90, 60.0, look_at(np.array(place, float), (2.0, 9.0, 1.0)))


def test_a_camera_is_copied_and_pasted_as_text(context):
    stand(context, (1.0, 2.0, 1.5), (1.0, 0.5, -0.2))
    context.session.flight.field_of_view = 33.0
    before = context.camera
    copy_camera(context)
    assert context.clipboard.read() == camera_line(before)
    stand(context, (5.0, 4.0, 1.0), (-1.0, 0.0, 0.3))
    context.session.flight.field_of_view = 60.0
    paste_camera(context)
    assert np.allclose(context.camera.camera_to_world, before.camera_to_world, atol=1e-12)
    assert context.camera.vertical_fov == pytest.approx(33.0)
    context.clipboard.write("no camera")
    paste_camera(context)
    assert np.allclose(context.camera.camera_to_world, before.camera_to_world, atol=1e-12)
    assert any("no camera" in toast.text for toast in context.session.notices.toasts)


def finish(tool, context):
    end = time.monotonic() + 60
    while tool.worker is not None and time.monotonic() < end:
        time.sleep(0.01)
        tool.follow(context)
    assert tool.worker is None


def test_a_sheet_is_saved_beside_the_window(context, tmp_path):
    tool = SectionTool()
    tool.sheet.scale, made = 100, tmp_path / "plan.png"
    tool.start(context, made)
    finish(tool, context)
    assert list(tmp_path.iterdir()) == [made]
    tool.kind = "line"
    tool.ask(context)  # no ends yet
    assert tool.worker is None and any("two ends" in toast.text for toast in context.session.notices.toasts)
    tool.ends = [np.array([0.5, 3.0, 1.0]), np.array([7.5, 3.0, 2.0])]
    cut = tool.cut(context)
    assert cut is not None and cut.rightmost == pytest.approx(7.0)
    assert cut.contains(cut.paper(np.array([[4.0, 3.05, 1.0]]))).all()
    tool.keep_slab(context)
    (clip,) = context.document.clips
    assert clip.name == "Section" and clip.thickness == pytest.approx(cut.far - cut.near)
    tool.height, tool.kind = 1e9, "plan"
    tool.start(context, made)
    finish(tool, context)
    assert "holds no point" in context.session.notices.message.text and len(list(tmp_path.iterdir())) == 1


def test_frame_times_become_a_plot(tmp_path):
    from PIL import Image

    from pointglass.viewer.window.session.time_recording import FrameTimes

    times, rng = FrameTimes(), np.random.default_rng(3)
    for number in range(40):
        stages = {"cull": 1.0, "raster": float(rng.uniform(5, 9)), "filter": 2.0}
        times.add(number * 0.03, frame_cost(total_ms=sum(stages.values()), **stages), (64, 48), ("filtered",))
    image = np.asarray(Image.open(io.BytesIO(times.plot())).convert("RGB"))
    assert image.shape[0] > 400 and len(np.unique(image.reshape(-1, 3), axis=0)) > 10


def test_edits_are_what_changes_pictures():
    assert Document().edits.none
    assert not Document(hidden_stations=(3,)).edits.none
