"""Attached pictures of notes for a page: decoded and encoded again, so that nothing but their pixels is in the folder.

A photograph's file tells where and when it was taken and by which device; its name is a person's own.  Neither is written.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...common.errors import InputError
from ...work.notes.attached_picture import attached_picture
from ...work.notes.shared_pictures import check_shared
from .data_scripts import base64_text, script, webp_bytes

if TYPE_CHECKING:
    from ...work.notes.annotation import Annotation

_LONGEST = 1600
"""Pixels of the longer side: a photograph filling a laptop's window."""
_QUALITY = 84
"""WebP; a photograph of 1600 x 1200 pixels has about 300 kB."""


def picture_scripts(notes: "Sequence[Annotation]", project: Path | None,
                    problem: Callable[[str], object]) -> tuple[dict[int, tuple[int, int]], dict[str, bytes]]:
    """(Number of a note -> (width, height) of its picture, name of a script -> its bytes).  project: the file of the
    project, None where there is none.  problem: is told, in a line, which picture cannot be read or is no part of what is sent;
    its note has none then."""
    sizes: dict[int, tuple[int, int]] = {}
    files: dict[str, bytes] = {}
    for number, note in enumerate(notes):
        if not note.picture:
            continue
        try:
            check_shared(note.picture, project)
            picture = attached_picture(note.picture, _LONGEST)[0]
        except InputError as error:
            problem(str(error))
            continue
        sizes[number] = picture.shape[1], picture.shape[0]
        data = base64_text(webp_bytes(np.ascontiguousarray(picture), _QUALITY))
        files[f"{number:03d}.picture.js"] = script(f"note{number}.picture", {"pictures": [data]})
    return sizes, files
