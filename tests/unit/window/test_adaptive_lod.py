"""The pace: how many points are drawn while flying and at rest, so that a session keeps up."""

import pytest
from window_session import finish, frame_cost, session

from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.window.panels.status_bar import _columns
from pointglass.viewer.window.planning.adaptive_lod import AdaptiveLod


def test_a_slow_network_flies_filled_and_repaints_at_rest():
    made, clock = session()
    made.view_settings.show("neural")
    finish(made)
    made.drew(made.screen.plan, frame_cost(network=900.0))
    clock.now += 1
    made.flight.held.add("forward")
    made.advance()
    clock.now += 0.1
    made.advance()
    assert made.screen.plan.views == ("filled",)
    made.drew(made.screen.plan, frame_cost())
    assert "filled while moving" in made.screen.approximations
    made.flight.held.clear()
    for _ in range(200):
        clock.now += 1 / 60
        made.advance()
    assert made.screen.plan.views == ("neural",) and made.screen.plan.deferred and made.screen.needs_picture
    made.picture.adaptive_lod.keep_up = False
    made.flight.held.add("forward")
    assert made.screen.plan.views == ("filled",), "the window never waits for a slow network"


def test_a_network_runs_beside_the_flight_only_where_whole_pictures_leave_it_time():
    lod = AdaptiveLod(target_ms=60.0)
    assert not lod.spare, "nothing is known yet"
    lod.drew(None, frame_cost(total_ms=40.0, raster=10.0, move=9.0), moving=True)
    assert lod.spare
    lod.drew(None, frame_cost(total_ms=50.0, raster=10.0, move=9.0), moving=True)
    assert not lod.spare
    lod.drew(8.0, frame_cost(total_ms=30.0, raster=10.0, move=9.0), moving=True)
    assert not lod.spare, "points are left out"
    lod.drew(None, frame_cost(total_ms=90.0, raster=10.0), moving=True)
    lod.drew(None, frame_cost(total_ms=30.0, raster=10.0), moving=True)
    assert lod.scale(moving=True) == 0.5 and not lod.spare, "pixels are left out"


def test_photographs_colour_a_flight_only_while_whole_pictures_have_time_for_them():
    lod = AdaptiveLod(target_ms=60.0)
    assert lod.photographs
    lod.drew(None, frame_cost(total_ms=70.0, raster=10.0, photographs=30.0), moving=True)
    assert lod.photographs and lod.scale(moving=True) == 1.0
    lod.drew(None, frame_cost(total_ms=90.0, raster=10.0, photographs=30.0), moving=True)
    assert not lod.photographs and lod.scale(moving=True) == 1.0, "they go before pixels do"
    for _ in range(80):
        lod.drew(None, frame_cost(total_ms=40.0, raster=10.0), moving=True)
        assert not lod.photographs, "with them a picture would take 70 ms"
    lod.drew(None, frame_cost(total_ms=20.0, raster=10.0), moving=True)
    assert lod.photographs


def test_the_picture_at_rest_gets_the_photographs_that_the_flight_left_out():
    made, clock = session()
    made.view_settings.show("filled")
    finish(made)
    made.drew(made.screen.plan, frame_cost())
    clock.now += 1
    made.flight.held.add("forward")
    made.advance()
    for _ in range(2):
        made.drew(made.screen.plan, frame_cost(total_ms=200.0, raster=1.0, photographs=30.0))
    assert not made.screen.plan.photographs
    made.drew(made.screen.plan, frame_cost(total_ms=10.0, raster=1.0))
    assert "no colours of photographs while moving" in made.screen.approximations
    made.flight.held.clear()
    for _ in range(200):
        clock.now += 1 / 60
        made.advance()
    assert made.screen.plan.photographs and made.screen.needs_picture


def test_the_status_bar_warns_of_what_is_left_out_and_not_of_what_the_settings_ask_for():
    made, clock = session()
    made.view_settings.show("neural")
    finish(made)
    half = "network in bf16"
    made.drew(made.screen.plan, frame_cost(network=900.0, facts={"approximations": (half,)}))
    at_rest = _columns(made, None)[3]
    assert made.screen.exact and not at_rest.warn and at_rest.text == "at rest" and half in at_rest.explained
    clock.now += 1
    made.flight.held.add("forward")
    made.advance()
    made.drew(made.screen.plan, frame_cost())
    made.picture.moved = 0.876
    flown = _columns(made, None)[3]
    assert flown.warn and flown.text == "moving, approximate"
    assert "88 % moved from the last neural picture, the rest filled while moving" in flown.explained


