"""Methods and networks of one's own in both evaluations, by the command line, and what is said of those that do not fit."""

import csv
import json
import sys

import numpy as np
import pytest
import torch
from evaluation_files import film_room
from PIL import Image
from rooms import make_room
from scannetpp_files import write_scannetpp
from walls import straight_view, wall_scan

import pointglass.model.evaluation.paper_table as table
from pointglass.model.common.errors import DataError
from pointglass.model.data.images.photo_place import PhotoPlace
from pointglass.model.evaluation.own_methods import own_methods, own_networks
from pointglass.model.evaluation.paper_methods import scaled_colour
from pointglass.model.evaluation.paper_report import write_latex
from pointglass.viewer.cli import main

pytestmark = pytest.mark.usefixtures("one_thread")

PROGRAM = '''
"""A nearest point in each pixel, by NumPy alone, and two networks."""
import numpy as np
import torch

def nearest(scan, camera):
    to_camera = np.linalg.inv(camera.camera_to_world)
    x, y, z = (scan.xyz @ to_camera[:3, :3].T + to_camera[:3, 3]).T * [[1], [-1], [-1]]
    u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
    picture = np.zeros((camera.height, camera.width, 3), np.uint8)
    there = (z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)
    far_to_near = np.argsort(-z[there])
    picture[v[there][far_to_near].astype(int), u[there][far_to_near].astype(int)] = scan.rgb[there][far_to_near]
    return picture

def grey(scan, camera):
    return torch.full((camera.height, camera.width, 3), 0.5)

def wrong_size(scan, camera):
    return np.zeros((3, 2, 1))

def broken(scan, camera):
    return scan.nothing

class Filled(torch.nn.Module):
    def forward(self, given):
        assert given.shape[1] == 6 and given.dtype == torch.float32
        return given[:, :3]

def flat():
    return torch.nn.Flatten()

number = 5
'''


