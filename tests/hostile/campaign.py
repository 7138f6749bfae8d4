"""Runs mutants of formats, counts outcomes, and minimises and keeps the first failure of each cause."""

import os
import sys
from collections import Counter
from pathlib import Path

from .exercise import prepare
from .fork_server import FAILURES, ForkServer, Outcome
from .minimise import keep, minimised, signature
from .mutants import mutant
from .seeds import seeds


class Campaign:
    """folder: for files while they are read.  run: the seed.  kept: folder for failures; None: they are only counted."""

    def __init__(self, folder: Path, run: int, kept: Path | None):
        self._run, self._kept = run, kept
        self.server = ForkServer(folder / "scan")
        self.counts: Counter[tuple[str, str]] = Counter()
        self.failures: Counter[str] = Counter()
        self.most_memory = 0
        self._ready: set[str] = set()
        os.environ["POINTGLASS_CACHE"] = str(folder / "cache")
        os.environ["POINTGLASS_STATE"] = str(folder / "state")
        prepare()

    def run(self, form: str, first: int, count: int) -> list[tuple[int, Outcome]]:
        """Reads ``count`` mutants of a format from number ``first`` on; returns those that failed."""
        self.warm(form)
        mutants = [mutant(form, self._run, first + i) for i in range(count)]
        failed = []
        for made, outcome in zip(mutants, self.server.run(mutants), strict=True):
            self.counts[form, outcome.kind] += 1
            self.most_memory = max(self.most_memory, outcome.memory)
            if not outcome.failed:
                continue
            failed.append((made.number, outcome))
            cause = f"{form}: {signature(outcome)}"
            self.failures[cause] += 1
            if self.failures[cause] == 1:
                print(f"{form} {made.number} of seed {self._run}: {outcome.kind}: {outcome.said}", file=sys.stderr, flush=True)
                if self._kept is not None:
                    place = keep(self._kept, made, minimised(self.server, made, outcome), outcome, self._run)
                    print(f"  kept in {place}", file=sys.stderr, flush=True)
        return failed

    def warm(self, form: str) -> None:
        """Reads the seeds as they are in this process, so that libraries are loaded and loops compiled.  Once."""
        if form in self._ready:
            return
        if form != "las" and seeds(form)[0].kind == "scan":
            self.warm("las")
        for seed in seeds(form):
            for number in range(4):
                if any(name.endswith(".laz") for name in seed.files):  # lazrs' threads, once started, are missing in every fork
                    self.server.check(seed, {}, number)
                else:
                    self.server.warm(seed, number)
        self._ready.add(form)

    def line(self) -> str:
        """The counts in one line."""
        kinds = Counter()
        for (_, kind), count in self.counts.items():
            kinds[kind] += count
        causes = len(self.failures)
        failed = ", ".join(f"{kinds[kind]:,} {kind}" for kind in FAILURES)
        good = f"{kinds['read']:,} read, {kinds['refused']:,} refused in one line"
        return f"{sum(kinds.values()):,} mutants: {good}, {failed} ({causes} causes), at most {self.most_memory / 1e6:.0f} MB"

    def table(self) -> str:
        """The counts by format, and the causes of failures."""
        rows = []
        for form in dict.fromkeys(form for form, _ in self.counts):
            kinds = {kind: self.counts[form, kind] for kind in ("read", "refused", *FAILURES)}
            rows.append(
                f"{form:<11} {sum(kinds.values()):>9,}: " + ", ".join(f"{n:,} {kind}" for kind, n in kinds.items() if n)
            )
        rows += [f"{count:>6} x {cause}" for cause, count in self.failures.most_common()]
        return "\n".join(rows)