def test_while_the_window_is_being_resized_the_network_waits():
    """On a GPU it is made ready for every size anew; what is dragged passes through many."""
    made, clock = session()
    made.view_settings.show("neural")
    finish(made)
    made.drew(made.screen.plan, frame_cost(network=5.0))
    clock.now += 1
    for width in (650, 660, 670):
        made.resize((width, 400))
        assert made.screen.needs_picture and made.screen.plan.views == ("filled",)
        made.drew(made.screen.plan, frame_cost())
        clock.now += 0.1
    assert 0 < made.next_change() < 0.21 and not made.screen.needs_picture  # type: ignore[operator]
    clock.now += 0.25
    assert made.screen.needs_picture and made.screen.plan.views == ("neural",)
    made.drew(made.screen.plan, frame_cost(network=5.0))
    assert made.next_change() is None and not made.screen.needs_picture


def neural(**costs):
    """A session that shows the neural view and has learned from pictures at rest how long networks take."""
    made, clock = session()
    made.view_settings.show("neural")
    finish(made)
    for name, milliseconds in costs.items():
        made.picture.adaptive_lod.ran_network(name, milliseconds)
    made.drew(made.screen.plan, frame_cost())
    clock.now += 1
    made.flight.held.add("forward")
    return made, clock


def moved(made, clock, **cost):
    """One moving picture with a network's time in its stages where it has one; returns its plan."""
    clock.now += 0.05
    made.advance()
    plan = made.screen.plan
    assert plan.moving
    network = {} if plan.network is None else {"network": cost[plan.network]}
    made.drew(plan, frame_cost(raster=5.0, **network, total_ms=cost["rest"] + sum(network.values())))
    return plan


def test_a_smaller_network_flies_where_the_one_asked_for_is_too_slow():
    made, clock = neural(balanced=50.0)
    for _ in range(5):
        plan = moved(made, clock, rest=20.0, fast=25.0)
        assert plan.network == "fast" and plan.views == ("neural",) and plan.scale == 1.0 and not plan.deferred
    assert made.screen.smaller_network == "fast" and "the fast network while moving" in made.screen.approximations
    assert not made.screen.exact
    made.flight.held.clear()
    for _ in range(200):
        clock.now += 1 / 60
        made.advance()
    plan = made.screen.plan
    assert plan.network == "balanced" and made.screen.needs_picture, "full quality at rest"
    made.drew(plan, frame_cost(network=50.0))
    assert made.screen.smaller_network is None and not made.screen.needs_picture


def test_the_network_goes_before_the_resolution_and_comes_back_only_later():
    made, clock = neural(balanced=30.0)
    assert moved(made, clock, rest=70.0, balanced=30.0).network == "balanced", "it is fast enough by itself"
    for _ in range(40):
        plan = moved(made, clock, rest=70.0)
        assert plan.network is None and plan.views == ("filled",) and plan.scale == 1.0, "the frame as a whole was too slow"
    networks = [moved(made, clock, rest=70.0, balanced=30.0).network for _ in range(40)]
    assert networks.count("balanced") == 1, f"tried again once: {networks}"


def test_at_a_lower_resolution_no_network_runs():
    made, clock = neural(balanced=600.0, fast=300.0)
    for _ in range(3):
        moved(made, clock, rest=200.0)
    made.picture.adaptive_lod.ran_network("fast", 5.0)
    assert moved(made, clock, rest=60.0).scale == 0.5
    assert made.screen.plan.network is None


