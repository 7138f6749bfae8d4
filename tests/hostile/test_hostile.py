"""Mutants of every file that the program reads are read, or refused in one line: no traceback, no signal, no hang, and memory
in proportion to the file.  Mutants that failed once are replayed."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from .campaign import Campaign
from .fork_server import Given
from .minimise import kept_case, reduced
from .mutants import mutant
from .seeds import FORMATS, KEPT, seeds

MUTANTS = 200
"""Of each format; ``python -m tests.hostile`` makes any number."""
ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    """In memory where the system has a folder there."""
    patch = pytest.MonkeyPatch()
    for name in ("POINTGLASS_CACHE", "POINTGLASS_STATE"):
        patch.setenv(name, str(tmp_path_factory.mktemp("state")))
    yield Campaign(tmp_path_factory.mktemp("hostile"), 1, None)
    patch.undo()


@pytest.mark.parametrize("form", FORMATS)
def test_mutants_are_read_or_refused_in_one_line(campaign, form):
    failed = campaign.run(form, 0, MUTANTS)
    assert failed == [], f"python -m tests.hostile --minutes 0 --seed 1 --mutants {MUTANTS} --formats {form}"
    kinds = {kind: count for (of, kind), count in campaign.counts.items() if of == form}
    assert kinds.get("refused", 0) + kinds["read"] == MUTANTS and kinds["read"] > 0
    assert kinds.get("refused", 0) > 0 or form == "state"  # which is set aside, and never refused


def test_the_seeds_are_good(campaign):
    """In every way that mutants are read in."""
    for form in FORMATS:
        given = [Given(number, seed, {}) for seed in seeds(form) for number in range(4)]
        bad = [(case.seed.name, outcome) for case, outcome in zip(given, campaign.server.run(given)) if outcome.kind != "read"]
        assert bad == []


def test_mutants_that_failed_once_do_not_fail_again(campaign):
    places = sorted(KEPT.glob("*/"))
    for place in places:
        campaign.warm(json.loads((place / "case.json").read_text())["format"])
    outcomes = campaign.server.run([Given(number, seed, changed) for seed, changed, number in map(kept_case, places)])
    assert [(place.name, outcome) for place, outcome in zip(places, outcomes) if outcome.failed] == []


def test_a_seed_gives_the_same_mutants():
    for form in ("e57", "like", "grid"):
        first, again, other = ([mutant(form, run, number).changed() for number in range(20)] for run in (5, 5, 6))
        assert first == again and first != other
    script = (
        "import hashlib; from tests.hostile.mutants import mutant as m; "
        "print(hashlib.sha256(repr([m(f, 5, n).changed() for f in ('e57', 'laz') for n in range(9)]).encode()).hexdigest())"
    )
    said = {
        subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    }
    assert len(said) == 1


@pytest.mark.parametrize(("code", "kind"), [
    ("raise KeyError('x')", "traceback"), ("import os; os.abort()", "signal"), ("import sys; sys.exit(0)", "traceback"),
    ("import numpy as np; np.ones(1_300_000_000, 'u1').sum()", "memory"), ("bytearray(8 << 30)", "memory"),
    ("print('a line of a library')", "noise"), ("while True: pass", "hang"), ("import os; os._exit(0)", "signal"),
])  # fmt: skip
def test_failures_of_every_kind_are_seen(campaign, monkeypatch, code, kind):
    """The fuzzer itself: what a reader might do wrong."""
    from . import exercise, fork_server

    if kind == "hang":
        monkeypatch.setattr(fork_server, "SECONDS", 1)
    monkeypatch.setitem(exercise.KINDS, "like", lambda *_: exec(code))
    assert campaign.server.check(seeds("like")[0], {}, 0).kind == kind


def test_a_failing_list_is_reduced_to_what_is_needed():
    assert reduced(list(range(40)), lambda part: {7, 30} <= set(part)) == [7, 30]
