"""Hashes of a reference set of pictures, by OpenGL renderer: ``python tests/stability/hashes.py`` renews those of this one.

A picture may change only on purpose.  Each OpenGL renderer (the driver's own string) has its hashes in ``hashes.json``;
on one that is not listed nothing is compared.  Pictures of the network are left out: processors round them differently.
The scenes are random, but of fixed seeds, and made by additions, products and rounding alone.
"""

import hashlib
import json
import sys
from pathlib import Path

import numpy as np
from frame_claims import place_at
from scenes import axis_camera
from station_claims import lit, scene_of, standing

from pointglass.viewer.bench.cases.stability import Renderers, arrays_of, placed, view_inside
from pointglass.viewer.grid.open_scene import scene_from_arrays
from pointglass.viewer.picture.settings import FILTERS, SOFT_Z, Settings

FILE = Path(__file__).with_name("hashes.json")
PLACES = ((11, 1.0, 0.0), (12, 1e-3, 1e5), (13, 1e3, 1e7))  # seed, scale, distance of the origin
SETTINGS = {
    **{f"filter {name}": Settings(filter=name) for name in FILTERS},
    **{f"soft depth {name}": Settings(soft_z=name) for name in SOFT_Z},
    "level of detail 1": Settings(lod=1.0), "strength 2, 3 levels": Settings(filter_strength=2.0, filter_levels=3),
}
WEIGHTED = {"weighted by stations": Settings()}


def hashes_of(renderers: Renderers) -> dict[str, str]:
    """Name of the picture -> 16 hex digits of the SHA-256 of its bytes."""
    made = {}
    for seed, scale, away in PLACES:
        xyz, _, origin = place_at(seed, scale, away)
        rgb = np.random.default_rng(seed).integers(0, 256, xyz.shape).astype(np.uint8)  # no sines, which libraries round
        weighted = scene_of(xyz, *lit(seed, rgb, 3), standing(seed, 3) * scale + origin)
        cameras = {"turned": placed(view_inside(seed, (97, 61), 60.0), scale, origin),
                   "along y": placed(axis_camera((64, 48), (4.0, 0.5, 2.0)), scale, origin)}
        for scene, ways in ((scene_from_arrays(xyz, rgb, noise=False), SETTINGS), (weighted, WEIGHTED)):
            with renderers.renderer(scene) as renderer:
                for where, camera in cameras.items():
                    for how, settings in ways.items():
                        pictures = arrays_of(renderer, camera, settings)
                        whole = hashlib.sha256(b"".join(np.ascontiguousarray(pictures[k]).tobytes() for k in sorted(pictures)))
                        made[f"place {seed} at {scale:g}, {where}, {how}"] = whole.hexdigest()[:16]
    return made


def main() -> int:
    """Writes this renderer's hashes into the file and says what changed."""
    from pointglass.viewer.render.device.context import create_context, describe_device

    context = create_context()
    name, made = describe_device(context).renderer, hashes_of(Renderers(context))
    context.release()
    known = json.loads(FILE.read_text()) if FILE.is_file() else {}
    before = known.get(name, {})
    changed = [key for key in made if before.get(key) != made[key]]
    known[name] = made
    FILE.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    print(f"{name}: {len(made)} pictures, {len(changed)} new or changed")
    for key in changed if before else ():
        print(f"  {key}")
    return 0


if __name__ == "__main__":
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    sys.exit(main())