def test_a_resolution_that_was_too_slow_is_tried_again_after_a_while_and_points_do_not_count_as_pixels():
    made, clock = neural(balanced=600.0)
    scales = []
    for _ in range(200):  # 40 ms of points at any resolution, 10 ms of filter and fill at half
        clock.now += 0.05
        made.advance()
        plan = made.screen.plan
        scales.append(plan.scale)
        made.drew(plan, frame_cost(raster=30.0, total_ms=30.0 + 40.0 * plan.scale**2 + (80.0 if len(scales) == 3 else 0.0)))
    assert scales[:3] == [1.0] * 3 and scales[3] == 0.5, "one slow frame lowers it"
    assert scales[-1] == 0.5, "70 ms at full resolution would miss the target"
    made, clock = neural(balanced=600.0)
    scales = []
    for _ in range(100):
        clock.now += 0.05
        made.advance()
        plan = made.screen.plan
        scales.append(plan.scale)
        made.drew(plan, frame_cost(raster=30.0, total_ms=30.0 + 20.0 * plan.scale**2 + (80.0 if len(scales) == 3 else 0.0)))
    assert scales[-1] == 1.0 and scales.count(0.5) > 30, "50 ms do not: it comes back, but not at once"


def test_where_points_take_all_the_time_they_become_fewer_and_the_resolution_stays():
    """As in the raw view, which has no stages that cost by the pixel."""
    made, clock = session()
    made.flight.held.add("forward")
    plans = []
    for _ in range(40):
        clock.now += 0.05
        made.advance()
        plan = made.screen.plan
        plans.append(plan)
        spent = min(300.0, 20.0 * (plan.level or 1e9))
        made.drew(plan, frame_cost(raster=spent, total_ms=spent + 1.0, points_drawn=spent))
    assert {plan.scale for plan in plans} == {1.0} and 20.0 * plans[-1].level <= 66.0


def test_own_weights_have_no_smaller_network(tmp_path):
    made, _ = session(settings=Settings(view="filled", weights=str(tmp_path / "own.safetensors")))
    assert made.view_settings.networks == ("balanced",)
    for quality, expected in (("fast", ("fast",)), ("best", ("best", "balanced", "fast"))):
        made, _ = session(settings=Settings(view="filled", quality=quality))
        assert made.view_settings.networks == expected


def fly(made, clock, raster, *, frames=40, hidden=None):
    """Moves for some frames whose raster stage takes ``raster(level)`` milliseconds; returns the levels drawn with."""
    levels = []
    made.flight.held.add("forward")
    for _ in range(frames):
        clock.now += 0.05
        made.advance()
        plan = made.screen.plan
        assert plan.moving
        levels.append(plan.level)
        made.drew(plan, frame_cost(raster=raster(plan.level), hidden=hidden))
    made.flight.held.clear()
    while made.flight.state.moving:
        clock.now += 0.05
        made.advance()
        made.drew(made.screen.plan, frame_cost(raster=raster(made.screen.plan.level)))
    return levels


def rest(made, clock, raster, points=lambda level: level or 1e9):
    """Draws what is asked for at rest, at most 50 pictures; returns their levels."""
    clock.now += 1.0
    made.advance()
    levels = []
    while made.screen.needs_picture and len(levels) < 50:
        plan = made.screen.plan
        levels.append(plan.level)
        made.drew(plan, frame_cost(raster=raster(plan.level), points_drawn=points(plan.level)))
    assert not made.screen.needs_picture and made.next_change() is None, "at rest nothing is drawn for ever, nor waited for"
    return levels


def test_where_drawing_is_quick_nothing_is_left_out():
    made, clock = session()
    assert set(fly(made, clock, lambda level: 12.0)) == {None}


@pytest.mark.parametrize("per_point", [5.0, 12.0, 30.0])
def test_points_a_pixel_settle_while_moving_and_all_come_back_at_rest(per_point):
    made, clock = session()
    cost = lambda level: min(400.0, per_point * (level or 1e9))  # noqa: E731
    levels = fly(made, clock, cost)
    settled = levels[-20:]
    assert len(set(settled)) == 1 and cost(settled[0]) <= 60.0, f"no swinging to and fro: {levels}"
    levels = rest(made, clock, cost, points=lambda level: cost(level) / per_point)
    assert levels[-1] is None and levels[:-1] == sorted(levels[:-1]), "finer and finer, then every point"
    assert fly(made, clock, cost, frames=3)[0] == settled[0], "the next flight begins where this one settled"


