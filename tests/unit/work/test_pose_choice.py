"""Which of several poses that features agree with is taken for that of a photograph: the rule, on invented poses."""

import numpy as np
import pytest

from pointglass.viewer.work.photo_poses import pose_search
from pointglass.viewer.work.photo_poses.pose_search import FoundPose, NotFound, find_pose
from pointglass.viewer.work.photo_poses.pose_solver import SolvedPose


def placed(features, pose: SolvedPose) -> pose_search.Agreeing:
    """As if each feature that the pose names agreed with it."""
    return pose_search.Agreeing(pose, features.chosen(pose.consistent), np.zeros((len(pose.consistent), 3)))


@pytest.mark.parametrize(("within", "share", "uncertain"), [
    ((0.05, 0.005), 0.4, False), ((0.07, 0.005), 0.4, True), ((0.05, 0.01), 0.4, True), ((0.05, 0.005), 0.2, True),
])  # fmt: skip
def test_a_pose_is_called_uncertain_where_its_error_may_be_large_or_few_matches_agree(monkeypatch, within, share, uncertain):
    pose = SolvedPose(np.eye(3), np.zeros(3), 400.0, np.arange(900), 0.6, (0.001, 1e-4, 1e-3), within, 3.0, share)
    spread = np.random.default_rng(0).uniform(0, 1, (900, 2)) * (640, 480)
    monkeypatch.setattr(pose_search, "features_of", lambda *_: pose_search.Features(spread, np.zeros((900, 128), np.float32)))
    monkeypatch.setattr(pose_search, "_first_poses", lambda *_: iter([pose]))
    monkeypatch.setattr(pose_search, "_looked_again", lambda *given: placed(given[2], given[4]))
    found = find_pose(lambda _: None, lambda _: 0.8, [], np.zeros(3), np.zeros((480, 640, 3), np.uint8), (640, 480), "x", 400.0)
    assert isinstance(found, FoundPose) and found.uncertain == uncertain
    assert np.isfinite(found.within).all() == (share > 0.25)


@pytest.mark.parametrize(("places", "said"), [
    ([(900, 0.8)], None), ([(900, 0.3)], "colours"), ([(900, 0.25), (500, 0.7)], None),
    ([(1400, 0.72), (1000, 0.6)], "ambiguous"), ([(1200, 0.65), (500, 0.6)], None), ([(20, 0.9)], "only 20"),
    ([(1349, 0.51), (1200, 0.48)], "ambiguous"), ([(1200, 0.42), (1000, 0.51)], "ambiguous"),
    ([(1300, 0.27), (1200, 0.61)], None), ([(1436, 0.74), (1200, 0.55)], None), ([(1500, 0.55), (700, 0.75)], "ambiguous"),
])  # fmt: skip
def test_colours_decide_and_places_that_look_alike_are_refused(monkeypatch, seed, places, said):
    rng = np.random.default_rng(seed)
    order = rng.permutation(len(places))  # they are found in any order
    poses = [SolvedPose(np.eye(3), np.array([-10.0 * k, 0, 0]), 400.0, np.arange(places[k][0]), 0.6, (0.001, 1e-4, 1e-3))
             for k in order]
    spread = rng.uniform(0, 1, (2000, 2)) * (640, 480)
    monkeypatch.setattr(pose_search, "features_of", lambda *_: pose_search.Features(spread, np.zeros((2000, 128), np.float32)))
    monkeypatch.setattr(pose_search, "_first_poses", lambda *_: iter(poses))
    monkeypatch.setattr(pose_search, "_looked_again", lambda *given: placed(given[2], given[4]))
    found = find_pose(lambda _: None, lambda camera: places[round(camera.position[0] / 10)][1], [], np.zeros(3),
                      np.zeros((480, 640, 3), np.uint8), (640, 480), "x", 400.0)  # fmt: skip
    if said is None:
        right = max(range(len(places)), key=lambda k: places[k][1])
        assert isinstance(found, FoundPose) and found.matches == places[right][0]
    else:
        assert isinstance(found, NotFound) and said in found.why
