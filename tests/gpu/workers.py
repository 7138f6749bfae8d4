"""The parts of tests/gpu/run.py that are more than a bench: ``python tests/gpu/workers.py NAME FOLDER``, JSON on the last line.

Each runs in a process of its own.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from plan import SMALL, Plan

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))


def make_scan(plan: Plan, work: Path) -> dict:
    """The benches' scan, as a folder that `pointglass` opens."""
    from pointglass.viewer.bench.procedural_scan import ProceduralScan, procedural_scene

    begun = time.perf_counter()
    scan = ProceduralScan(plan.points)
    scene = procedural_scene(scan, work / "scan")
    return {"scan": scan.label, "points": scene.count, "seconds": time.perf_counter() - begun}


def projected(plan: Plan, _work: Path) -> dict:
    """The compute rasteriser over a whole scan: milliseconds by named view, with the points drawn in each.

    ``raster_ms`` is the whole stage on the GPU, by timer queries: the list of batches uploaded, both passes, the picture made
    of their sums, and waiting for the host meanwhile.  ``raster_host_ms`` is what the host takes for the stage, the making of
    that list included.
    """
    from statistics import median

    from pointglass.viewer.bench.bench_input import machine
    from pointglass.viewer.bench.procedural_scan import ProceduralScan, procedural_scene
    from pointglass.viewer.picture.settings import Settings
    from pointglass.viewer.render.device.context import create_context
    from pointglass.viewer.render.renderer import Renderer
    from pointglass.viewer.work.places.viewpoints import named_views

    scan = ProceduralScan(plan.many)
    scene = procedural_scene(scan)
    context = create_context()
    renderer = Renderer(context, scene, raster="compute", device="cpu")
    settings = Settings(view="raw", raster="compute")
    size = tuple(int(side) for side in plan.sizes[min(1, len(plan.sizes) - 1)].split("x"))
    rows = []
    for camera in named_views(scene, (size[0], size[1])):
        spent = [renderer.render(camera, settings).stats for _ in range(max(3, plan.repeats // 2))][2:]
        milliseconds, points = median(stats["stages"]["raster"] for stats in spent), spent[0]["points_drawn"]
        rows.append({
            "view": camera.name, "points": points, "raster_ms": milliseconds,
            "raster_host_ms": median(stats["host"]["raster"] for stats in spent),
            "cull_ms": median(stats["stages"]["cull"] for stats in spent),
            "ms_per_100M": milliseconds * 1e8 / max(points, 1), "approximations": spent[0]["approximations"],
        })
    most = max(rows, key=lambda row: row["points"])
    facts = {"opengl": renderer.device.renderer, "driver": renderer.device.version}
    renderer.release()
    context.release()
    return {"scan": scan.label, "size": list(size), **facts, "machine": machine(), "most": most, "views": rows}


def engines(plan: Plan, _work: Path) -> dict:
    """The network's time by engine, and the bridge's by kind, at every size; each with what stopped it where it failed.

    Bridges first: a compiler may take all the time there is.  Each row is also in the log as soon as it is measured.
    """
    from pointglass.viewer.bench.bench_input import machine

    bridges = _bridges(plan)
    return {"machine": machine(), "network": _networks(plan), "bridge": bridges}


def _measured(work: Callable[[], object], plan: Plan) -> float:
    """Milliseconds, the middle of the runs."""
    import torch

    for _ in range(3):
        work()
    spent = []
    for _ in range(plan.repeats):
        if plan.device == "cuda":
            start, stop = torch.cuda.Event(enable_timing=True), torch.cuda.Event(enable_timing=True)
            start.record()
            work()
            stop.record()
            stop.synchronize()
            spent.append(start.elapsed_time(stop))
        else:
            begun = time.perf_counter()
            work()
            spent.append((time.perf_counter() - begun) * 1e3)
    return sorted(spent)[len(spent) // 2]


def _networks(plan: Plan) -> list[dict]:
    """A row for each network, size and engine."""
    import torch

    from pointglass.model.common.process.torch_process import prepare_inference
    from pointglass.model.network.engines import ENGINES, Runner
    from pointglass.model.network.network_layout import PACKED_IN
    from pointglass.model.network.reconstruct import Reconstructor
    from pointglass.model.network.unet import mac_per_pixel, make_network
    from pointglass.model.network.weights_folder import shipped, weights_name

    prepare_inference()
    on_gpu, begun = plan.device == "cuda", time.perf_counter()
    qualities = [q for q in ("balanced", "fast", "best") if weights_name(q, filtered=True) in shipped()]
    jobs = [(q, size, engine, False) for size in plan.sizes for q in qualities for engine in ("eager", "graph")]
    middle = plan.sizes[min(1, len(plan.sizes) - 1)]
    jobs += [("balanced", middle, *last) for last in (("graph", True), ("compile", False))]
    rows: list[dict] = []
    networks: dict[str, Reconstructor] = {}
    costs: dict[str, float] = {}
    for quality, size, engine, tuned in jobs if on_gpu else jobs[:1]:
        width, height = (int(side) for side in size.split("x"))
        row: dict = {"quality": quality, "size": [width, height], "engine": engine, "cudnn_benchmark": tuned}
        rows.append(row)
        try:
            if quality not in networks:
                networks[quality] = Reconstructor(quality, filtered=True, device=plan.device)
            network = networks[quality]
            torch.backends.cudnn.benchmark = tuned
            runner = Runner(network, height, width, engine=engine)
            packed = torch.rand((height, width, PACKED_IN), generator=torch.Generator().manual_seed(1)).half().to(plan.device)
            with torch.inference_mode():
                gap = (runner(packed).float() - network.made(packed).float()).abs().max().item()
            row |= {"runs": ENGINES[runner.engine], "problem": runner.problem, "largest_difference": gap}
            row["ms"] = _measured(lambda runner=runner, packed=packed: runner(packed), plan)
            row["mac_per_pixel"] = costs.get(quality) or costs.setdefault(quality, mac_per_pixel(make_network(quality), 64))
            runner.release()
        except Exception as error:  # one engine that fails does not end the rest
            row["problem"] = _said(error)
        row["at_s"] = round(time.perf_counter() - begun, 1)
        print(json.dumps(row), file=sys.stderr)
    return rows


def _said(error: Exception) -> str:
    """One line."""
    return f"{type(error).__name__}: {next(iter(str(error).strip().splitlines()), '')}"


class _Through:
    """A network that costs nothing but its pixels."""

    def __init__(self, device: str):
        self.device = device

    def __call__(self, packed):
        from pointglass.model.network.network_layout import PACKED_OUT

        return packed[..., :PACKED_OUT]


def _bridges(plan: Plan) -> list[dict]:
    """A row for each kind of bridge and size."""
    import torch

    from pointglass.viewer.render.device.context import create_context
    from pointglass.viewer.render.device.shader import Programs
    from pointglass.viewer.render.network.bridge import ReadBackBridge
    from pointglass.viewer.render.network.cuda_bridge import MAPPERS, CudaBridge

    on_gpu = plan.device == "cuda"
    programs, rows = Programs(create_context()), []
    for size in plan.sizes:
        width, height = (int(side) for side in size.split("x"))
        for kind in (*(MAPPERS if on_gpu else ()), "read-back"):
            row: dict = {"kind": kind, "size": [width, height]}
            rows.append(row)
            try:
                bridge = (ReadBackBridge(programs.context, (width, height)) if kind == "read-back"
                          else CudaBridge(programs, (width, height), (kind,)))
                spent = []
                for _ in range(plan.repeats + 3):
                    programs.context.finish()
                    start = time.perf_counter()
                    bridge.run(_Through(plan.device))
                    programs.context.finish()
                    if on_gpu:
                        torch.cuda.synchronize()
                    spent.append((time.perf_counter() - start) * 1e3)
                row["ms"] = sorted(spent[3:])[len(spent[3:]) // 2]
                bridge.release()
            except Exception as error:  # each library has errors of its own, and none ends the rest
                row["problem"] = _said(error)
            print(json.dumps(row), file=sys.stderr)
    return rows


def workgroups(plan: Plan, work: Path) -> dict:
    """The compute rasteriser's time by workgroup shape, in turn, over the benches' scan: the middle of the runs."""
    from statistics import median

    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.picture.settings import Settings
    from pointglass.viewer.render.device.context import create_context
    from pointglass.viewer.render.device.device_class import WORKGROUPS
    from pointglass.viewer.render.raster.choose_raster import make_rasteriser
    from pointglass.viewer.render.renderer import Renderer
    from pointglass.viewer.work.places.viewpoints import named_views

    context, scene = create_context(), open_scene([work / "scan"])
    renderer = Renderer(context, scene, raster="compute", device="cpu")
    renderer.pages.load_all()
    size = tuple(int(side) for side in plan.sizes[min(1, len(plan.sizes) - 1)].split("x"))
    shapes = list(dict.fromkeys(shape for known in WORKGROUPS.values() for shape in known))
    camera, settings = named_views(scene, (size[0], size[1]))[0], Settings(view="raw", raster="compute")
    renderer.render(camera, settings)
    made = {shape: make_rasteriser("compute", shape, renderer._programs, (size[0], size[1]), renderer.device)
            for shape in shapes}
    spent: dict = {shape: [] for shape in shapes}
    own = renderer._passes.rasterisers.pop("compute")
    for _ in range(max(3, plan.repeats // 2)):
        for shape, rasteriser in made.items():
            renderer._passes.rasterisers["compute"] = rasteriser
            spent[shape].append(renderer.render(camera, settings).stats["stages"]["raster"])
    renderer._passes.rasterisers["compute"] = own
    for rasteriser in made.values():
        rasteriser.release()
    rows = [{"workgroup": str(shape), "raster_ms": median(times[1:])} for shape, times in spent.items()]
    facts = {"size": list(size), "class": renderer.device.kind, "opengl": renderer.device.renderer, "rows": rows}
    renderer.release()
    context.release()
    return facts


def growth(plan: Plan, work: Path) -> dict:
    """Frames along a path with hidden cells left out, the network at the end: how much memory they leave behind.

    As many as fit into 50 s.  main_bytes: growth of the process; gpu_bytes: of the device, by CUDA, None without.
    """
    import resource
    import sys

    import torch

    from pointglass.viewer.grid.open_scene import open_scene
    from pointglass.viewer.picture.settings import Settings
    from pointglass.viewer.render.culling.occlusion import Occlusion
    from pointglass.viewer.render.device.context import create_context
    from pointglass.viewer.render.renderer import Renderer
    from pointglass.viewer.work.places.viewpoints import camera_path

    context, scene = create_context(), open_scene([work / "scan"])
    renderer = Renderer(context, scene, device=plan.device)
    renderer.pages.load_all()
    cameras, settings = camera_path(scene, (96, 64), 48), Settings(view="neural", quality="fast", lod=1.0)
    history, on_gpu = Occlusion(), plan.device == "cuda"

    def resident() -> int:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)

    def draw(count: int, until: float) -> int:
        for number in range(count):
            renderer.render(cameras[number % len(cameras)], settings, ("neural",), history)
            if time.perf_counter() > until:
                return number + 1
        return count

    begun = time.perf_counter()
    draw(min(200, plan.frames), begun + 20.0)
    before, free = resident(), torch.cuda.mem_get_info()[0] if on_gpu else 0
    frames = draw(plan.frames, begun + 50.0)
    context.finish()
    found = {"frames": frames, "seconds": time.perf_counter() - begun, "main_bytes": resident() - before,
             "gpu_bytes": max(0, free - torch.cuda.mem_get_info()[0]) if on_gpu else None, "allowed_bytes": 32 << 20}
    renderer.release()
    context.release()
    return found


def agreement(plan: Plan, work: Path) -> dict:
    """Share of pixels in which pictures of the first named view differ: raw pictures and depths of the two rasterisers;
    keep-mask and filled picture of one and the float64 reference."""
    import numpy as np

    from pointglass.viewer.bench.float64_reference import reference_frame
    from pointglass.viewer.bench.procedural_scan import ProceduralScan, procedural_scene
    from pointglass.viewer.picture.settings import Settings
    from pointglass.viewer.render.device.context import create_context
    from pointglass.viewer.render.device.device_class import DIFFERING_PIXELS, FOLLOWING_PIXELS
    from pointglass.viewer.render.renderer import Renderer
    from pointglass.viewer.work.places.viewpoints import named_views

    scene = procedural_scene(ProceduralScan(min(plan.points, 2_000_000)))
    context = create_context()
    renderer = Renderer(context, scene, device="cpu")
    width, height = (int(side) for side in plan.sizes[0].split("x"))
    camera = named_views(scene, (width, height))[0]
    made = {}
    for kind in ("compute", "points"):
        frame = renderer.render(camera, Settings(raster=kind), ("raw", "filled"))
        made[kind] = frame.image("raw").copy(), frame.depth().copy(), frame.mask().copy(), frame.image("filled").copy()
    picture, mask = reference_frame(scene, camera, Settings(), renderer.metre)
    opaque = made["compute"][3][..., 3] == 255
    levels = np.abs(made["compute"][3][..., :3].astype(int) - picture)[opaque].max(-1)
    shares = {
        "raw, compute and points": float((made["compute"][0] != made["points"][0]).any(-1).mean()),
        "depth, compute and points": float((made["compute"][1] != made["points"][1]).mean()),
    }
    following = {
        "keep-mask, compute and float64": float((made["compute"][2] != mask).mean()),
        "filled by more than 2 levels, compute and float64": float((levels > 2).mean()),
    }
    compute: Any = renderer._passes.rasterisers["compute"]
    facts = {"shares": shares, "tolerance": DIFFERING_PIXELS, "following": following, "following_tolerance": FOLLOWING_PIXELS,
             "opengl": renderer.device.renderer, "wide_sums": compute.wide_sums}
    renderer.release()
    context.release()
    return facts


WORKERS = {"scan": make_scan, "projected": projected, "workgroups": workgroups, "growth": growth, "agreement": agreement,
           "engines": engines}


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("name", choices=list(WORKERS))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--small", action="store_true")
    options = parser.parse_args()
    print(json.dumps(WORKERS[options.name](SMALL if options.small else Plan(), options.folder)))


if __name__ == "__main__":
    main()
