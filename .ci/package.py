"""hatchling's hooks: what a wheel holds, and what its page in a package index shows (pyproject.toml: tool.hatch).

A wheel owns one importable name: pointglass.py becomes pointglass/__init__.py beside viewer/ and model/.  An editable
installation holds no code, only the path of the checkout: a copy in site-packages would hide it.

An index shows the README away from the repository, where relative pictures and links lead nowhere.  Where the address of the
repository is known, they are made absolute and the address is in the metadata; otherwise they are left out.  It is read from
POINTGLASS_URL (https://HOST/OWNER/NAME), or from what GitHub sets in its workflows.
"""

import os
import re
from pathlib import Path

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface

_HELD = {
    "pointglass.py": "pointglass/__init__.py",
    ".ci/wheel_main.py": "pointglass/__main__.py",
    "viewer": "pointglass/viewer",
    "model": "pointglass/model",
    "viewer/py.typed": "pointglass/py.typed",
    # The weights go to model/, which loads them and knows nothing of viewer/ (viewer/common/paths.py,
    # model/network/weights_folder.py).
    "shaders": "pointglass/viewer/_data/shaders",
    "assets/demo.laz": "pointglass/viewer/_data/assets/demo.laz",
    "assets/demo_cameras.json": "pointglass/viewer/_data/assets/demo_cameras.json",
    "assets/weights": "pointglass/model/_data/weights",
}
"""Path in the checkout -> path in the wheel."""
_PICTURE = re.compile(r"!\[([^\]]*)\]\((?!\w+:)([^)\s]+)\)")
_LINK = re.compile(r"(?<!!)\[([^\]]*)\]\((?!\w+:|#)([^)\s]+)\)")
_LEADS_TO_PICTURES = re.compile(r"(?:(?<=[.!?)])\s+|\A)[^.!?]*:\Z")
"""The last sentence of a paragraph, where it ends in a colon."""


class WheelContents(BuildHookInterface):
    """Adds the code and its files to a wheel, and nothing to an editable installation."""

    def initialize(self, version: str, build_data: dict) -> None:
        if version != "editable":
            build_data["force_include"].update({str(Path(self.root) / source): target for source, target in _HELD.items()})


class IndexPage(MetadataHookInterface):
    """Sets the README and the project's addresses."""

    def update(self, metadata: dict) -> None:
        url = repository_url()
        text = (Path(self.root) / "README.md").read_text("utf-8")
        metadata["readme"] = {"content-type": "text/markdown", "text": readme_of_index(text, url)}
        if url:
            metadata["urls"] = {"Source": url, "Issues": f"{url}/issues"}


def repository_url() -> str:
    """The repository's address without a slash at its end, "" where it is not known."""
    if url := os.environ.get("POINTGLASS_URL"):
        return url.rstrip("/")
    server, name = os.environ.get("GITHUB_SERVER_URL"), os.environ.get("GITHUB_REPOSITORY")
    return f"{server}/{name}" if server and name else ""


def readme_of_index(text: str, url: str) -> str:
    """The README with absolute pictures and links; without an address no pictures, no captions, and the text of links."""
    if url:
        text = _PICTURE.sub(lambda found: f"![{found[1]}]({url}/raw/HEAD/{found[2]})", text)
        return _LINK.sub(lambda found: f"[{found[1]}]({url}/blob/HEAD/{found[2]})", text)
    kept: list[str] = []
    after_picture = False
    for block in text.split("\n\n"):
        without = _PICTURE.sub("", block)
        only_pictures = without != block and not re.sub(r"[\s|-]", "", without)
        caption = after_picture and block.startswith("*") and block.rstrip().endswith("*")
        if only_pictures and kept:
            kept[-1] = _LEADS_TO_PICTURES.sub("", kept[-1])
        if not only_pictures and not caption:
            kept.append(without)
        after_picture = only_pictures
    return _LINK.sub(lambda found: found[1], "\n\n".join(kept))
