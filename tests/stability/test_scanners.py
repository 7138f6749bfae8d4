"""Scans that say where their scanners stood, at any scale and origin, wherever the scanners and the eye are."""

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
    """What the other tests rely on: all points alike, or one scanner where another stood, is no picture near the truth."""
    scan, eye = station_claims.scanned(seed), view_inside(seed, SIZE)
    turned = station_claims.scene_of(scan.xyz, scan.rgb, scan.scan, scan.places[[1, 2, 0]])
    for made in (renderers.pictures(scan.scene, eye, Settings(stations="equal")), renderers.pictures(turned, eye)):
        assert scan.agreement(made, eye).filled < station_claims.LEAST - 4
    assert scan.agreement(renderers.pictures(scan.scene, eye), eye).filled >= station_claims.LEAST
