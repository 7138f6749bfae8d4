"""``python -m tests.hostile --minutes N --seed S [--formats las e57 ...] [--keep DIR]``: reads mutants of every file that the
program reads, and prints how many were read, refused in one line, or failed.  The exit code is 1 where one failed.

The same seed gives the same mutants.  Failures are minimised and kept in DIR, the first of each cause.
"""

import argparse
import os
import signal
import sys
import tempfile
import time
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = os.environ["OMP_NUM_THREADS"] = "1"  # a fork has only one thread

from .campaign import Campaign
from .seeds import FORMATS, KEPT


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.hostile", description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("--minutes", type=float, default=1.0, help="how long; 0: until --mutants")
    parser.add_argument("--mutants", type=int, default=None, help="how many of each format at most")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--first", type=int, default=0, help="number of the first mutant of each format")
    parser.add_argument(
        "--formats", nargs="+", choices=FORMATS, default=list(FORMATS), metavar="FORMAT", help=", ".join(FORMATS)
    )
    parser.add_argument("--keep", type=Path, default=KEPT, help="folder for minimised failures (default: %(default)s)")
    parser.add_argument("--every", type=float, default=60.0, help="seconds between lines about progress")
    options = parser.parse_args()
    for stop in (signal.SIGINT, signal.SIGTERM):  # also in the background of a shell, which ignores the first
        signal.signal(stop, signal.default_int_handler)
    memory = Path("/dev/shm")
    begun = last = time.monotonic()
    end = begun + 60 * options.minutes if options.minutes else float("inf")
    with tempfile.TemporaryDirectory(prefix="hostile-", dir=memory if memory.is_dir() else None) as folder:
        campaign = Campaign(Path(folder), options.seed, options.keep)
        number = options.first
        try:
            while time.monotonic() < end and (options.mutants is None or number < options.first + options.mutants):
                for form in options.formats:
                    count = 40 if options.mutants is None else min(40, options.first + options.mutants - number)
                    campaign.run(form, number, count)
                    if time.monotonic() - last > options.every:
                        last = time.monotonic()
                        print(f"{(last - begun) / 60:.1f} min: {campaign.line()}", flush=True)
                    if time.monotonic() > end:
                        break
                number += 40
        except KeyboardInterrupt:
            print("stopped", file=sys.stderr)
    print(campaign.table())
    print(f"{campaign.line()}, in {(time.monotonic() - begun) / 60:.1f} min")
    return int(any(campaign.failures.values()))


if __name__ == "__main__":
    sys.exit(main())
