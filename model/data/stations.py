"""Registered rooms: panoramas at scanner stations, and true views from other positions in the same room.

A scene folder contains ``scene.json`` with ``stations`` (six cube faces each, with colour and z-depth) and ``views``, and
optionally ``path``, a slow camera move.  Every pixel of a station's face is a possible laser return, so the stations form a
point cloud, and the views are the ground truth.  World frame: the file's, metres, y up; camera frames are OpenGL's (x right, y
up, -z forward).
"""

import json
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from PIL import Image

from ..common.errors import DataError
from ..synth.panorama import FACES, Panorama, Passer, from_z_up, to_z_up, with_passers
from ..synth.scanner import ScannerModel, VirtualScanner
from .dataset import FAR, MAX_FOCAL, MergedScan, reason
from .images.photos import wrong_pictures


@dataclass(frozen=True)
class RoomView:
    """One picture with depth and pose.  fl: focal length, pixels; the principal point is the centre of the picture."""

    folder: Path
    rgb_file: str
    depth_file: str
    width: int
    height: int
    fl: float
    camera_to_world: np.ndarray
    depth_scale: float

    @property
    def name(self) -> str:
        """Of the picture's file, without its ending."""
        return Path(self.rgb_file).stem

    @property
    def cx(self) -> float:
        return self.width / 2

    @property
    def cy(self) -> float:
        return self.height / 2

    def coverage(self) -> None:
        """None: every pixel is covered."""
        return None

    def known(self) -> None:
        """None: all pixels are valid."""
        return None

    def rgb(self) -> np.ndarray:
        """(H, W, 3) uint8, sRGB."""
        return np.asarray(Image.open(self.folder / self.rgb_file).convert("RGB"))

    def depth(self) -> np.ndarray:
        """(H, W) float32 z-depth, metres, +inf without a return."""
        stored = np.asarray(Image.open(self.folder / self.depth_file)).astype(np.float32)
        return np.where(stored > 0, stored / np.float32(self.depth_scale), np.float32(np.inf))


@dataclass(frozen=True)
class StationScene:
    """A scene folder: ``stations`` is a list of six-face lists, ``views`` and ``path`` are lists of views."""

    name: str
    stations: list[list[RoomView]]
    views: list[RoomView]
    path: list[RoomView] = field(default_factory=list)

    def scan(self, seed: int) -> MergedScan:
        """The merged scan of the stations, degraded with this seed.

        A share INSTRUMENT_SHARE of the scans is sampled like an instrument's, the others have one return per pixel.  A share
        WIDE_SHARE has widely different exposures."""
        kind = np.random.default_rng([seed, 1]).random(2)
        model = WIDE if kind[0] < WIDE_SHARE else ScanModel()
        return instrument_scan(self, seed, model) if kind[1] < INSTRUMENT_SHARE else scan_stations(self, seed, model)


def _room_view(folder: Path, entry: dict, scale: float) -> RoomView:
    """A view from an entry of scene.json.  Raises KeyError, TypeError or ValueError where it is not a picture with a camera."""
    made = RoomView(folder, str(entry["rgb"]), str(entry["depth"]), int(entry["w"]), int(entry["h"]), float(entry["fl"]),
                    np.asarray(entry["camera_to_world"], np.float64).reshape(4, 4), scale)
    turn = made.camera_to_world[:3, :3]
    if not ((np.abs(made.camera_to_world) < FAR).all() and np.allclose(turn @ turn.T, np.eye(3), atol=1e-2)):
        raise ValueError(f"{made.rgb_file}: camera_to_world is not a rotation and a translation")
    if not (0 < made.fl < MAX_FOCAL and made.width > 0 and made.height > 0):
        raise ValueError(f"{made.rgb_file}: {made.width}x{made.height} pixels, fl {made.fl:g}: not a valid camera")
    return made


