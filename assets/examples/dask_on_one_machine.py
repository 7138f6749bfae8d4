"""Starts a Dask scheduler with two workers on this machine, and renders pictures of a scan with them.

    pip install 'pointglass[dask]'
    python assets/examples/dask_on_one_machine.py out/dask

On several machines `dask scheduler` runs on one, and `dask worker tcp://HOST:8786 --nthreads N` on each, which then renders N
pictures at a time.  All see the scan, the folder of --out and the present folder under the same paths, and have one version of
pointglass.
"""

import subprocess
import sys
from pathlib import Path

import pointglass


def main(out: Path) -> None:
    from distributed import LocalCluster

    out.mkdir(parents=True, exist_ok=True)
    keys = [pointglass.look_at((4.8 - 0.3 * n, 3.2, 1.55), (3.0, 2.0, 1.2), fov=60, size=(160, 120), name=f"view_{n}")
            for n in range(4)]  # fmt: skip
    pointglass.write_cameras(out / "transforms.json", keys)
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:
        command = [sys.executable, "-m", "pointglass.viewer", "render", pointglass.demo_scan(), "--cameras",
                   out / "transforms.json", "--view", "filled", "--out", out, "--scheduler", cluster.scheduler_address,
                   "--verbose"]  # fmt: skip
        done = subprocess.run([str(word) for word in command], check=True, capture_output=True, text=True)
    print(*(line for line in done.stderr.splitlines() if "Dask:" in line), sep="\n")
    print(done.stdout.strip())


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "out/examples/dask"))
