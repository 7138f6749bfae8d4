#!/usr/bin/env python3
"""Everything that needs a CUDA GPU, in one go: the doctor, the GPU tests and the benches.  Under nine minutes.

    python3 tests/gpu/run.py --out FOLDER          where there is a GPU
    python tests/gpu/run.py --dry --out FOLDER     the plumbing alone, on the CPU with a tiny scan

Leaves FOLDER/results.json (every part's figures; rewritten after each part, so that what was measured survives a loss),
FOLDER/log.txt and two plots.  Each part is a process of its own with a time limit: one that fails or hangs does not end the
rest.  The exit code is 1 where a part failed.  Needs no window, no open3d, no imgui; makes its scans itself.

On a bare machine that has torch but cannot reach a registry, carry these as wheels (Python 3.12, Linux), and the loaders of
OpenGL (libegl1 libglvnd0 libgl1 libopengl0 libglx0 libgles2) as packages:

    python3 -m pip download --no-deps --only-binary=:all: --python-version 3.12 --implementation cp \\
        --platform manylinux_2_28_x86_64 --platform manylinux_2_27_x86_64 --platform manylinux_2_24_x86_64 \\
        --platform manylinux_2_17_x86_64 --platform manylinux2014_x86_64 --platform manylinux1_x86_64 -d .whl \\
        moderngl glcontext laspy lazrs platformdirs cuda-core cuda-bindings cuda-pathfinder

and there, before this script: ``python3 -m pip install --no-index --no-deps --target /tmp/site .whl/*.whl`` and
``export PYTHONPATH=/tmp/site``.  numba, numpy, scipy, pillow, tqdm, matplotlib, safetensors and pytest are expected there.
"""

import argparse
import json
import os
import platform
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
TOTAL = 525.0
"""Seconds for everything."""
_LAST = 5.0  # seconds kept for writing the results


@dataclass(frozen=True)
class Plan:
    """How much of everything.  points, many: of the benches' scan, of the scan that is projected.  sizes: of pictures.
    device: asked for."""

    points: int = 25_000_000
    many: int = 100_000_000
    grid: int = 10_000_000
    sizes: tuple[str, ...] = ("960x720", "1920x1440", "3840x2160")
    repeats: int = 50
    device: str = "cuda"


DRY = Plan(points=30_000, many=40_000, grid=50_000, sizes=("96x72",), repeats=2, device="cpu")


@dataclass(frozen=True)
class Part:
    """One process.  seconds: its limit.  command: its arguments to Python, from the plan and a folder to work in.  json: a
    file in that folder it leaves, or None: its last line is JSON; "" : it leaves none.  plot: a file it leaves."""

    name: str
    seconds: float
    command: Callable[[Plan, Path], list[str]]
    json: str | None = ""
    plot: str | None = None


def _bench(kind: str, plan: Plan, work: Path, name: str, *more: str) -> list[str]:
    return ["-m", "viewer", "bench", kind, *more, "--json", str(work / f"{name}.json")]


def _frame(number: int) -> Part:
    def command(plan: Plan, work: Path) -> list[str]:
        plot = ["--plot", str(work / "frame.png")] if number == 1 else []
        return _bench("frame", plan, work, f"frame-{number}", str(work / "scan"), "--size", plan.sizes[number],
                      "--device", plan.device, *plot)

    return Part(f"frame-{number}", 60, command, f"frame-{number}.json", "frame.png" if number == 1 else None)


def _worker(name: str) -> Callable[[Plan, Path], list[str]]:
    return lambda plan, work: [str(Path(__file__).resolve()), "--worker", name, "--work", str(work),
                               *(["--dry"] if plan is DRY else [])]


def _versus(plan: Plan, work: Path) -> list[str]:
    return _bench("versus", plan, work, "versus", str(work / "scan"), "--size", ",".join(plan.sizes[:2]), "--device",
                  plan.device, "--plot", str(work / "versus.png"), *(["--frames", "1"] if plan is DRY else []))


def _tests(_plan: Plan, _work: Path) -> list[str]:
    return ["-m", "pytest", "tests/gpu", "-q", "-rfEs", "-p", "no:cacheprovider", "--durations=5"]


PARTS = (
    Part("doctor", 60, lambda *_: ["-m", "viewer", "doctor", "--json"], None),
    Part("tests", 150, _tests),
    Part("scan", 60, _worker("scan"), None),
    *(_frame(number) for number in range(len(Plan.sizes))),
    Part("projected", 90, _worker("projected"), None),
    Part("versus", 120, _versus, "versus.json", "versus.png"),
    Part("engines", 110, _worker("engines"), None),
    Part("grid", 45, lambda plan, work: _bench("grid", plan, work, "grid", "--points", str(plan.grid)), "grid.json"),
    Part("open", 30, lambda plan, work: _bench("open", plan, work, "open", str(work / "scan"), "--device", plan.device),
         "open.json"),
)
"""In the order of what would be missed most: the last ones are cut short where time runs out."""


