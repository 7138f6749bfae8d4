"""Rules of the layout that no single module can keep: directions of imports, no circles, names, sizes.

Imports are read from the source, by its syntax tree: those at module level, those inside functions and those under
``if TYPE_CHECKING:`` alike.  Only circles are searched among the imports that exist at run time.
"""

import ast
from collections import Counter
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[3]
MOST_LINES = 320
LONGER: dict[str, str] = {}
"""Modules longer than MOST_LINES, each with its reason."""
MOST_MODULES = 16
ORDER = {
    "viewer": ["common", "picture", "readers", "preprocess", "grid", "stream", "render", "work", "commands", "window", "bench",
               "interface"],
    "model": ["common", "appearance", "network", "reference", "synth", "data", "evaluation", "train"],
}
"""The rooms, in the order in which data flows: each imports only from those before it."""
WINGS: dict[str, list[str]] = {
    "viewer.render": ["device", "culling", "raster", "passes", "photographs", "meshes", "network", ""],
    "viewer.window": ["kit", "file_dialog", "flight", "planning", "session", "viewport", "saving", "interaction", "panels",
                      "shell"],
}
"""The wings of a room, in the order in which each may be imported by those after it; "" for the modules at the top of the
room.  A room that is not named here has no order of wings."""
SAME_NAME: dict[str, str] = {
    "__init__": "packages",
    "command": "the command line's part of a folder: training, evaluation, film, export, section",
    "demo": "the demo scan is made by model/synth and shown by viewer/commands",
    "errors": "the base class in model/common, and the viewer's classes",
    "heldout": "held-out points as data, and their judging",
    "hole_test": "the reference implementation in model/, the pass in viewer/render/",
    "noise_level": "the reference implementation in model/, the pass in viewer/render/",
    "reprojection": "the reference implementation in model/, the pass in viewer/render/",
    "scanner_positions": "what a file says (model/common), and what is inferred from the order of points (viewer/preprocess)",
    "spacing": "the same measure, of training data and of a grid",
    "stations": "scanner stations of training data, and of a frame",
}
"""Base names that several modules have, with the reason."""


def sources() -> dict[str, Path]:
    """Dotted name -> file, of every module of the product."""
    files = [*ROOT.glob("viewer/**/*.py"), *ROOT.glob("model/**/*.py"), ROOT / "pointglass.py"]
    return {".".join(file.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): file for file in files}


SOURCES = sources()
OURS = ("viewer", "model", "pointglass")


def is_type_checking(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "typing.TYPE_CHECKING")


_BLOCKS = ("body", "orelse", "finalbody", "handlers", "cases")
"""Fields of a statement that hold statements; expressions, most of a tree, import nothing."""


def imports_of(tree: ast.AST, known: set[str], *, package: str = "", lazy: bool = True, types: bool = False) -> set[str]:
    """Modules of ours that a syntax tree imports; without ``lazy`` only those that importing it imports, with ``types`` also
    those of annotations.

    package: dotted name of the package that the module is in, from which relative imports count; "" is the checkout.
    """
    found: set[str] = set()

    def visit(node: ast.AST) -> None:
        if not types and is_type_checking(node):
            assert isinstance(node, ast.If)
            for child in node.orelse:
                visit(child)
            return
        if not lazy and isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
            return
        if isinstance(node, ast.ImportFrom) and node.level:
            parts = package.split(".") if package else []
            base = ".".join([*parts[:len(parts) - node.level + 1], *filter(None, [node.module])])
            for alias in node.names:
                whole = f"{base}.{alias.name}".lstrip(".")
                found.add(whole if whole in known else base)
        for field in _BLOCKS:
            for child in getattr(node, field, ()):
                visit(child)

    visit(tree)
    return found & known


def absolute_imports_of(tree: ast.AST) -> list[str]:
    """The imports of ours that are not relative."""
    return [ast.unparse(node) for node in ast.walk(tree)
            if (isinstance(node, ast.ImportFrom) and not node.level and (node.module or "").split(".")[0] in OURS)
            or (isinstance(node, ast.Import) and any(alias.name.split(".")[0] in OURS for alias in node.names))]


IMPORTS: dict[str, set[str]] = {}
EVERY_IMPORT: dict[str, set[str]] = {}
ABSOLUTE: dict[str, list[str]] = {}
for _name, _file in SOURCES.items():
    _tree = ast.parse(_file.read_text("utf-8"))  # none is kept: the garbage collector would look through 900 trees in each test
    _package = _name if _file.name == "__init__.py" else _name.rpartition(".")[0]
    IMPORTS[_name] = imports_of(_tree, set(SOURCES), package=_package) - {_name}
    EVERY_IMPORT[_name] = imports_of(_tree, set(SOURCES), package=_package, types=True) - {_name}
    ABSOLUTE[_name] = absolute_imports_of(_tree)


