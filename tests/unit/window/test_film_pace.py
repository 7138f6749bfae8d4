"""The Film tool: staying at keyframes, a slow beginning, and the path around a point, as steps that can be undone."""

import numpy as np
from tool_window import a_wall, context_of  # noqa: F401  (a fixture)

from pointglass.viewer.window.interaction.film.camera_path_editor import CameraPathEditor
from pointglass.viewer.work.cameras.keyframes import cameras_along


def test_orbit_makes_a_closed_path_around_the_point_in_the_middle(wall):
    context, editor = context_of(wall), CameraPathEditor()
    editor.add_keyframe(context)
    editor.orbit(context)
    path = context.document.path
    assert path.closed and len(path.keyframes) == 8 and "brings the former one back" in context.toasts[-1]
    centre = np.array([2.0, 5.0, 1.5])
    for camera in cameras_along(path, 33, (160, 90)):
        assert abs(np.linalg.norm(camera.position - centre) - 4.0) < 0.03
        assert (centre - camera.position) @ camera.forward > 3.9, "it looks at the point"
    context.session.work.undo()
    assert len(context.document.path.keyframes) == 1 and not context.document.path.closed


def test_orbit_without_a_point_in_the_middle_says_so(wall):
    context, editor = context_of(wall), CameraPathEditor()
    context.viewport.pixels.read = lambda _, name, wait: {"depth": np.full((300, 400), np.inf, np.float32),
                                                          "mask": np.zeros((300, 400), bool)}[name]
    editor.orbit(context)
    assert context.document.path.keyframes == () and "No measured point" in context.toasts[-1]


def test_a_stay_moves_with_its_keyframe_and_dragging_it_is_one_step(wall):
    context, editor = context_of(wall), CameraPathEditor()
    for _ in range(3):
        editor.add_keyframe(context)
    times = [key.time for key in context.document.path.keyframes]
    for seconds in (0.5, 1.0, 2.0):
        editor.change_stay(context, 0, seconds)
    editor.timeline.selected = 0
    editor.shift(context, 2)
    keys = context.document.path.keyframes
    assert [key.stay for key in keys] == [0.0, 0.0, 2.0] and [key.time for key in keys] == times
    context.session.work.undo()
    context.session.work.undo()
    assert [key.stay for key in context.document.path.keyframes] == [0.0, 0.0, 0.0]
