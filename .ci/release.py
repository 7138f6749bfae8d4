"""Releases: ``python .ci/release.py`` prints the tag of this version; with a tag it checks that tag.

The tag is ``v`` and the wheel's version (viewer/__init__.py), whose section comes first in .github/CHANGELOG.md, without "not
released yet".  With a tag, that section is also written to out/notes.md, for the release's page.  Needs Python alone.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]


def version(root: Path = ROOT) -> str:
    found = re.search(r'^__version__ = "([^"]+)"$', (root / "viewer" / "__init__.py").read_text("utf-8"), re.MULTILINE)
    assert found is not None
    return found[1]


def newest(root: Path = ROOT) -> tuple[str, str]:
    """Title and text of the changelog's first section."""
    parts = re.split(r"^## (.+)$", (root / ".github" / "CHANGELOG.md").read_text("utf-8"), flags=re.MULTILINE)
    return parts[1].strip(), parts[2].strip()


def problem(tag: str, root: Path = ROOT) -> str | None:
    """Why a tag cannot be released, in one line; None where it can."""
    title, _ = newest(root)
    if tag != f"v{version(root)}":
        return f"the tag is {tag}, the wheel's version {version(root)} (viewer/__init__.py); they must agree"
    if title.split()[0] != version(root):
        return f"CHANGELOG.md begins with {title}, not with {version(root)}"
    if "not released" in title:
        return f"CHANGELOG.md says {title!r}; give the date of the release"
    return None


def main(arguments: list[str]) -> int:
    if not arguments:
        print(f"v{version()}")
        return 0
    if why := problem(arguments[0]):
        print(why, file=sys.stderr)
        return 2
    (ROOT / "out").mkdir(exist_ok=True)
    (ROOT / "out" / "notes.md").write_text(newest()[1] + "\n", "utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