# -- the script: nothing here imports more than Python's own library -------------------------------------------------


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/gpu"))
    parser.add_argument("--dry", action="store_true", help="on the CPU with a tiny scan: does the script itself work?")
    parser.add_argument("--only", help="names of parts, comma-separated (default: all)")
    parser.add_argument("--seconds", type=float, default=TOTAL)
    parser.add_argument("--worker", choices=list(WORKERS), help=argparse.SUPPRESS)
    parser.add_argument("--work", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    plan = DRY if options.dry else Plan()
    if options.worker:
        sys.path.insert(0, str(ROOT))
        print(json.dumps(WORKERS[options.worker](plan, options.work)))
        return 0
    names = [part.name for part in PARTS]
    wanted = options.only.split(",") if options.only else names
    if unknown := set(wanted) - set(names):
        parser.error(f"--only {','.join(sorted(unknown))}: there are {', '.join(names)}")
    options.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(prefix="pointglass-gpu-") as folder, open(options.out / "log.txt", "w") as log:
        results = _all(plan, [part for part in PARTS if part.name in wanted], Path(folder), options.out, log, options.seconds)
    for name, held in results["parts"].items():
        print(f"{name:10} {held['seconds']:6.1f} s  {held['said']}")
    return 0 if all(held["said"] == "done" for held in results["parts"].values()) else 1


def _all(plan: Plan, parts: list[Part], work: Path, out: Path, log, seconds: float) -> dict:
    begun = time.monotonic()
    results: dict = {"machine": _machine(), "plan": vars(plan) | {"dry": plan is DRY}, "parts": {}}
    for part in parts:
        left = seconds - _LAST - (time.monotonic() - begun)
        if part.name.startswith("frame-") and int(part.name[6:]) >= len(plan.sizes):
            continue
        if left < 5:
            results["parts"][part.name] = {"seconds": 0.0, "said": "left out: no time was left", "result": None}
        else:
            results["parts"][part.name] = _run(part, plan, work, out, log, min(part.seconds, left))
        text = json.dumps(results, indent=1)
        (out / "results.json.partial").write_text(text)
        (out / "results.json.partial").replace(out / "results.json")
    return results


def _run(part: Part, plan: Plan, work: Path, out: Path, log, limit: float) -> dict:
    """Runs one part; what it said and measured."""
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    environment = os.environ | {
        "PYTHONPATH": os.pathsep.join(paths), "PYTHONUNBUFFERED": "1", "MPLBACKEND": "Agg",
        "POINTGLASS_CACHE": str(work / "cache"),
    }
    if plan is not DRY:
        environment["POINTGLASS_EXPECT_GPU"] = "1"
    log.write(f"\n== {part.name}, at most {limit:.0f} s\n")
    log.flush()
    begun = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, *part.command(plan, work)], cwd=ROOT, env=environment, start_new_session=True,
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, text=True, errors="replace",
    )
    try:
        said, output = "", process.communicate(timeout=limit)[0]
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)  # its own session: children too
        output = process.communicate()[0]
        said = f"cut short after {limit:.0f} s"
    seconds = time.monotonic() - begun
    log.write(output)
    log.flush()
    if not said:
        said = "done" if process.returncode == 0 else f"failed ({process.returncode})"
    result = None
    try:
        if part.json:
            result = json.loads((work / part.json).read_text())
        elif part.json is None:
            result = json.loads(output[output.index("{") :])
        elif output.strip():
            result = output.strip().splitlines()[-1]
    except (OSError, ValueError) as error:
        said = f"{said}, no result ({error})"
    if part.plot and (work / part.plot).is_file():
        shutil.copyfile(work / part.plot, out / part.plot)
    return {"seconds": round(seconds, 1), "said": said, "result": result}


def _machine() -> dict:
    """Without any library: the system, and what nvidia-smi says."""
    query = ["nvidia-smi", "--query-gpu=name,driver_version,memory.total", "--format=csv,noheader"]
    try:
        gpu = subprocess.run(query, capture_output=True, text=True, timeout=30).stdout.strip() or None
    except (OSError, subprocess.SubprocessError):
        gpu = None
    return {"system": platform.platform(), "python": platform.python_version(), "cores": os.cpu_count(), "gpu": gpu}


# -- workers, each in a process of its own ---------------------------------------------------------------------------


def make_scan(plan: Plan, work: Path) -> dict:
    """The benches' scan, as a folder that `pointglass` opens."""
    from viewer.bench.procedural_scan import ProceduralScan, procedural_scene

    begun = time.perf_counter()
    scan = ProceduralScan(plan.points)
    scene = procedural_scene(scan, work / "scan")
    return {"scan": scan.label, "points": scene.count, "seconds": time.perf_counter() - begun}


