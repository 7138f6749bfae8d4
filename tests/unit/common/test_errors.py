"""Errors carry data: words of each combination, copies across processes, and nobody takes a message apart."""

import ast
import copy
import pickle
from itertools import product
from pathlib import Path

import pytest

import pointglass
from pointglass.viewer.common.errors import DeviceError, InputError, Option, PointglassError
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.stream.chunk_source import ChunkError
from pointglass.viewer.work.moved_scans import MissingScans

KINDS = {"PointglassError", "InputError", "DeviceError", "DataError", "WeightsError", "CacheError", "ChunkError"}
ROOT = Path(pointglass.__file__).parent
PARSERS = {"partition", "rpartition", "split", "rsplit", "splitlines", "startswith", "endswith", "removeprefix", "removesuffix",
           "find", "index", "replace", "match", "search", "fullmatch", "sub", "findall"}  # fmt: skip


@pytest.mark.parametrize("file, option, remedy", [*product((None, Path("a.laz")), (None, "--size"), (None, "again"))])
def test_words_of_each_combination(file, option, remedy):
    before = ("a.laz: " if file else "") + ("--size 'x': " if option else "")
    error = InputError("is wrong", file=file, option=option, value="x" if option else ..., remedy=remedy)
    assert str(error) == error.args[0] == before + "is wrong" + (f"; {remedy}" if remedy else "")
    assert error.subject() == before and (error.file, error.option, error.remedy) == (file, option, remedy)


@pytest.mark.parametrize("value, shown", [(..., ""), (None, " None"), (3, " 3"), ("a", " 'a'"), (Path("a b"), " a b")])
def test_a_value_is_shown_as_in_python_and_a_path_as_it_is(value, shown):
    assert str(InputError("no", option="--out", value=value)) == f"--out{shown}: no"


def named(option: Option) -> str:
    return f"<{option.name} {option.choice}>"


def test_options_inside_sentences_and_errors_are_called_as_asked():
    inner = InputError("small", option="--size", remedy=("see ", Option("--view", "raw")))
    error = InputError(("first: ", inner), file="a", remedy=("give ", Option("--out")))
    assert str(error) == "a: first: --size: small; see --view raw; give --out"
    error.name_options(named)
    assert str(error) == "a: first: <--size None>: small; see <--view raw>; give <--out None>"
    assert str(pickle.loads(pickle.dumps(error))) == str(error)


@pytest.mark.parametrize("error", [
    InputError("no", file=Path("a"), option=Option("--device", "cuda"), value=3, remedy=("use ", Option("--quality"))),
    DeviceError("lost"), PointglassError(), ChunkError("damaged", 7), MissingScans(Path("p"), [Path("a"), Path("b")]),
])  # fmt: skip
def test_errors_cross_processes_whole(error):
    for other in (pickle.loads(pickle.dumps(error)), copy.copy(error), copy.deepcopy(error)):
        assert type(other) is type(error) and str(other) == str(error)
        assert {**vars(other)} == {**vars(error)} and other.exit_code == error.exit_code


def test_an_error_is_of_its_file_and_of_the_folder_around_it():
    error = InputError("no", file=Path("/d/pot/octree.bin"))
    assert error.is_of(Path("/d/pot/octree.bin")) and error.is_of(Path("/d/pot")) and not error.is_of(Path("/d/po"))
    assert InputError("no", file="a.laz").is_of(Path("/d/a.laz")) and not InputError("/d/a.laz: no").is_of(Path("/d/a.laz"))


@pytest.mark.parametrize("name, content", [
    ("a.las", b"LASF" + bytes(400)), ("a.laz", b"LASF" + bytes(100)), ("a.e57", b"ASTM-E57" + bytes(100)),
    ("a.ply", b"ply\nformat ascii 1.0\n"), ("a.pcd", b"# .PCD v0.7\nFIELDS x y z\n"), ("a.ptx", b"3\n3\nno\n"),
    ("a.pts", b"5\nno\n"), ("a.asc", b"ncols 3\nnrows no\n"), ("a.xyz", b"words only\n"), ("a.csv", b"x,y\n"), ("a.laz", b""),
    ("cloud.js", b'{"octreeDir": 1, "spacing": 1, "boundingBox": 2}'), ("metadata.json", b"{"), ("ept.json", b"{"),
])  # fmt: skip
def test_the_error_about_a_damaged_file_has_it_as_data(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError) as caught:
        open_scene(path, cache=False)
    assert caught.value.is_of(path) and str(caught.value).startswith(f"{caught.value.file}: ")


def _of_error(node: ast.AST, name: str) -> bool:
    """Whether an expression is str(name) or a string made of it."""
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "str" and bool(
        node.args and isinstance(node.args[0], ast.Name) and node.args[0].id == name)  # fmt: skip


def parsed_messages(text: str) -> list[int]:
    """Lines where the message of an anticipated failure is taken apart in its except clause."""
    found = []
    for clause in ast.walk(ast.parse(text)):
        if not isinstance(clause, ast.ExceptHandler) or not clause.name or clause.type is None:
            continue
        kinds = {node.id for node in ast.walk(clause.type) if isinstance(node, ast.Name)}
        if not kinds & KINDS:
            continue
        for node in ast.walk(clause):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute) and node.func.attr in PARSERS:
                if node.func.attr == "split" and not node.args:
                    continue  # only puts the words on one line
                parts = [node.func.value, *node.args]
            elif isinstance(node, ast.Compare) and any(isinstance(op, ast.In | ast.NotIn) for op in node.ops):
                parts = node.comparators
            else:
                continue
            if any(_of_error(part, clause.name) for part in parts):
                found.append(node.lineno)
    return found


def test_no_module_takes_a_message_apart():
    files = [path for room in ("viewer", "model") for path in (ROOT / room).rglob("*.py")]
    assert len(files) > 100
    assert [f"{path}:{line}" for path in files for line in parsed_messages(path.read_text("utf-8"))] == []
    bad = "try:\n    go()\nexcept InputError as error:\n    a = str(error).partition(': ')\n    b = 'x' in str(error)\n"
    assert parsed_messages(bad) == [4, 5]
