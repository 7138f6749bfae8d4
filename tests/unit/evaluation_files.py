"""What the evaluation reads, made on the spot: a room with a film in it, and a SqueezeNet distance of random weights."""

import json
from pathlib import Path

import numpy as np
import torch
from PIL import Image
from rooms import FACES, _look, _shoot, make_room


def film_room(folder: Path) -> Path:
    """A box with a path of four frames that creeps sideways."""
    make_room(folder)
    facts = json.loads((folder / "scene.json").read_text())
    facts["path"] = []
    for n in range(4):
        rotation, position = _look(*FACES[0]), np.array([0.0, 0.0, 0.02 * n])
        rgb, depth = _shoot(rotation, position, (36, 48), 40.0)
        Image.fromarray(rgb).save(folder / f"p{n}.png")
        Image.fromarray(np.round(depth * 1000).astype(np.uint16)).save(folder / f"p{n}.depth.png")
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = rotation, position
        facts["path"].append({"rgb": f"p{n}.png", "depth": f"p{n}.depth.png", "w": 48, "h": 36, "fl": 40.0,
                              "camera_to_world": pose.tolist()})
    (folder / "scene.json").write_text(json.dumps(facts))
    return folder


def squeeze_files(folder: Path) -> Path:
    """Files of a SqueezeNet distance with random weights."""
    from scipy.io import savemat

    rng = np.random.default_rng(0)
    taps = [64, 128, 256, 384, 384, 512, 512]
    layers = {"conv1": (3, 3, 3, 64)}
    wide = 64
    for fire, out in zip(range(2, 10), (64, 64, 128, 128, 192, 192, 256, 256), strict=True):
        squeezed = out // 4
        layers |= {f"fire{fire}/squeeze1x1": (1, 1, wide, squeezed), f"fire{fire}/expand1x1": (1, 1, squeezed, out),
                   f"fire{fire}/expand3x3": (3, 3, squeezed, out)}
        wide = 2 * out
    stored = {}
    for name, shape in layers.items():
        cell = np.empty((1, 2), object)
        cell[0, 0] = rng.normal(0, 1.4 / np.sqrt(np.prod(shape[:3])), shape).astype(np.float32)
        cell[0, 1] = rng.normal(0, 0.1, (1, shape[3])).astype(np.float32)
        stored[name] = cell
    savemat(folder / "sqz_notop.mat", stored)
    heads = {f"lin{k}.model.1.weight": torch.rand(1, count, 1, 1, generator=torch.Generator().manual_seed(k))
             for k, count in enumerate(taps)}
    torch.save(heads, folder / "lin_v0.1_squeeze.pth")
    return folder


def rgb_of(picture):
    return torch.from_numpy(picture.rgb()).permute(2, 0, 1) / 255
