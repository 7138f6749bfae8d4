"""The documentation site: its configuration names what exists, links lead somewhere, it builds where mkdocs is."""

import importlib.util
import re
import subprocess
import sys
from pathlib import Path

import pytest

import pointglass

ROOT = Path(__file__).resolve().parents[3]
CONFIG = (ROOT / ".ci" / "mkdocs.yml").read_text("utf-8")
PAGES = dict(re.findall(r"^    (\S+\.md): (\S+)$", CONFIG, re.MULTILINE))
"""Page of the site -> file of the repository."""
GENERATED = {"examples.md", "modules.md"}


@pytest.fixture(scope="module")
def site():
    """The module .ci/site_pages.py."""
    spec = importlib.util.spec_from_file_location("site_pages", ROOT / ".ci" / "site_pages.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def anchors(text: str) -> set[str]:
    """The places in a Markdown file to which a link may lead, as GitHub and mkdocs name them."""
    text = re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    heads = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[\s]+", "-", re.sub(r"[^\w\s-]", "", head.lower()).strip()) for head in heads}


def test_the_configuration_names_what_exists():
    assert len(PAGES) >= 8 and [file for file in PAGES.values() if not (ROOT / file).is_file()] == []
    nav = CONFIG.partition("\nnav:\n")[2].partition("\nplugins:")[0]
    own = {path.name for path in (ROOT / ".ci" / "site").glob("*.md")}
    assert set(re.findall(r"(\S+\.md)$", nav, re.MULTILINE)) == set(PAGES) | own | GENERATED
    for name in ("docs_dir: site", "hooks: [site_pages.py]", "paths: [editor]", "extensions: [site_docstrings.py]"):
        assert name in CONFIG and (ROOT / ".ci" / name.split(": ")[1].strip("[]")).exists()


def test_every_readme_is_a_page():
    found = [ROOT / "README.md", *(ROOT / ".github").glob("*.md")]
    found += [file for part in ("viewer", "model", "assets", "shaders") for file in (ROOT / part).rglob("*.md")]
    assert {file.relative_to(ROOT).as_posix() for file in found} == set(PAGES.values())


def test_links_between_the_pages_lead_somewhere(site):
    wrong, found = [], 0
    for file in PAGES.values():
        text = (ROOT / file).read_text("utf-8")
        for link in re.finditer(r"\]\((?!\w+:)([^)#\s]*)(#[^)\s]*)?\)", text):
            found += 1
            target = ROOT / file if not link[1] else ((ROOT / file).parent / link[1]).resolve()
            inside = target.is_relative_to(ROOT) and target.exists()
            if not inside or (link[2] and link[2][1:] not in anchors(target.read_text("utf-8"))):
                wrong.append(f"{file}: {link[0]}")
    assert found > 20 and wrong == []


def test_links_become_those_of_the_site(site):
    pages, pictures = {"index.md": "README.md", "viewer.md": "viewer/README.md"}, set()
    text = "[a](../README.md#x) [b](README.md) [c](../Makefile) ![d](../assets/e.png) [f](https://g) [h](#i)"

    def linked(url: str) -> str:
        return site.relinked(text, "viewer/README.md", pages, url, pictures)

    assert linked("").startswith("[a](index.md#x) [b](viewer.md) c ![d](files/assets/e.png) [f](https://g) [h](#i)")
    assert "[c](https://host/x/blob/HEAD/Makefile)" in linked("https://host/x") and "assets/e.png" in pictures


def test_the_python_page_has_every_name_of_the_interface():
    named = re.findall(r"^::: pointglass\.(\w+)$", (ROOT / ".ci" / "site" / "python.md").read_text("utf-8"), re.MULTILINE)
    assert sorted(named) == sorted({*pointglass.__all__} - {"__version__"})


def test_written_pages_have_every_example_and_module(site):
    assert site.examples().count("\n## ") == len([*(ROOT / "assets" / "examples").glob("*.py")]) > 5
    modules = site.modules()
    for part in ("viewer", "model"):
        for file in (ROOT / part).rglob("*.py"):
            folder = file.parent.relative_to(ROOT).as_posix()
            section = modules.partition(f"\n## {folder}\n")[2].partition("\n## ")[0]
            assert file.name == "__init__.py" or re.search(rf"^\| `{file.name}` \| .{{10,}}\|$", section, re.MULTILINE), file


@pytest.mark.skipif(importlib.util.find_spec("mkdocstrings") is None, reason="mkdocs is not installed; make docs installs it")
def test_the_site_builds_without_a_warning(tmp_path):
    done = subprocess.run([sys.executable, "-m", "mkdocs", "build", "--strict", "-f", ".ci/mkdocs.yml",
                           "-d", tmp_path / "site"], cwd=ROOT, capture_output=True, text=True, timeout=300)  # fmt: skip
    assert done.returncode == 0, done.stderr
    page = (tmp_path / "site" / "python" / "index.html").read_text("utf-8")
    assert "every_hundredth" in page and "metres_per_unit" in page and ":class:" not in page
