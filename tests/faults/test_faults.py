"""A few faults of each kind; ``make faults`` makes hundreds."""

import random

import pytest

from .kinds import KINDS, MOUNTS, skipped
from .product import make_product

FEW = ("interrupt/video", "kill/convert", "disk/export-e57", "disk/convert", "disk/log", "memory/info",
       "memory/export-laz", "pipe/info", "two/cache", "read-only/export-laz")  # fmt: skip


@pytest.fixture(scope="module")
def product(tmp_path_factory):
    return make_product(tmp_path_factory.mktemp("given"))


@pytest.mark.parametrize("kind", FEW)
def test_a_fault_ends_in_one_line_and_leaves_nothing(product, tmp_path, seed, kind):
    if kind in MOUNTS and (reason := skipped()):
        pytest.skip(reason)
    assert next(KINDS[kind](product, tmp_path, random.Random(f"{seed}/{kind}"))) == ""
