"""Makes a failing mutant smaller (delta debugging), and keeps it as a folder of ``kept``, which the tests replay."""

import hashlib
import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path

from .fork_server import ForkServer, Outcome
from .mutants import Mutant
from .seed import Seed
from .seeds import seeds

LARGEST_KEPT = 20_000
"""Bytes; of a larger fixture the edits are kept, not the files."""
_TRIES = 150


def signature(outcome: Outcome) -> str:
    """What is the same of failures of one cause: without numbers and names of files."""
    said = outcome.said.partition(": ")[0] if outcome.kind in ("traceback", "memory") else outcome.said[:60]
    return re.sub(r"\d[\d,.]*|/\S+", "#", f"{outcome.kind} {said}")


def reduced(items: Sequence, fails: Callable[[Sequence], bool]) -> list:
    """The smallest part of ``items`` found with which ``fails`` still holds (ddmin).  It holds for all of them."""
    items, parts = list(items), 2
    while len(items) > 1:
        size = -(-len(items) // parts)
        for start in range(0, len(items), size):
            rest = items[:start] + items[start + size :]
            if rest and fails(rest):
                items, parts = rest, max(parts - 1, 2)
                break
        else:
            if parts >= len(items):
                break
            parts = min(2 * parts, len(items))
    return items


def minimised(server: ForkServer, mutant: Mutant, outcome: Outcome) -> dict[str, bytes | None]:
    """The changed files of a mutant that fails the same way, with as little changed as was found in _TRIES tries."""
    wanted, tries = signature(outcome), [0]

    def fails(changed: dict[str, bytes | None]) -> bool:
        tries[0] += 1
        return tries[0] <= _TRIES and signature(server.check(mutant.seed, changed, mutant.number)) == wanted

    edits = reduced(mutant.edits, lambda part: fails(Mutant(mutant.number, mutant.seed, tuple(part)).changed()))
    changed = Mutant(mutant.number, mutant.seed, tuple(edits)).changed()
    for name, data in list(changed.items()):
        good = mutant.seed.files[name]
        if data is None or len(data) != len(good):
            continue
        places = [i for i, (a, b) in enumerate(zip(data, good)) if a != b]

        def mixed(kept: Sequence[int], data: bytes = data, good: bytes = good) -> bytes:
            out = bytearray(good)
            for place in kept:
                out[place] = data[place]
            return bytes(out)

        kept = reduced(places, lambda part, name=name: fails({**changed, name: mixed(part)}))
        changed[name] = mixed(kept)
    return changed


def keep(folder: Path, mutant: Mutant, changed: dict[str, bytes | None], outcome: Outcome, run: int) -> Path:
    """Writes a fixture and returns its folder."""
    seed = mutant.seed
    name = hashlib.sha256(repr(sorted(changed.items())).encode()).hexdigest()[:8]
    place = folder / f"{seed.format}-{re.sub(r'[^a-z0-9]+', '_', seed.name.lower())}-{name}"
    place.mkdir(parents=True, exist_ok=True)
    small = sum(len(data or b"") for data in changed.values()) <= LARGEST_KEPT
    case = {
        "format": seed.format,
        "seed": seed.name,
        "number": mutant.number,
        "run": run,
        "was": f"{outcome.kind}: {outcome.said[:200]}",
        "removed": [name for name, data in changed.items() if data is None] if small else None,
    }
    (place / "case.json").write_text(json.dumps(case, indent=1) + "\n")
    for name, data in changed.items() if small else ():
        if data is not None:
            (place / "files" / name).parent.mkdir(parents=True, exist_ok=True)
            (place / "files" / name).write_bytes(data)
    return place


def kept_case(place: Path) -> tuple[Seed, dict[str, bytes | None], int]:
    """The seed, the changed files and the number of a fixture."""
    case = json.loads((place / "case.json").read_text())
    seed = next(seed for seed in seeds(case["format"]) if seed.name == case["seed"])
    if case["removed"] is None:
        from .mutants import mutant

        return seed, mutant(case["format"], case["run"], case["number"]).changed(), case["number"]
    files = place / "files"
    changed: dict[str, bytes | None] = dict.fromkeys(case["removed"])
    changed |= {str(file.relative_to(files)): file.read_bytes() for file in files.rglob("*") if file.is_file()}
    return seed, changed, case["number"]
