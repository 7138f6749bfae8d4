"""LAS to LAS: whole records, read back with laspy alone."""

import laspy
import numpy as np
import pytest
from examples import examples
from las_files import facts, random_las, records

from pointglass.viewer import cli
from pointglass.viewer.commands.exporting.formats import las_copy


def export(*arguments):
    assert cli.main(["export", "--no-cache", *map(str, arguments)]) == 0


def raw(path):
    return laspy.read(path).points.array


@pytest.mark.parametrize("seed", range(examples(4)))
@pytest.mark.parametrize("path", ["bytes", "records"])
@pytest.mark.parametrize(("ending", "to"), [("las", "las"), ("laz", "laz"), ("las", "laz"), ("laz", "las")])
def test_every_value_of_every_record_is_copied(tmp_path, monkeypatch, seed, path, ending, to):
    """path: records go through the writer that selections use; without one a file of the same format is copied as it is."""
    rng = np.random.default_rng([seed, ord(to[-1]), ord(ending[-1])])
    formats = [n for n in range(11) if n not in (9, 10) or "laz" not in (ending, to)]
    source = tmp_path / f"a.{ending}"
    if path == "records":
        monkeypatch.setattr("pointglass.viewer.commands.exporting.targets.can_copy_file", lambda *_: False)
    random_las(source, rng.integers(2**31), point_format=int(rng.choice(formats)))
    export(source, "--out", tmp_path / f"b.{to}")
    a, b = raw(source), raw(tmp_path / f"b.{to}")
    assert a.dtype == b.dtype and a.tobytes() == b.tobytes()
    assert records(source) == records(tmp_path / f"b.{to}")
    assert facts(source) == facts(tmp_path / f"b.{to}")


@pytest.mark.parametrize("channels", [1, 4])
def test_waveforms_are_compressed_without_loss_or_refused(tmp_path, capsys, monkeypatch, channels):
    source, rng = tmp_path / "a.las", np.random.default_rng(channels)
    random_las(source, 3, point_format=9, count=2000)
    las = laspy.read(source)
    las.scanner_channel = rng.integers(0, channels, len(las))
    las.write(str(source))
    code = cli.main(["export", "--no-cache", str(source), "--out", str(tmp_path / "b.laz")])
    if channels == 1:
        assert code == 0 and raw(tmp_path / "b.laz").tobytes() == raw(source).tobytes()
    else:
        assert code == 2 and "ends in .las" in capsys.readouterr().err and not (tmp_path / "b.laz").exists()
        monkeypatch.setattr(las_copy, "_selected", None)  # refused before the records are read
        assert cli.main(["export", "--no-cache", str(source), "--out", str(tmp_path / "b.laz")]) == 2
        las.write(str(tmp_path / "packed.laz"))
        clip = ("--clip", "-9e9,-9e9,-9e9,9e9,9e9,9e9", "--out", str(tmp_path / "d.las"))
        assert cli.main(["export", "--no-cache", str(tmp_path / "packed.laz"), *clip]) == 2
        assert "laszip -i" in capsys.readouterr().err and not (tmp_path / "d.las").exists()
        monkeypatch.undo()
    export(source, "--clip", "-9e9,-9e9,-9e9,9e9,9e9,9e9", "--out", tmp_path / "c.las")
    assert raw(tmp_path / "c.las").tobytes() == raw(source).tobytes()
