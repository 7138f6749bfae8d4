"""``python -m tests.faults [--times N] [--seed S] [--kinds KIND ...]``: disturbs commands, and prints a line for each kind.

The exit code is 1 where a promise was broken.  The same seed draws the same times and signals; what they meet depends on the
machine.
"""

import argparse
import random
import signal
import sys
import tempfile
import time
from pathlib import Path

from .kinds import KINDS, MOUNTS, skipped
from .product import make_product


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("--times", type=int, default=200, help="interrupts of each command; a tenth of it for other faults")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", choices=[*KINDS, *{kind.partition("/")[0] for kind in KINDS}], metavar="KIND",
                        default=list(KINDS), help=", ".join(KINDS))  # fmt: skip
    parser.add_argument("--minutes", type=float, default=float("inf"), help="begin no further case after so long")
    options = parser.parse_args()
    for stop in (signal.SIGINT, signal.SIGTERM):  # also in the background of a shell, which ignores the first
        signal.signal(stop, signal.default_int_handler)
    chosen = [kind for kind in KINDS if any(kind == given or kind.startswith(f"{given}/") for given in options.kinds)]
    end, failures = time.monotonic() + 60 * options.minutes, 0
    with tempfile.TemporaryDirectory(prefix="faults-") as folder:
        product = make_product(Path(folder) / "given")
        for kind in chosen:
            if kind in MOUNTS and (reason := skipped()):
                print(f"{kind}: skipped, {reason}", flush=True)
                continue
            often = options.times if kind.partition("/")[0] in ("interrupt", "save") else max(1, options.times // 10)
            wrong, done = [], 0
            for said in KINDS[kind](product, Path(folder) / "work", random.Random(f"{options.seed}/{kind}")):
                done += 1
                if said:
                    wrong.append(said)
                    print(f"  {kind} {done}: {said}", file=sys.stderr, flush=True)
                if done >= often or time.monotonic() > end:
                    break
            failures += len(wrong)
            print(f"{kind}: {done} times, {len(wrong)} failed", flush=True)
            if time.monotonic() > end:
                break
    return int(failures > 0)


if __name__ == "__main__":
    sys.exit(main())