@pytest.fixture
def program(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(PROGRAM)
    return path


@pytest.fixture
def without_lpips(monkeypatch):
    monkeypatch.setitem(sys.modules, "lpips", None)
    monkeypatch.setitem(sys.modules, "torchmetrics", None)


@pytest.mark.slow
def test_a_room_is_evaluated_with_a_function_and_a_network_of_ones_own(tmp_path, program, capsys):
    room, figures = film_room(tmp_path / "room"), tmp_path / "f.json"
    own = ["--method", f"mine={program}:nearest", "--method", f"grey={program}:grey", "--network", f"same={program}:Filled"]
    assert main(["evaluate", str(room), "--exposures", "scanned", *own, "--json", str(figures), "--frames", "2"]) == 0
    found = json.loads(figures.read_text())
    rows = {(row["method"], row["density"]): row for row in found["rows"]}
    filled = next(row for (name, density), row in rows.items() if "view-dependent" in name and density == 1)
    assert rows["same", 1.0]["psnr"] == pytest.approx(filled["psnr"], abs=1e-6)  # it returns its input's colours
    assert rows["same", 1.0]["against_filled"]["ratio"] == pytest.approx(1)
    assert rows["mine", 1.0]["psnr"] == pytest.approx(rows["raw", 1.0]["psnr"], abs=1.5)
    assert rows["mine", 1.0]["psnr"] > rows["mine", 0.1]["psnr"]
    assert rows["grey", 1.0]["psnr"] < 20 and rows["mine", 1.0]["ms"] > 0 and rows["grey", 1.0]["ms"] > 0
    assert {row["method"] for row in found["flicker"]} >= {"mine", "grey", "same"}
    assert found["seed"] == 11 and found["version"] and all(len(held["sha256"]) == 12 for held in found["weights"].values())
    assert "mine" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize(("option", "given", "said"), [
    ("--method", "mine", "expected NAME=FILE.py:OBJECT"), ("--method", "mine={0}", "expected NAME=FILE.py:OBJECT"),
    ("--method", "mine={0}:missing", "no function missing in mine.py; it has "),
    ("--method", "mine={0}:number", "no function number"),
    ("--method", "mine=nowhere.py:f", "nowhere.py: no such file"), ("--network", "mine={0}:grey", "TypeError at "),
    ("--method", "mine={0}:wrong_size", "expected a picture (36, 48, 3), found (3, 2, 1)"),
    ("--method", "mine={0}:broken", "AttributeError at mine.py, line 23"),
    ("--network", "mine={0}:flat", "expected (1, 3 or more, 36, 48), found (1, "),
    ("--method", "raw={0}:nearest", "a method of the name 'raw' is compared already"),
])  # fmt: skip
def test_what_does_not_fit_is_one_line(tmp_path, program, capsys, option, given, said):
    room = film_room(tmp_path / "room")
    assert main(["evaluate", str(room), "--views", "1", "--fast" if "raw=" not in given else "--no-flicker", option,
                 given.format(program)]) == 2
    error = capsys.readouterr().err
    assert said in error and len(error.strip().splitlines()) == 1


def test_a_file_that_cannot_be_run_is_named(tmp_path):
    path = tmp_path / "bad.py"
    path.write_text("import nothing_of_this_name\n")
    with pytest.raises(DataError, match=r"bad\.py: cannot be run: ModuleNotFoundError"):
        own_methods([f"a={path}:f"])
    path.write_text("def f():\n    return 3\n")
    with pytest.raises(DataError, match=r"expected a torch\.nn\.Module, found int"):
        own_networks([f"a={path}:f"])
    with pytest.raises(DataError, match="the name 'a' is given twice"):
        own_methods([f"a={path}:f", f"a={path}:f"])


@pytest.fixture
def two_places():
    return [PhotoPlace(name, wall_scan(40_000), [straight_view(n, 128, 96, 80.0) for n in numbers])
            for name, numbers in (("hall", (0, 3)), ("attic", (5,)))]


SMALL = {"sizes": ((96, 72),), "densities": (1.0, 0.1), "precision": "fp32", "repeats": 1}


def test_the_papers_table_has_a_row_of_each_picture_place_and_method(two_places, program, tmp_path, without_lpips):
    own, networks = own_methods([f"mine={program}:nearest"]), own_networks([f"same={program}:Filled"])
    result = table.paper_table(two_places, {}, functions=own, networks=networks, **SMALL)
    assert result["complete"] and result["places"] == ["hall", "attic"]
    keys = [(row["place"], row["view"], row["method"], row["density"]) for row in result["pictures"]]
    assert sorted(keys) == sorted((place, view, method, density) for place, views in (("hall", "01"), ("attic", "0"))
                                  for view in views for method in (table.NO_NETWORK, "mine", "same") for density in (1.0, 0.1))
    for row in result["rows"]:
        same = [p for p in result["pictures"] if (p["method"], p["density"]) == (row["method"], row["density"])]
        assert row["psnr"] == pytest.approx(np.mean([p["psnr"] for p in same])) and row["views"] == 3
        scenes = [s for s in result["scenes"] if (s["method"], s["density"]) == (row["method"], row["density"])]
        assert [s["views"] for s in scenes] == [2, 1]
    by_name = {(row["method"], row["density"]): row for row in result["rows"]}
    assert by_name["same", 1.0]["psnr"] == pytest.approx(by_name[table.NO_NETWORK, 1.0]["psnr"])
    assert by_name["mine", 1.0]["psnr"] < by_name["same", 1.0]["psnr"]
    write_latex(result, tmp_path / "t.tex")
    text = (tmp_path / "t.tex").read_text()
    assert text.count(r"\\") == 1 + 6 + 4 and r"10\%" in text and f"{by_name['mine', 0.1]['psnr']:.2f}" in text
    assert text.count("&") == 6 * (1 + 6 + 4)


def test_a_run_that_ended_early_is_continued_with_the_next_place(two_places, tmp_path, without_lpips):
    """The unfinished result goes through JSON, where NaN is null."""
    from pointglass.model.common.files.json_file import write_json

    class Stop(Exception):
        pass

    def keep(result):
        write_json(tmp_path / "t.json", result)
        raise Stop

    whole = table.paper_table(two_places, {}, **SMALL)
    with pytest.raises(Stop):
        table.paper_table(two_places, {}, save=keep, **SMALL)
    earlier = json.loads((tmp_path / "t.json").read_text())
    assert earlier["complete"] is False and earlier["places"] == ["hall"]
    again = table.paper_table([two_places[0], two_places[1]], {}, earlier=earlier, **SMALL)
    for kind in ("pictures", "rows", "scenes"):
        assert len(again[kind]) == len(whole[kind])
        for one, other in zip(again[kind], whole[kind], strict=True):
            untimed = [name for name in one if not name.endswith("_s")]
            assert [repr(one[name]) for name in untimed] == [repr(other[name]) for name in untimed]
    assert again["complete"] and again["points"] == whole["points"]
    with pytest.raises(DataError, match="unfinished table made with other seed"):
        table.paper_table(two_places, {}, earlier=earlier, seed=12, **SMALL)


@pytest.mark.slow
def test_the_command_continues_a_file_and_writes_csv_and_latex(tmp_path, capsys, monkeypatch, without_lpips):
    """A run that fails at the second place, then the same command again."""
    folder = tmp_path / "rooms"
    for name in ("a", "b"):
        facts = make_room(folder / name) / "scene.json"
        facts.write_text(json.dumps({**json.loads(facts.read_text()), "scene": name}))
    small = {**(table.paper_table.__kwdefaults__ or {}), "sizes": ((48, 36),), "repeats": 1}
    monkeypatch.setattr(table.paper_table, "__kwdefaults__", small)
    names = ("json", "csv", "latex")
    files = {name: tmp_path / f"t.{name.replace('latex', 'tex')}" for name in names}
    command = ["evaluate", str(folder), "--paper-table", "--views", "1", "--densities", "0.5",
               *(word for name in names for word in (f"--{name}", str(files[name])))]
    judge, seen = table._Place.judge, []

    def stopping(self, *arguments):
        seen.append(self.name)
        if self.name == "b" and seen.count("a") == 1 and not files["csv"].exists() and len(seen) == 2:
            raise DataError("stopped here")
        return judge(self, *arguments)

    monkeypatch.setattr(table._Place, "judge", stopping)
    assert main(command) == 2 and json.loads(files["json"].read_text())["places"] == ["a"]
    capsys.readouterr()
    assert main(command) == 0
    said = capsys.readouterr()
    assert "continued after 1 of 2 places" in said.err and seen == ["a", "b", "b"]
    found = json.loads(files["json"].read_text())
    rows = list(csv.DictReader(files["csv"].open()))
    assert found["complete"] and len(rows) == len(found["pictures"]) and {row["place"] for row in rows} == {"a", "b"}
    assert [float(row["psnr"]) for row in rows] == [row["psnr"] for row in found["pictures"]]
    assert all(row["lpips"] == "" for row in rows) and files["latex"].read_text().startswith("% pointglass ")
    assert main(["evaluate", str(folder / "a"), "--csv", str(tmp_path / "x.csv")]) == 2
    assert "only with --paper-table" in capsys.readouterr().err


@pytest.mark.slow
def test_pictures_of_another_method_are_compared_in_the_papers_table(tmp_path, capsys, monkeypatch, without_lpips):
    """Those of the truth have no error, at the table's size and at the photograph's."""
    root = write_scannetpp(tmp_path / "root")
    (root / "splits" / "nvs_sem_val.txt").write_text("aa11bb22cc\n")
    from pointglass.model.data.images.scannetpp import load_scannetpp

    place = load_scannetpp(root, "aa11bb22cc", "dslr")
    small = {**(table.paper_table.__kwdefaults__ or {}), "sizes": ((48, 36),), "repeats": 1}
    monkeypatch.setattr(table.paper_table, "__kwdefaults__", small)
    folders = {"truth": tmp_path / "truth", "large": tmp_path / "large" / "aa11bb22cc" / "48x36" / "D100"}
    for name, folder in folders.items():
        folder.mkdir(parents=True)
        for view in place.views:
            colour = view.rgb() if name == "large" else scaled_colour(view.rgb(), 48, 36)
            Image.fromarray(colour).save(folder / f"{view.name}.png")
    command = ["evaluate", str(root), "--paper-table", "--densities", "1", "--json", str(tmp_path / "t.json"),
               "--outside", f"truth={folders['truth']}", "--outside", f"large={tmp_path / 'large'}"]
    assert main(command) == 0
    rows = {row["method"]: row for row in json.loads((tmp_path / "t.json").read_text())["rows"]}
    for name in folders:
        assert rows[name]["ssim"] == pytest.approx(1, abs=1e-5) and rows[name]["frame_s"] is None
        assert rows[name]["psnr"] is None or rows[name]["psnr"] > 60  # infinite: null
    assert rows["pull-push"]["psnr"] < 60
    first = next(iter(folders["truth"].iterdir()))
    first.write_bytes(b"no picture")
    assert main(command) == 2
    assert f"{first} cannot be read as a picture" in capsys.readouterr().err


def test_a_module_in_half_precision_is_given_back_in_float(program):
    network = own_networks([f"same={program}:Filled"])[0]
    made = network(torch.rand(6, 8, 10))
    assert made.shape == (3, 8, 10) and made.dtype == torch.float32
