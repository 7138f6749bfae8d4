"""The virtual scanner over RGB-D panoramas: exact where a pixel is, spoiled as an instrument spoils, people in one station."""

import numpy as np
import pytest
from rooms import make_room

from pointglass.model.data.stations import instrument_scan, load_scene, panorama
from pointglass.model.synth.panorama import Passer, from_z_up, to_z_up, with_passers
from pointglass.model.synth.scanner import IDEAL, ScannerModel, VirtualScanner

BOX = np.array([2.0, 1.5, 2.5])  # half sides of tests/unit/rooms.py's room, y up


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return load_scene(make_room(tmp_path_factory.mktemp("room") / "box", face=96))


def _station(scene, number, model, seed=0, passers=(), pulses=40_000):
    faces = scene.stations[number]
    seen = panorama(faces)
    position = to_z_up(faces[0].camera_to_world[:3, 3], "y")
    scanner = VirtualScanner(with_passers(seen.trace, list(passers)), model, snap=seen.snap)
    xyz, rgb, *_ = scanner.station(position, pulses, np.random.default_rng(seed), 1.0, 0)
    return xyz, rgb, position


def test_up_goes_there_and_back():
    v = np.random.default_rng(0).normal(size=(20, 3))
    for up in "yz":
        assert np.array_equal(from_z_up(to_z_up(v, up), up), v)
    assert np.array_equal(to_z_up(np.array([0.0, 1.0, 0.0]), "y"), [0, 0, 1])
    assert np.linalg.det(to_z_up(np.eye(3), "y")) == pytest.approx(1)


@pytest.mark.parametrize("number", [0, 1])
def test_an_ideal_instrument_hits_the_walls_and_takes_each_pixel_once(scene, number):
    xyz, rgb, _ = _station(scene, number, IDEAL)
    world = from_z_up(xyz, "y")
    assert np.abs(np.abs(world / BOX).max(1) - 1).max() < 2e-3  # depth files are in millimetres
    assert len(np.unique(np.round(world, 7), axis=0)) == len(world) > 20_000
    rest = rgb - np.trunc(60 + 30 * np.sin(world * 3))  # what the checker adds: 0 or 120
    fits = (np.minimum(np.abs(rest), np.abs(rest - 120)) < 4).all(1)
    assert fits.mean() > 0.97
    shuffled = rgb - np.trunc(60 + 30 * np.sin(world[::-1] * 3))
    assert (np.minimum(np.abs(shuffled), np.abs(shuffled - 120)) < 4).all(1).mean() < 0.3


def test_normals_face_the_scanner_and_are_the_walls(scene):
    seen = panorama(scene.stations[0])
    rays = np.random.default_rng(1).normal(size=(5000, 3))
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    hits = seen.trace(np.zeros((5000, 3)), rays)
    assert (np.einsum("ij,ij->i", hits.normal, rays) < 0).mean() > 0.98
    assert (np.abs(hits.normal).max(1) > 0.99).mean() > 0.9


def test_the_vertical_field_is_limited_and_noise_grows_at_grazing_angles(scene):
    model = ScannerModel(lowest=-50, highest=60, divergence=0, dropout=0, colour_noise=0, noise=0.004, grazing=2.0)
    xyz, _, position = _station(scene, 0, model)
    ray = xyz - position
    elevation = np.degrees(np.arcsin(ray[:, 2] / np.linalg.norm(ray, axis=1)))
    assert elevation.min() > -51.5 and elevation.max() < 61.5
    length, start = np.linalg.norm(ray, axis=1), from_z_up(position, "y")
    way = from_z_up(ray, "y") / length[:, None]
    reach = (np.sign(way) * BOX - start) / way  # to each pair of walls, along the ray
    noise, cosine = length - reach.min(1), np.abs(way[np.arange(len(way)), reach.argmin(1)])
    straight, grazing = noise[cosine > 0.8].std(), noise[cosine < 0.45].std()
    assert 0.003 < straight < 0.008 and grazing > 2.5 * straight


def test_people_stand_in_the_station_that_saw_them_and_hide_what_is_behind(scene):
    _, _, position = _station(scene, 0, IDEAL)
    person = Passer(position + (0.8, 0.3, -1.0), 1.4, 0.2, np.array([0.6, 0.1, 0.1]))
    xyz, rgb, _ = _station(scene, 0, IDEAL, passers=[person])
    on = np.abs(np.linalg.norm(xyz[:, :2] - person.foot[:2], axis=1) - 0.2) < 1e-6
    assert on.sum() > 200 and (rgb[on] == np.round(person.colour * 255)).all()
    assert (xyz[on, 2] >= person.foot[2]).all() and (xyz[on, 2] <= person.foot[2] + 1.4).all()
    empty, *_ = _station(scene, 0, IDEAL)
    assert len(empty) == len(xyz)  # a person takes the returns of what is behind, none is added


def test_an_instruments_scan_is_seeded_and_lies_on_the_room(scene):
    a, b, c = instrument_scan(scene, 3), instrument_scan(scene, 3), instrument_scan(scene, 4)
    assert np.array_equal(a.xyz, b.xyz) and np.array_equal(a.rgb, b.rgb) and len(a.xyz) != len(c.xyz)
    assert set(np.unique(a.station)) == {0, 1} and a.rgb.dtype == np.uint8
    inside = (np.abs(a.xyz) < BOX + 0.05).all(1).mean()
    on_wall = (np.abs(np.abs(a.xyz / BOX).max(1) - 1) < 0.02).mean()
    assert inside > 0.99 and on_wall > 0.75
