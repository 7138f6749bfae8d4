"""A tiny scene folder in the ``renders/`` form, made on the spot: a textured box seen from two stations and four views."""

import json
from pathlib import Path

import numpy as np
from PIL import Image


def _look(forward, up) -> np.ndarray:
    z = -np.asarray(forward, float)
    x = np.cross(up, z)
    return np.stack([x, np.cross(z, x), z], 1)


FACES = [((1, 0, 0), (0, 1, 0)), ((-1, 0, 0), (0, 1, 0)), ((0, 1, 0), (0, 0, 1)), ((0, -1, 0), (0, 0, -1)),
         ((0, 0, 1), (0, 1, 0)), ((0, 0, -1), (0, 1, 0))]


def _shoot(rotation, position, size, fl, box=(2.0, 1.5, 2.5)):
    """Colour and z-depth of the inside of a box with a checker on it."""
    h, w = size
    i, j = np.meshgrid(np.arange(w) + 0.5, np.arange(h) + 0.5)
    local = np.stack([(i - w / 2) / fl, -(j - h / 2) / fl, -np.ones_like(i)], -1)
    ray = local @ rotation.T
    with np.errstate(divide="ignore"):
        t = np.where(ray > 0, (np.array(box) - position) / ray, (-np.array(box) - position) / ray).min(-1)
    hit = position + ray * t[..., None]
    checker = (np.floor(hit * 2.0).sum(-1) % 2)[..., None]
    rgb = 60 + 120 * checker + 30 * np.sin(hit * 3)
    return np.clip(rgb, 0, 255).astype(np.uint8), t


def make_room(folder: Path, *, face: int = 48, view: tuple[int, int] = (36, 48), views: int = 4) -> Path:
    """Writes the scene, with so many of its four views, and returns its folder."""
    folder.mkdir(parents=True)

    def save(name, rotation, position, size, fl):
        rgb, depth = _shoot(rotation, np.asarray(position, float), size, fl)
        Image.fromarray(rgb).save(folder / f"{name}.png")
        Image.fromarray(np.round(depth * 1000).astype(np.uint16)).save(folder / f"{name}.depth.png")
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, position
        return {"rgb": f"{name}.png", "depth": f"{name}.depth.png", "w": size[1], "h": size[0], "fl": fl,
                "camera_to_world": pose.tolist()}

    stations = [
        {"position": list(p), "faces": [save(f"s{n}f{k}", _look(*d), p, (face, face), face / 2) for k, d in enumerate(FACES)]}
        for n, p in enumerate([(-0.6, 0.0, 0.3), (0.7, 0.2, -0.4)])
    ]
    cameras = [(0, (0, 0, 0)), (1, (0.3, 0, 0.2)), (4, (0, 0.1, 0)), (5, (-0.2, 0, 0.5))][:views]
    seen = [save(f"v{n}", _look(*FACES[d]), p, view, 40.0) for n, (d, p) in enumerate(cameras)]
    (folder / "scene.json").write_text(json.dumps(
        {"scene": "box", "depth_scale": 1000, "stations": stations, "views": seen}))
    return folder
