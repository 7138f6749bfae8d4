"""Scans that say where their scanners stood, at any scale and origin, wherever the scanners and the eye are."""

import statistics

import numpy as np
import pytest
import station_claims

from pointglass.viewer.bench.cases.stability import view_inside
from pointglass.viewer.picture.settings import Settings

pytestmark = pytest.mark.gl
SIZE = (160, 120)


@pytest.mark.parametrize("origin", [0.0, 1e5, 1e7])
def test_no_scale_and_no_origin_changes_what_points_count(renderers, seed, claims, origin):
    claims(station_claims.anywhere(renderers, seed, SIZE, (1e-3, 1.0, 30.0, 1e6), (origin,)))


def test_powers_of_two_and_shifts_by_whole_cells_change_no_byte(renderers, seed, claims):
    rng = np.random.default_rng(seed)
    claims(station_claims.exactness(renderers, seed, SIZE, rng.integers(-30, 40, 2).tolist(), [int(rng.integers(8, 30))]))


def test_scanners_and_eyes_in_hard_places(renderers, seed, claims):
    claims(station_claims.hard_places(renderers, seed, SIZE))


def test_a_crowd_of_any_weight_keeps_its_mean(renderers, seed, claims):
    claims(station_claims.heavy(renderers, seed))


def test_pictures_of_other_weights_are_far_below_the_limit(renderers, seed):
    """What the other tests rely on: all points alike, or one scanner where another stood, is no picture near the truth.  From a
    single place it may be, where the scanners look alike: of four places, the worst is told."""
    scan = station_claims.scanned(seed)
    turned = station_claims.scene_of(scan.xyz, scan.rgb, scan.scan, scan.places[[1, 2, 0]])
    eyes = [view_inside(seed + number, SIZE) for number in range(4)]
    for scene, settings in ((scan.scene, Settings(stations="equal")), (turned, Settings())):
        found = [scan.agreement(renderers.pictures(scene, eye, settings), eye).filled for eye in eyes]
        assert min(found) < station_claims.LEAST - 4, found
    # A pixel at an edge of near surfaces may show the other one and cost 10 dB: the middle of the four is held.
    right = [scan.agreement(renderers.pictures(scan.scene, eye), eye).filled for eye in eyes]
    assert statistics.median(right) >= station_claims.LEAST, right
