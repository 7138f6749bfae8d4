"""LAS to LAS: whole records, read back with laspy alone."""

import laspy
import numpy as np
import pytest
from examples import examples
from las_files import WAVEFORMS, facts, random_las, records

from pointglass.viewer import cli


def export(*arguments):
    assert cli.main(["export", "--no-cache", *map(str, arguments)]) == 0


def raw(path):
    return laspy.read(path).points.array


@pytest.mark.parametrize("seed", range(examples(4)))
@pytest.mark.parametrize(("ending", "to"), [("las", "las"), ("laz", "laz"), ("las", "laz"), ("laz", "las")])
def test_every_value_of_every_record_is_copied(tmp_path, seed, ending, to):
    rng = np.random.default_rng([seed, len(to), len(ending)])
    formats = [n for n in range(11) if n not in WAVEFORMS or "laz" not in (ending, to)]
    source = tmp_path / f"a.{ending}"
    random_las(source, rng.integers(2**31), point_format=int(rng.choice(formats)))
    export(source, "--out", tmp_path / f"b.{to}")
    a, b = raw(source), raw(tmp_path / f"b.{to}")
    assert a.dtype == b.dtype and a.tobytes() == b.tobytes()
    assert records(source) == records(tmp_path / f"b.{to}")
    assert facts(source) == facts(tmp_path / f"b.{to}")