def projected(plan: Plan, _work: Path) -> dict:
    """Both compute passes over a whole scan, by timer queries: milliseconds by named view, with the points drawn in each."""
    from statistics import median

    from viewer.bench.procedural_scan import ProceduralScan, procedural_scene
    from viewer.bench.subject import machine
    from viewer.bench.views import named_views
    from viewer.render.context import create_context
    from viewer.render.renderer import Renderer
    from viewer.settings import Settings

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
            "cull_ms": median(stats["stages"]["cull"] for stats in spent),
            "ms_per_100M": milliseconds * 1e8 / max(points, 1), "approximations": spent[0]["approximations"],
        })
    most = max(rows, key=lambda row: row["points"])
    facts = {"opengl": renderer.device.renderer, "driver": renderer.device.version}
    renderer.release()
    context.release()
    return {"scan": scan.label, "size": list(size), **facts, "machine": machine(), "most": most, "views": rows}


def engines(plan: Plan, _work: Path) -> dict:
    """The network's time by engine, and the bridge's by kind, at every size; each with what stopped it where it failed."""
    import torch

    from model.engines import ENGINES, Runner
    from model.reconstruct import PACKED_IN, PACKED_OUT, Reconstructor
    from model.unet import mac_per_pixel, make_network
    from model.weights import shipped
    from viewer.bench.subject import machine
    from viewer.errors import DeviceError
    from viewer.render.bridge import ReadBackBridge
    from viewer.render.context import create_context
    from viewer.render.cuda_bridge import MAPPERS, CudaBridge
    from viewer.render.shader import Programs

    on_gpu = plan.device == "cuda"
    begun = time.perf_counter()
    found: dict = {"machine": machine(), "network": [], "bridge": []}

    def measured(work: Callable[[], object]) -> float:
        """Milliseconds, the middle of the runs."""
        for _ in range(3):
            work()
        spent = []
        for _ in range(plan.repeats):
            if on_gpu:
                start, stop = torch.cuda.Event(enable_timing=True), torch.cuda.Event(enable_timing=True)
                start.record()
                work()
                stop.record()
                stop.synchronize()
                spent.append(start.elapsed_time(stop))
            else:
                start_s = time.perf_counter()
                work()
                spent.append((time.perf_counter() - start_s) * 1e3)
        return sorted(spent)[len(spent) // 2]

    qualities = [q for q in ("balanced", "fast", "best") if f"{q}-filtered" in shipped()]
    jobs = [(q, size, engine, False) for size in plan.sizes for q in qualities for engine in ("eager", "graph")]
    middle = plan.sizes[min(1, len(plan.sizes) - 1)]
    jobs += [("balanced", middle, *last) for last in (("graph", True), ("tensorrt", False), ("compile", False))]
    networks: dict[str, Reconstructor] = {}
    costs: dict[str, float] = {}
    for quality, size, engine, tuned in jobs if on_gpu else jobs[:1]:
        width, height = (int(side) for side in size.split("x"))
        row: dict = {"quality": quality, "size": [width, height], "engine": engine, "cudnn_benchmark": tuned}
        found["network"].append(row)
        try:
            network = networks.setdefault(quality, Reconstructor(quality, filtered=True, device=plan.device))
            torch.backends.cudnn.benchmark = tuned
            runner = Runner(network, height, width, engine=engine)
            packed = torch.rand((height, width, PACKED_IN), generator=torch.Generator().manual_seed(1)).half().to(plan.device)
            with torch.inference_mode():
                gap = (runner(packed).float() - network.made(packed).float()).abs().max().item()
            row |= {"runs": ENGINES[runner.engine], "problem": runner.problem, "largest_difference": gap}
            row["ms"] = measured(lambda runner=runner, packed=packed: runner(packed))
            row["mac_per_pixel"] = costs.get(quality) or costs.setdefault(quality, mac_per_pixel(make_network(quality), 64))
            runner.release()
        except Exception as error:  # one engine that fails does not end the rest
            row["problem"] = f"{type(error).__name__}: {str(error).strip().splitlines()[0] if str(error).strip() else ''}"
        row["at_s"] = round(time.perf_counter() - begun, 1)
        print(row, file=sys.stderr)

    class Through:
        """Costs nothing but its pixels."""

        device = plan.device

        def __call__(self, packed):
            return packed[..., :PACKED_OUT]

    programs = Programs(create_context())
    for size in plan.sizes:
        width, height = (int(side) for side in size.split("x"))
        for kind in (*(MAPPERS if on_gpu else ()), "read-back"):
            row = {"kind": kind, "size": [width, height]}
            found["bridge"].append(row)
            try:
                bridge = (ReadBackBridge(programs.context, (width, height)) if kind == "read-back"
                          else CudaBridge(programs, (width, height), (kind,)))
                spent = []
                for _ in range(plan.repeats + 3):
                    programs.context.finish()
                    start = time.perf_counter()
                    bridge.run(Through())
                    programs.context.finish()
                    if on_gpu:
                        torch.cuda.synchronize()
                    spent.append((time.perf_counter() - start) * 1e3)
                row["ms"] = sorted(spent[3:])[len(spent[3:]) // 2]
                bridge.release()
            except DeviceError as error:
                row["problem"] = str(error)
    return found


WORKERS = {"scan": make_scan, "projected": projected, "engines": engines}

if __name__ == "__main__":
    sys.exit(main())