def test_what_the_host_takes_to_prepare_a_picture_counts_where_the_gpu_is_quicker():
    made, clock = session()
    made.flight.held.add("forward")
    levels = []
    for _ in range(40):
        clock.now += 0.05
        made.advance()
        plan = made.screen.plan
        levels.append(plan.level)
        made.drew(plan, frame_cost(raster=2.0, host={"raster": min(400.0, 12.0 * (plan.level or 1e9))}))
    assert levels[-1] is not None and 12.0 * levels[-1] <= 60.0


def test_points_are_not_left_out_where_that_saves_nothing():
    made, clock = session()
    made.flight.held.add("forward")
    levels = []
    for _ in range(30):  # 90 ms whatever is drawn, as where the picture's size decides
        clock.now += 0.05
        made.advance()
        plan = made.screen.plan
        levels.append(plan.level)
        points = int(min(1e6, 1e5 * (plan.level or 1e9)))
        made.drew(plan, frame_cost(raster=90.0, points_drawn=points))
    assert levels[-1] == 16.0 or levels[-1] == 8.0, f"as many points as before anything was gained: {levels}"


def test_at_rest_a_picture_that_would_take_too_long_is_not_begun():
    made, clock = session()
    cost = lambda level: 1e6 if level is None else 100.0 * level  # noqa: E731
    made.picture.adaptive_lod.begin(10**9)
    assert made.screen.plan.level == 1.0, "a huge scene begins coarse"
    fly(made, clock, cost)
    levels = rest(made, clock, cost)
    assert None not in levels and max(map(cost, levels)) <= 2000.0 < 4 * cost(levels[-1])
    made.picture.adaptive_lod.keep_up = False
    assert made.screen.plan.level is None, "unless that is asked for"


def test_points_that_do_not_grow_in_number_are_all_there_are():
    made, clock = session()
    made.picture.adaptive_lod.begin(10**9)
    levels = rest(made, clock, lambda level: 50.0, points=lambda level: min(level or 1e9, 10.0))
    assert levels == [1.0, 4.0, 16.0, 64.0, None]


def test_no_finer_picture_is_asked_for_while_points_are_on_their_way():
    made, clock = session()
    made.picture.adaptive_lod.begin(10**8)
    clock.now += 1.0
    made.advance()
    for points in (1e5, 2e5, 2e5, 5e5):  # the third: nothing has come since
        assert made.screen.plan.level == 1.0
        made.drew(made.screen.plan, frame_cost(raster=40.0, points_drawn=points, points_missing=10))
        assert not made.screen.needs_picture
        made.picture.dirty = True  # as whoever hears of more does
    assert rest(made, clock, lambda level: 100.0 * (level or 1e4))[:2] == [1.0, 4.0]


def test_a_level_of_ones_own_is_never_exceeded():
    made, clock = session(settings=Settings(view="filled", lod=2.0))
    cost = lambda level: 40.0 * level  # noqa: E731
    assert max(fly(made, clock, cost)) == 2.0
    assert rest(made, clock, cost)[-1] == 2.0


def test_hidden_cells_are_looked_for_only_where_it_pays_and_never_left_out_at_rest():
    made, clock = session()
    made.drew(made.screen.plan, frame_cost())
    fly(made, clock, lambda level: 10.0, frames=5, hidden=9)
    made.flight.held.add("forward")
    assert made.screen.plan.hides
    made.drew(made.screen.plan, frame_cost(raster=10.0, hidden=9))
    made.flight.held.clear()
    assert made.next_change() is not None
    clock.now += 1.0
    assert made.screen.needs_picture and not made.screen.plan.hides
    made.drew(made.screen.plan, frame_cost())
    clock.now += 1.0
    made.flight.held.add("forward")
    for hides in (True, False):  # the first frame of a flight knows of nothing that hides
        clock.now += 0.05
        made.advance()
        made.drew(made.screen.plan, frame_cost(raster=10.0, hidden=0))
        assert made.screen.plan.hides == hides
    fly(made, clock, lambda level: 10.0, frames=100)
    made.flight.held.add("forward")
    assert made.screen.plan.hides, "tried again later"
