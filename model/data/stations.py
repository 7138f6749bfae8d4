"""Registered rooms: panoramas taken at scanner stations, and true views taken elsewhere in the same room.

A scene folder holds ``scene.json`` with ``stations`` (six cube faces each: colour and z-depth) and ``views`` (and perhaps
``path``: a slow camera move).  Every pixel of a station face is a possible laser return, so the stations give a
point cloud, and the views give what the network should make of it.  World frame: the file's, metres, y up; camera
frames are OpenGL's (x right, y up, -z forward).
"""

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image

from model.data.dataset import FAR, MAX_FOCAL, DataError, Scan
from model.data.photos import wrong_pictures
from model.synth.panorama import FACES, Panorama, Passer, from_z_up, to_z_up, with_passers
from model.synth.scanner import ScannerModel, VirtualScanner


@dataclass(frozen=True)
class Shot:
    """One picture with depth and pose.  fl: pixels; the principal point is the centre of the picture."""

    folder: Path
    rgb_file: str
    depth_file: str
    width: int
    height: int
    fl: float
    camera_to_world: np.ndarray
    depth_scale: float

    @property
    def cx(self) -> float:
        return self.width / 2

    @property
    def cy(self) -> float:
        return self.height / 2

    def coverage(self) -> None:
        """A room covers every pixel."""
        return None

    def known(self) -> None:
        """All of the picture is true."""
        return None

    def rgb(self) -> np.ndarray:
        """(H, W, 3) uint8, sRGB."""
        return np.asarray(Image.open(self.folder / self.rgb_file).convert("RGB"))

    def depth(self) -> np.ndarray:
        """(H, W) float32 z-depth in metres, +inf where nothing returned."""
        stored = np.asarray(Image.open(self.folder / self.depth_file)).astype(np.float32)
        return np.where(stored > 0, stored / np.float32(self.depth_scale), np.float32(np.inf))


@dataclass(frozen=True)
class StationScene:
    """A scene folder: ``stations`` is a list of six-face lists, ``views`` and ``path`` are lists of shots."""

    name: str
    stations: list[list[Shot]]
    views: list[Shot]
    path: list[Shot] = field(default_factory=list)

    def scan(self, seed: int) -> Scan:
        """The merged scan of the stations, spoiled with this seed: every pixel a return, or INSTRUMENT_SHARE of the time as an
        instrument samples them; in WIDE_SHARE of the scans with exposures far apart."""
        kind = np.random.default_rng([seed, 1]).random(2)
        model = WIDE if kind[0] < WIDE_SHARE else ScanModel()
        return instrument_scan(self, seed, model) if kind[1] < INSTRUMENT_SHARE else scan_stations(self, seed, model)


def _shot(folder: Path, entry: dict, scale: float) -> Shot:
    """Raises KeyError, TypeError or ValueError, saying what is wrong, where an entry is no picture with a camera."""
    made = Shot(folder, str(entry["rgb"]), str(entry["depth"]), int(entry["w"]), int(entry["h"]), float(entry["fl"]),
                np.asarray(entry["camera_to_world"], np.float64).reshape(4, 4), scale)
    turn = made.camera_to_world[:3, :3]
    if not ((np.abs(made.camera_to_world) < FAR).all() and np.allclose(turn @ turn.T, np.eye(3), atol=1e-2)):
        raise ValueError(f"{made.rgb_file}: camera_to_world is no rotation and shift")
    if not (0 < made.fl < MAX_FOCAL and made.width > 0 and made.height > 0):
        raise ValueError(f"{made.rgb_file}: {made.width}x{made.height} pixels, fl {made.fl:g}: not a camera")
    return made