def load_scene(folder: Path) -> StationScene:
    """Reads ``scene.json`` and checks that every picture it names exists, is readable and has the stated size.

    Raises DataError naming the first ten files that are not, each with the reason, or the error in ``scene.json``.
    """
    folder = Path(folder)
    try:
        data = json.loads((folder / "scene.json").read_text())
        scale = float(data["depth_scale"])
        if not 0 < scale < np.inf:
            raise ValueError(f"depth_scale {scale:g}: expected the number of depth steps in a metre")

        def read(entry: dict) -> RoomView:
            return _room_view(folder, entry, scale)

        scene = StationScene(
            str(data.get("scene", folder.name)),
            [[read(face) for face in station["faces"]] for station in data["stations"]],
            [read(view) for view in data["views"]],
            [read(view) for view in data.get("path", [])],
        )
        alike = all(len(faces) == FACES and len({(f.width, f.height, f.fl) for f in faces}) == 1 for faces in scene.stations)
        if not (scene.stations and alike):
            raise ValueError(f"expected stations with {FACES} faces of one size and focal length")
    except FileNotFoundError:
        raise DataError("no scene.json in this folder" if folder.exists() else "no such folder", file=folder) from None
    except (OSError, KeyError, TypeError, ValueError, OverflowError, RecursionError) as error:
        raise DataError(f"not a scene description ({reason(error)})", file=folder / "scene.json") from None
    views = [*(face for station in scene.stations for face in station), *scene.views, *scene.path]
    pictures = dict.fromkeys((folder / name, (s.width, s.height)) for s in views for name in (s.rgb_file, s.depth_file))
    if wrong := wrong_pictures(folder, pictures, [folder / s.depth_file for s in views]):
        raise DataError(f"{len(wrong)} pictures named in scene.json cannot be used: {'; '.join(wrong[:10])}", file=folder)
    if not any(np.isfinite(face.depth()).any() for faces in scene.stations for face in faces):
        raise DataError("the depth pictures of its stations have no return (all 0)", file=folder,
                        remedy="write metres x depth_scale")
    return scene


def room_view_points(view: RoomView) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The pixels of a picture with depth as points.

    Returns xyz (N, 3) float64 world, rgb (N, 3) uint8, and edge (N,) bool: the pixel is on a depth discontinuity.
    """
    depth = view.depth().astype(np.float64)
    finite = np.isfinite(depth)
    j, i = np.nonzero(finite)
    z = depth[finite]
    local = np.stack(
        [(i + 0.5 - view.width / 2) / view.fl * z, -(j + 0.5 - view.height / 2) / view.fl * z, -z], axis=1
    )
    xyz = local @ view.camera_to_world[:3, :3].T + view.camera_to_world[:3, 3]
    inverse = np.pad(np.where(finite, 1.0 / depth, 0.0), 1, mode="edge")
    mid = inverse[1:-1, 1:-1]
    bend = [abs(inverse[1:-1, :-2] + inverse[1:-1, 2:] - 2 * mid), abs(inverse[:-2, 1:-1] + inverse[2:, 1:-1] - 2 * mid)]
    edge = np.maximum(*bend) > EDGE * mid
    return xyz, view.rgb()[finite], edge[finite]


EDGE = 0.03
"""Second difference of inverse depth, relative to it, that marks a depth discontinuity.  This and the values
below are those of the shipped weights' training (assets/weights/README.md)."""
MIXED_RANGE = 0.08
"""Largest relative error of the range of a mixed pixel."""


@dataclass(frozen=True)
class ScanModel:
    """Errors of a scan that is made from the stations.

    exposure: largest deviation of a station's gain from 1; the stations' mean gain is 1, because the network could not know the
    true brightness otherwise.  white_balance: the same for single channels.  range_noise: standard deviation, metres, plus
    range_noise_relative x range.  mixed: share of the returns at depth edges that lie between the two surfaces.  dropout: share
    lost at random.  misregistration: standard deviation of a station's shift, metres.  colour_noise: standard deviation, sRGB
    levels.
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
"""Share of the scans with the exposures of WIDE."""
INSTRUMENT_SHARE = 0.3
"""Share of the scans sampled like an instrument's."""
WIDE = ScanModel(exposure=0.35, white_balance=0.05)
"""Widely different exposures: in some merged scans stations are half as bright again as others (measured on studio.laz)."""


def station_gains(model: ScanModel, count: int, rng: np.random.Generator) -> np.ndarray:
    """(count,) random exposures with mean 1."""
    gains = 1 + model.exposure * rng.uniform(-1, 1, count)
    return gains / gains.mean()


