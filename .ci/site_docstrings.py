"""griffe's extension for the site (.ci/mkdocs.yml): lines of a docstring that begin with ``name:`` stay lines of their own."""

import re
from typing import Any

import griffe

_BEGINS = re.compile(r"\n(?=[\w,.` ]{1,45}: )")


class ArgumentLines(griffe.Extension):
    """Markdown joins lines; two spaces at the end of one keep it."""

    def on_object(self, *, obj: Any, **_: Any) -> None:
        if obj.docstring is not None:
            obj.docstring.value = _BEGINS.sub("  \n", obj.docstring.value)

    def on_package(self, *, pkg: Any, **_: Any) -> None:
        self.on_object(obj=pkg)