def load_scene(folder: Path) -> StationScene:
    """Reads ``scene.json``.  Every picture it names must be there, be readable and have the size it says.

    DataError names the first ten files that are not so, each with what is wrong, or what in ``scene.json`` is no scene.
    """
    folder = Path(folder)
    try:
        data = json.loads((folder / "scene.json").read_text())
        scale = float(data["depth_scale"])
        if not 0 < scale < np.inf:
            raise ValueError(f"depth_scale {scale:g}: expected the steps of a depth picture in a metre")

        def shot(entry: dict) -> Shot:
            return _shot(folder, entry, scale)

        scene = StationScene(
            str(data.get("scene", folder.name)),
            [[shot(face) for face in station["faces"]] for station in data["stations"]],
            [shot(view) for view in data["views"]],
            [shot(view) for view in data.get("path", [])],
        )
        alike = all(len(faces) == FACES and len({(f.width, f.height, f.fl) for f in faces}) == 1 for faces in scene.stations)
        if not (scene.stations and alike):
            raise ValueError(f"stations of {FACES} faces of one size and focal length are needed")
    except FileNotFoundError:
        raise DataError(f"{folder}: {'no scene.json in this folder' if folder.exists() else 'no such folder'}") from None
    except (OSError, KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        said = error if isinstance(error, (OSError, ValueError)) else repr(error)
        raise DataError(f"{folder / 'scene.json'}: not a scene description ({said})") from None
    shots = [*(face for station in scene.stations for face in station), *scene.views, *scene.path]
    pictures = dict.fromkeys((folder / name, (s.width, s.height)) for s in shots for name in (s.rgb_file, s.depth_file))
    if wrong := wrong_pictures(folder, pictures, [folder / s.depth_file for s in shots]):
        raise DataError(f"{folder}: {len(wrong)} pictures named in scene.json cannot be used: {'; '.join(wrong[:10])}")
    if not any(np.isfinite(face.depth()).any() for faces in scene.stations for face in faces):
        raise DataError(f"{folder}: the depth pictures of its stations hold no return (all 0); write metres x depth_scale")
    return scene


def shot_points(shot: Shot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Every pixel of a picture that returned, as points.

    Returns xyz (N, 3) float64 world, rgb (N, 3) uint8, edge (N,) bool: the pixel sits on a depth discontinuity.
    """
    depth = shot.depth().astype(np.float64)
    finite = np.isfinite(depth)
    j, i = np.nonzero(finite)
    z = depth[finite]
    local = np.stack(
        [(i + 0.5 - shot.width / 2) / shot.fl * z, -(j + 0.5 - shot.height / 2) / shot.fl * z, -z], axis=1
    )
    xyz = local @ shot.camera_to_world[:3, :3].T + shot.camera_to_world[:3, 3]
    inverse = np.pad(np.where(finite, 1.0 / depth, 0.0), 1, mode="edge")
    mid = inverse[1:-1, 1:-1]
    bend = [abs(inverse[1:-1, :-2] + inverse[1:-1, 2:] - 2 * mid), abs(inverse[:-2, 1:-1] + inverse[2:, 1:-1] - 2 * mid)]
    edge = np.maximum(*bend) > 0.03 * mid
    return xyz, shot.rgb()[finite], edge[finite]


@dataclass(frozen=True)
class ScanModel:
    """How the stations are turned into a scan, as a real scanner would spoil them.

    exposure: largest gain of a station around 1; the stations' mean gain is 1 (see data/README: a brightness that nothing
    in the scan could tell would otherwise be judged).  range_noise: metres, plus range_noise_relative x range.
    mixed: share of the returns at depth edges that hang between the two surfaces.  dropout: share lost at random.
    """

    exposure: float = 0.12
    white_balance: float = 0.02
    range_noise: float = 0.0008
    range_noise_relative: float = 0.0003
    mixed: float = 0.15
    dropout: float = 0.01
    misregistration: float = 0.001
    colour_noise: float = 1.5


WIDE_SHARE = 0.25
INSTRUMENT_SHARE = 0.3
WIDE = ScanModel(exposure=0.35, white_balance=0.05)
"""Some merged scans have stations half as bright again as others (studio.laz): their points must become one surface."""


def station_gains(model: ScanModel, count: int, rng: np.random.Generator) -> np.ndarray:
    """(count,) exposures whose mean is 1."""
    gains = 1 + model.exposure * rng.uniform(-1, 1, count)
    return gains / gains.mean()


def scan_stations(scene: StationScene, seed: int, model: ScanModel | None = None) -> Scan:
    """The merged scan of all stations of a scene, spoiled by ``model`` with the given seed."""
    model = model or ScanModel()
    rng = np.random.default_rng(seed)
    gains = station_gains(model, len(scene.stations), rng)
    parts = []
    for index, faces in enumerate(scene.stations):
        balance = gains[index] * (1 + model.white_balance * rng.uniform(-1, 1, 3))
        shift = rng.normal(0, model.misregistration, 3)
        for face in faces:
            xyz, rgb, edge = shot_points(face)
            keep = rng.random(len(xyz)) >= model.dropout
            xyz, rgb, edge = xyz[keep], rgb[keep], edge[keep]
            centre = face.camera_to_world[:3, 3]
            ray = xyz - centre
            distance = np.linalg.norm(ray, axis=1)
            spread = model.range_noise + model.range_noise_relative * distance
            scale = 1 + rng.normal(0, 1, len(xyz)) * spread / distance
            hang = edge & (rng.random(len(xyz)) < model.mixed)  # the beam split by an edge returns a range in between
            scale = np.where(hang, scale * (1 + rng.uniform(-0.08, 0.08, len(xyz))), scale)
            noisy = rgb * balance + rng.normal(0, model.colour_noise, rgb.shape)
            parts.append((centre + ray * scale[:, None] + shift, np.clip(np.rint(noisy), 0, 255).astype(np.uint8), index))
    return Scan(
        np.concatenate([p[0] for p in parts]),
        np.concatenate([p[1] for p in parts]),
        np.concatenate([np.full(len(p[0]), p[2], np.uint8) for p in parts]),
        station_places(scene),
    )


def station_places(scene: StationScene) -> np.ndarray:
    """(S, 3) float64: where the stations stood."""
    return np.array([faces[0].camera_to_world[:3, 3] for faces in scene.stations])


UP = "y"  # of the scene folders


def panorama(faces: list[Shot]) -> Panorama:
    """The six faces of a station, in a z-up world."""
    rotations = np.stack([to_z_up(face.camera_to_world[:3, :3].T, UP).T for face in faces])
    depth = np.stack([face.depth() for face in faces]).astype(np.float64)
    return Panorama(rotations, faces[0].fl, depth, np.stack([face.rgb() for face in faces]))


def instrument_scan(scene: StationScene, seed: int, model: ScanModel | None = None) -> Scan:
    """The stations as a terrestrial scanner samples them: its angular grid and limited vertical field, the blind cone under the
    tripod, noise that grows with range and grazing angle, mixed points, dropouts on dark and grazed surfaces, stations a
    few millimetres and hundredths of a degree off, and people who walk by while one station scans.

    model: exposure and white balance are taken from it.
    """
    model = model or ScanModel()
    rng = np.random.default_rng([seed, 2])
    gains = station_gains(model, len(scene.stations), rng)
    instrument = ScannerModel(
        lowest=float(rng.uniform(-65, -50)), highest=float(rng.uniform(70, 90)), white_balance=model.white_balance,
        grazing=float(rng.uniform(0.2, 0.6)), dropout=float(rng.uniform(0.002, 0.02)),
        noise=float(rng.uniform(0.0004, 0.002)), colour_noise=float(rng.uniform(0.3, 1.5)),
    )
    parts = []
    for number, faces in enumerate(scene.stations):
        seen = panorama(faces)
        position = to_z_up(faces[0].camera_to_world[:3, 3], UP)
        passers = _passers(position, rng) if rng.random() < 0.2 else []
        scanner = VirtualScanner(with_passers(seen.trace, passers), instrument, snap=seen.snap)
        # gains here act on sRGB, as in scan_stations; the scanner's own camera is left at 1
        xyz, rgb, _, station, _ = scanner.station(position, int(0.8 * faces[0].width**2 * 6), rng, 1.0, number)
        rgb = np.clip(np.rint(rgb * gains[number]), 0, 255).astype(np.uint8)
        parts.append((from_z_up(xyz, UP), rgb, station))
    xyz, rgb, station = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return Scan(xyz, rgb, station, station_places(scene))


def _passers(position: np.ndarray, rng: np.random.Generator) -> list[Passer]:
    """One or two people on the floor, a few metres from the station."""
    floor = float(position[2]) - 1.5
    people = []
    for _ in range(rng.integers(1, 3)):
        angle, away = rng.uniform(0, 2 * np.pi), rng.uniform(1.2, 3.5)
        foot = np.array([position[0] + away * np.cos(angle), position[1] + away * np.sin(angle), floor])
        clothes = rng.uniform(0.05, 0.7) + rng.uniform(0, 0.2, 3)
        people.append(Passer(foot, float(rng.uniform(1.5, 1.9)), float(rng.uniform(0.15, 0.28)), clothes))
    return people