def scan_stations(scene: StationScene, seed: int, model: ScanModel | None = None) -> MergedScan:
    """The merged scan of all stations of a scene, one return per pixel, with the errors of ``model`` and the given seed."""
    model = model or ScanModel()
    rng = np.random.default_rng(seed)
    gains = station_gains(model, len(scene.stations), rng)
    parts = []
    for index, faces in enumerate(scene.stations):
        balance = gains[index] * (1 + model.white_balance * rng.uniform(-1, 1, 3))
        shift = rng.normal(0, model.misregistration, 3)
        for face in faces:
            xyz, rgb, edge = room_view_points(face)
            keep = rng.random(len(xyz)) >= model.dropout
            xyz, rgb, edge = xyz[keep], rgb[keep], edge[keep]
            centre = face.camera_to_world[:3, 3]
            ray = xyz - centre
            distance = np.linalg.norm(ray, axis=1)
            spread = model.range_noise + model.range_noise_relative * distance
            scale = 1 + rng.normal(0, 1, len(xyz)) * spread / distance
            mixed = edge & (rng.random(len(xyz)) < model.mixed)  # a beam on an edge returns a range in between
            scale = np.where(mixed, scale * (1 + rng.uniform(-MIXED_RANGE, MIXED_RANGE, len(xyz))), scale)
            noisy = rgb * balance + rng.normal(0, model.colour_noise, rgb.shape)
            parts.append((centre + ray * scale[:, None] + shift, np.clip(np.rint(noisy), 0, 255).astype(np.uint8), index))
    return MergedScan(
        np.concatenate([p[0] for p in parts]),
        np.concatenate([p[1] for p in parts]),
        np.concatenate([np.full(len(p[0]), p[2], np.uint8) for p in parts]),
        station_places(scene),
    )


def station_places(scene: StationScene) -> np.ndarray:
    """(S, 3) float64 scanner positions."""
    return np.array([faces[0].camera_to_world[:3, 3] for faces in scene.stations])


UP = "y"
"""Up axis of scene folders."""


def panorama(faces: list[RoomView]) -> Panorama:
    """The six faces of a station as a panorama in a z-up world."""
    rotations = np.stack([to_z_up(face.camera_to_world[:3, :3].T, UP).T for face in faces])
    depth = np.stack([face.depth() for face in faces]).astype(np.float64)
    return Panorama(rotations, faces[0].fl, depth, np.stack([face.rgb() for face in faces]))


def instrument_scan(scene: StationScene, seed: int, model: ScanModel | None = None) -> MergedScan:
    """The stations sampled like a terrestrial scanner's.

    It has the scanner's angular grid and limited vertical field of view, the blind cone under the tripod, noise that grows with
    range and grazing angle, mixed pixels, dropouts on dark and grazing surfaces, misregistration of a few millimetres and
    hundredths of a degree, and people who pass by while a station scans.  model: only exposure and white balance are used.
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
        # gains act on sRGB, as in scan_stations, so the scanner's own camera has gain 1
        xyz, rgb, _, station, _ = scanner.station(position, int(0.8 * faces[0].width**2 * 6), rng, 1.0, number)
        rgb = np.clip(np.rint(rgb * gains[number]), 0, 255).astype(np.uint8)
        parts.append((from_z_up(xyz, UP), rgb, station))
    xyz, rgb, station = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return MergedScan(xyz, rgb, station, station_places(scene))


def _passers(position: np.ndarray, rng: np.random.Generator) -> list[Passer]:
    """One or two people on the floor, 1.2 to 3.5 m from the station."""
    floor = float(position[2]) - 1.5
    people = []
    for _ in range(rng.integers(1, 3)):
        angle, away = rng.uniform(0, 2 * np.pi), rng.uniform(1.2, 3.5)
        foot = np.array([position[0] + away * np.cos(angle), position[1] + away * np.sin(angle), floor])
        clothes = rng.uniform(0.05, 0.7) + rng.uniform(0, 0.2, 3)
        people.append(Passer(foot, float(rng.uniform(1.5, 1.9)), float(rng.uniform(0.15, 0.28)), clothes))
    return people
