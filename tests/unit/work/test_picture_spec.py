"""A picture is drawn again wherever its description differs from the one drawn: every field of every part, by name."""

import dataclasses
import typing

import numpy as np
import pytest
from window_session import frame_cost, session

from pointglass.viewer.picture.clip import Box, Slab
from pointglass.viewer.picture.colour_modes import COLOUR_BY, RAMPS
from pointglass.viewer.picture.dates.date_comparison import DateComparison
from pointglass.viewer.picture.edits import GHOSTS, Edits
from pointglass.viewer.picture.look import Look
from pointglass.viewer.picture.meshes.mesh_layer import MeshLayer
from pointglass.viewer.picture.photographs.placed_photograph import PlacedPhotograph
from pointglass.viewer.picture.point_sets import PointLevels, PointSet
from pointglass.viewer.picture.regions import ClassChange, Region
from pointglass.viewer.picture.settings import BACKGROUNDS, CHOICES
from pointglass.viewer.picture.spec import PictureSpec
from pointglass.viewer.picture.views import VIEWS
from pointglass.viewer.work.document import Document

BOX = Box((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))
SLAB = Slab((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0)
SOME = PointSet.of(np.arange(9) > 5, (("scan.las", 9),))
PLACED = ((1.0, 0.0, 0.0, 2.0), (0.0, 1.0, 0.0, 3.0), (0.0, 0.0, 1.0, 1.5), (0.0, 0.0, 0.0, 1.0))
OTHERS: dict[type, dict[str, object]] = {
    Box: {"axes": ((0.0, 1.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)), "centre": (1.0, 0.0, 0.0), "half": (1.0, 2.0, 4.0)},
    Slab: {"normal": (0.0, 1.0, 0.0), "centre": (1.0, 0.0, 0.0)},
    Edits: {"clips": (BOX,), "hidden_stations": (1,), "up": (0.0, 1.0, 0.0), "look": Look(exposure=1.0),
                  "ghosts": GHOSTS[1], "hidden_classes": (2,), "regions": (Region("", SOME, shown=False),),
                  "reclassified": (ClassChange(6, SOME),), "selection": SOME,
                  "comparison": DateComparison(("a.las", 9), ("b.las", 8)), "meshes": (MeshLayer("hall.obj"),),
                  "photographs": (PlacedPhotograph("a.jpg", "a", 640, 480, 500.0, PLACED, 0.8, 90),)},
    Look: {"colour_by": next(name for name in COLOUR_BY if name != "rgb"), "ramp": tuple(RAMPS)[1]},
}
"""Another value of a field where :func:`other` cannot tell one."""


def other(part, name: str):
    """A value of a field of a dataclass that is not its present one."""
    if name in OTHERS.get(type(part), {}):
        return OTHERS[type(part)][name]
    value = getattr(part, name)
    if name in CHOICES:
        return next(choice for choice in CHOICES[name] if choice != value)
    if isinstance(value, bool):
        return not value
    if isinstance(value, int):
        return value + 1
    if isinstance(value, float):
        return value + 0.5 if value < 1 else value / 2
    if isinstance(value, str):
        return value + " 2"
    hint = str(typing.get_type_hints(type(part))[name])
    if value is None:
        return 2 if "int" in hint else 2.0 if "float" in hint else "other"
    if isinstance(value, tuple) and value and isinstance(value[0], (int, float)):
        return (value[0] + 0.25, *value[1:])
    raise AssertionError(f"{type(part).__name__}.{name} = {value!r}: give this test another value in OTHERS")


def flips(part):
    """(name, the part with this field changed), for every field."""
    for each in dataclasses.fields(part):
        yield each.name, dataclasses.replace(part, **{each.name: other(part, each.name)})


def drawn():
    made, clock = session()
    clock.now += 1.0
    made.advance()
    made.drew(made.screen.full_plan, frame_cost())
    made.picture.adaptive_lod.keep_up = False
    assert not made.screen.needs_picture
    return made


@pytest.mark.parametrize("name", [each.name for each in dataclasses.fields(Edits)])
def test_every_edit_is_a_field_of_the_document_and_draws_a_new_picture(name):
    made = drawn()
    if name == "ghosts":  # passers-by are shown until they are marked
        assert made.scene is not None
        made.shown_scan.scene = dataclasses.replace(made.scene, marked=object())
    if name == "comparison":  # it is shown once its levels are there
        assert made.scene is not None
        made.work.changes = PointLevels(np.zeros(made.scene.count, np.uint8), None)
        made.advance()
        made.drew(made.screen.full_plan, frame_cost())
    value = other(made.document.edits, name)
    made.work.edit("change", **{name: value})
    assert made.screen.needs_picture and getattr(made.spec.edits, name) == value
    made.advance()
    made.drew(made.screen.full_plan, frame_cost())
    assert not made.screen.needs_picture
    made.work.undo()
    assert made.screen.needs_picture, "undo draws as well"
    made.advance()
    assert made.picture.dirty, "and refinement starts again"


@pytest.mark.parametrize("part", (BOX, SLAB, Look()), ids=lambda part: type(part).__name__)
def test_every_field_of_a_clip_and_of_the_look_draws_a_new_picture(part):
    for name, changed in flips(part):
        made = drawn()
        for value in (part, changed):
            made.work.edit("change", **({"look": value} if isinstance(part, Look) else {"clips": (value,)}))
            if value is part:
                made.drew(made.screen.full_plan, frame_cost())
                assert not made.screen.needs_picture
        assert made.screen.needs_picture, name


def test_every_setting_draws_a_new_picture():
    for name, changed in flips(drawn().view_settings.settings):
        made = drawn()
        made.view_settings.settings = changed
        assert made.screen.needs_picture, name


def test_every_field_of_the_description_makes_another_one_and_only_three_are_composed():
    spec = dataclasses.replace(drawn().spec, views=tuple(VIEWS)[1:3])
    for each in dataclasses.fields(PictureSpec):
        if each.name == "camera":
            changed = dataclasses.replace(spec, camera=spec.camera.resized(30, 20))
        elif each.name == "settings":
            changed = dataclasses.replace(spec, settings=dict(flips(spec.settings))["filter"])
        elif each.name == "edits":
            changed = dataclasses.replace(spec, edits=Edits(clips=(BOX,)))
        elif each.name == "other_edits":
            changed = dataclasses.replace(spec, other_edits=spec.edits)
        elif each.name == "side_names":
            changed = dataclasses.replace(spec, side_names=("before", "after"))
        elif each.name == "views":
            changed = dataclasses.replace(spec, views=tuple(VIEWS)[:1])
        elif each.name == "background":
            changed = dataclasses.replace(spec, background=next(name for name in BACKGROUNDS if name != spec.background))
        else:
            changed = dataclasses.replace(spec, **{each.name: other(spec, each.name)})
        assert changed != spec and hash(changed) != hash(spec), each.name
        assert changed.renders_as(spec) == (each.name in ("background", "split_at", "side_names")), each.name


def test_a_camera_that_was_moved_behind_the_window_s_back_is_drawn():
    made = drawn()
    made.flight.field_of_view += 1.0
    assert made.screen.needs_picture
    made = drawn()
    made.flight.state = dataclasses.replace(made.flight.state, position=made.flight.state.position + np.array([0.1, 0.0, 0.0]))
    assert made.screen.needs_picture


def test_what_is_not_drawn_makes_no_picture():
    made = drawn()
    for name in ("measurements", "viewpoints", "annotations"):
        assert name in {each.name for each in dataclasses.fields(Document)}
    made.work.edit("note", annotations=())
    assert not made.screen.needs_picture
