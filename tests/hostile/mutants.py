"""A mutant: a seed and a few edits of its files, each described by numbers, so that it can be made again and made smaller."""

import random
from dataclasses import dataclass

from .forms import edited
from .seed import Seed
from .seeds import seeds

_FEWEST = (1, 1, 1, 2, 2, 3, 5)
"""Numbers of edits, each as likely as the others."""


@dataclass(frozen=True)
class Edit:
    """file: path in the seed's folder.  number: seed of the edit's choices.  gone: the file is removed."""

    file: str
    number: int
    gone: bool = False


@dataclass(frozen=True)
class Mutant:
    """number: of its run's format, counted from 0."""

    number: int
    seed: Seed
    edits: tuple[Edit, ...]

    def changed(self) -> dict[str, bytes | None]:
        """The files that differ from the seed's; None: removed."""
        out: dict[str, bytes | None] = {}
        for edit in self.edits:
            data = out.get(edit.file, self.seed.files[edit.file])
            if edit.gone:
                out[edit.file] = None
            elif data is not None:
                out[edit.file] = edited(edit.file, data, random.Random(edit.number))
        return {name: data for name, data in out.items() if data != self.seed.files[name]}


def mutant(form: str, run: int, number: int) -> Mutant:
    """The mutant of a format with this number, in the run with this seed."""
    rng = random.Random(f"{run}/{form}/{number}")
    seed = rng.choice(seeds(form))
    names = [name for name in seed.files if name not in seed.untouched]
    tops = [name for name in names if "/" not in name]
    edits = []
    for _ in range(rng.choice(_FEWEST)):
        name = rng.choice(tops if tops and rng.random() < 0.6 else names)  # not nearly always one of the many nodes
        edits.append(Edit(name, rng.getrandbits(48), len(names) > 1 and rng.random() < 0.02))
    return Mutant(number, seed, tuple(edits))