def circles(graph: dict[str, set[str]]) -> list[list[str]]:
    """The groups of modules that reach each other (strongly connected components of more than one; Tarjan)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def connect(name: str) -> None:
        index[name] = low[name] = len(index)
        stack.append(name)
        for other in sorted(graph[name]):
            if other not in index:
                connect(other)
                low[name] = min(low[name], low[other])
            elif other in stack:
                low[name] = min(low[name], index[other])
        if low[name] == index[name]:
            group = []
            while not group or group[-1] != name:
                group.append(stack.pop())
            if len(group) > 1:
                found.append(sorted(group))

    for name in sorted(graph):
        if name not in index:
            connect(name)
    return found


def test_the_reading_of_imports_sees_what_it_should():
    tree = ast.parse("from ...model import a\nfrom .. import b\nfrom ..c import D\nfrom . import e\n"
                     "if TYPE_CHECKING:\n    from ...model import typed\nelse:\n    from ...model import real\n"
                     "def f():\n    from ...model.lazy import x\n")
    known = {"model.a", "viewer", "viewer.b", "viewer.c", "viewer.room.e", "model.typed", "model.real", "model.lazy"}
    early = {"model.a", "viewer.b", "viewer.c", "viewer.room.e", "model.real"}
    assert imports_of(tree, known, package="viewer.room") == early | {"model.lazy"}
    assert imports_of(tree, known, package="viewer.room", lazy=False) == early
    assert imports_of(tree, known, package="viewer.room", types=True) == early | {"model.lazy", "model.typed"}
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"b"}, "d": {"a"}}) == [["b", "c"]]


def test_the_product_owns_one_importable_name():
    """Imports inside the product are relative: a script's own ``model.py`` or ``viewer/`` is never taken for ours."""
    assert {name: wrong for name, wrong in ABSOLUTE.items() if wrong} == {}


def test_no_imports_are_circular():
    assert circles(IMPORTS) == []


def inside(name: str, folder: str) -> bool:
    return name == folder or name.startswith(f"{folder}.")


def room_of(name: str) -> str:
    """The room of a module: the first folder below viewer/ or model/; "" for a module beside the rooms."""
    parts = name.split(".")
    return parts[1] if len(parts) > 1 and parts[1] in ORDER.get(parts[0], ()) else ""


@pytest.mark.parametrize("top", ["viewer", "model"])
def test_imports_point_one_way(top):
    """From a room to those before it in ORDER, in annotations too."""
    order = ORDER[top]
    place = {name: order.index(room_of(name)) if room_of(name) else len(order)
             for name in EVERY_IMPORT if inside(name, top) and name != top}
    wrong = [f"{name} imports {other}" for name in place for other in sorted(EVERY_IMPORT[name] & set(place))
             if place[other] > place[name]]
    assert wrong == []


def wing_of(name: str, room: str) -> str:
    """The wing of a module of a room: its first folder below the room's; "" for a module at the top."""
    below = name.removeprefix(f"{room}.").split(".")
    return below[0] if len(below) > 1 or SOURCES[name].name == "__init__.py" else ""


def against_the_wings(room: str, imports: dict[str, set[str]]) -> list[str]:
    """The imports inside a room that point from a wing to one after it."""
    place = {name: WINGS[room].index(wing_of(name, room)) for name in imports if inside(name, room) and name != room}
    return [f"{name} imports {other}" for name in place for other in sorted(imports[name] & set(place))
            if place[other] > place[name]]


@pytest.mark.parametrize("room", WINGS)
def test_imports_between_wings_point_one_way(room):
    """From a wing to those before it in WINGS, in annotations and inside functions too."""
    assert against_the_wings(room, EVERY_IMPORT) == []


@pytest.mark.parametrize("room", WINGS)
def test_every_folder_of_a_room_is_a_wing(room):
    folders = {wing_of(name, room) for name in SOURCES if inside(name, room) and name != room}
    assert folders == set(WINGS[room])


def test_an_import_against_the_wings_is_found():
    assert against_the_wings("viewer.render", {
        "viewer.render.frame": {"viewer.render.passes.fill"}, "viewer.render.passes.fill": {"viewer.render.frame"},
    }) == ["viewer.render.passes.fill imports viewer.render.frame"]  # fmt: skip


@pytest.mark.parametrize("room", WINGS)
def test_no_imports_of_wings_are_circular(room):
    """Those of annotations included."""
    assert circles({name: {other for other in others if inside(other, room)} for name, others in EVERY_IMPORT.items()
                    if inside(name, room)}) == []


@pytest.mark.parametrize(("importer", "imported"), [
    ("model", "viewer"),
    ("model", "pointglass"),
    ("viewer", "pointglass"),
    ("viewer.interface", "viewer.window"),
    ("viewer.work", "viewer.render"),
])  # fmt: skip
def test_these_do_not_know_those(importer, imported):
    wrong = {name: sorted(other for other in others if inside(other, imported))
             for name, others in EVERY_IMPORT.items() if inside(name, importer)}
    assert {name: others for name, others in wrong.items() if others} == {}


def test_every_folder_is_a_room_of_the_order():
    for top, order in ORDER.items():
        folders = {file.parent.relative_to(ROOT / top).parts[0] for file in ROOT.glob(f"{top}/*/**/*.py")}
        assert folders == set(order)


def test_folders_are_small():
    count = Counter(file.parent.relative_to(ROOT) for file in SOURCES.values() if file.name != "__init__.py")
    assert {str(folder): modules for folder, modules in count.items() if modules > MOST_MODULES} == {}


def test_nothing_imports_the_command_line():
    importers = {name for name, others in IMPORTS.items() if others & {"viewer.cli", "viewer.__main__"}}
    assert importers <= {"viewer.__main__"}


def test_modules_do_not_share_a_name_unless_they_play_the_same_part():
    count = Counter(file.stem for file in SOURCES.values())
    assert {name for name, times in count.items() if times > 1} - set(SAME_NAME) == set()


def test_modules_are_short():
    lines = {str(file.relative_to(ROOT)): len(file.read_text("utf-8").splitlines()) for file in SOURCES.values()}
    too_long = {name: count for name, count in lines.items() if count > MOST_LINES and name != "pointglass.py"}
    assert set(too_long) - set(LONGER) == set()
    assert {name for name in LONGER if lines.get(name, 0) <= MOST_LINES} == set(), "these exceptions are no longer needed"


def test_exceptions_name_what_exists():
    count = Counter(file.stem for file in SOURCES.values())
    assert {name for name in SAME_NAME if count[name] < 2} == set(), "these names are no longer shared"
