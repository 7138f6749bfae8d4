"""E57 to E57: every node and record, read back with libe57 alone."""

import pytest
from e57_files import contents, random_e57
from examples import examples

from pointglass.viewer import cli


def export(*arguments):
    assert cli.main(["export", "--no-cache", *map(str, arguments)]) == 0


@pytest.mark.parametrize("seed", range(examples(8)))
def test_every_value_of_every_record_is_copied(tmp_path, seed):
    random_e57(tmp_path / "a.e57", seed)
    export(tmp_path / "a.e57", "--out", tmp_path / "b.e57")
    a, b = contents(tmp_path / "a.e57"), contents(tmp_path / "b.e57")
    for found in (a, b):
        found.pop("/e57LibraryVersion")
    assert list(a) and a.keys() == b.keys()
    assert [key for key in a if a[key] != b[key]] == []
