"""Releases and what a repository's host reads: tag, version and changelog agree; workflows and issue forms name what exists."""

import importlib.util
import re
import shutil
import tomllib
from pathlib import Path

import pytest

from pointglass import __version__

ROOT = Path(__file__).resolve().parents[3]
FORMS = sorted((ROOT / ".github" / "ISSUE_TEMPLATE").glob("*.yml"))
WORKFLOWS = sorted((ROOT / ".github" / "workflows").glob("*.yml"))


@pytest.fixture(scope="module")
def release():
    """The module .ci/release.py."""
    spec = importlib.util.spec_from_file_location("release", ROOT / ".ci" / "release.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_changelog_begins_with_the_version_of_the_wheel(release):
    assert release.version() == __version__ == release.newest()[0].split()[0]
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert project["tool"]["hatch"]["version"]["path"] == "viewer/__init__.py"


def test_only_the_tag_of_this_version_is_released(release, tmp_path):
    (tmp_path / "viewer").mkdir()
    (tmp_path / ".github").mkdir()
    shutil.copy(ROOT / "viewer" / "__init__.py", tmp_path / "viewer")
    log = tmp_path / ".github" / "CHANGELOG.md"
    log.write_text(f"# Changelog\n\n## {__version__} (2027-01-02)\n\n- new\n\n## 0.0.1 (2026-01-01)\n\n- old\n")
    assert release.problem(f"v{__version__}", tmp_path) is None and release.newest(tmp_path)[1] == "- new"
    assert "must agree" in release.problem("v9.9.9", tmp_path) and "must agree" in release.problem(__version__, tmp_path)
    log.write_text(f"# Changelog\n\n## {__version__} (not released yet)\n\n- new\n")
    assert "give the date" in release.problem(f"v{__version__}", tmp_path)
    log.write_text("# Changelog\n\n## 9.0 (2027-01-02)\n\n- new\n")
    assert "begins with 9.0" in release.problem(f"v{__version__}", tmp_path)


def test_the_command_prints_this_tag_and_refuses_another(release, capsys):
    assert release.main([]) == 0 and capsys.readouterr().out == f"v{__version__}\n"
    assert release.main(["v0"]) == 2 and len(capsys.readouterr().err.splitlines()) == 1


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_a_workflow_says_that_it_was_never_run_and_names_files_that_exist(path):
    text = path.read_text("utf-8")
    assert text.startswith("# This file has never been run")
    named = re.findall(r"(?<![\w/])((?:\.ci|tests|assets)/[\w./-]+)", text)
    assert named and [name for name in named if not (ROOT / name).exists()] == []


def test_the_workflows_are_for_three_systems():
    text = "".join(path.read_text("utf-8") for path in WORKFLOWS)
    assert all(re.search(rf"{system}-\d+", text) for system in ("ubuntu", "windows", "macos"))


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_an_issue_form_asks_with_commands_that_exist(path):
    from pointglass.viewer.command_table import COMMANDS

    text = path.read_text("utf-8")
    if path.stem == "config":
        return
    assert re.match(r"name: .+\ndescription: .+\nlabels: \[\w+\]\nbody:\n", text)
    fields = re.findall(r"^    id: (\w+)$", text, re.MULTILINE)
    assert len(fields) == len(set(fields)) == len(re.findall(r"^  - type: (?!markdown)", text, re.MULTILINE)) >= 3
    assert set(re.findall(r"`pointglass (\w+)", text)) <= set(COMMANDS)


def test_the_files_are_yaml():
    yaml = pytest.importorskip("yaml", reason="comes with mkdocs; make docs installs it")
    for path in [*FORMS, *WORKFLOWS]:
        assert isinstance(yaml.safe_load(path.read_text("utf-8")), dict), path
