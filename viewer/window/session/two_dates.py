"""Two files of a scene, each alone at its side of the handle of a comparison: an earlier date left, a later one right."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from ...picture.edits import Edits
from ...picture.spec import PictureSpec

if TYPE_CHECKING:
    from ...work.scan_files import FilePart


@dataclass(frozen=True)
class TwoDates:
    """others: of each side, left first, the numbers of the stations that it does not show.  names: of the two files."""

    others: tuple[tuple[int, ...], tuple[int, ...]]
    names: tuple[str, str]

    def edits(self, shown: Edits) -> tuple[Edits, Edits]:
        """What changes the picture of each side.  shown: what would change a picture of both together.  The colours of a
        comparison are those of the points right; a date that it shows alone is at its own side anyway."""
        coloured = shown.changes is not None and shown.changes.colours is not None
        plain = replace(shown, changes=None, comparison=None)
        left, right = (replace(edits, hidden_stations=tuple(sorted({*shown.hidden_stations, *hidden})))
                       for hidden, edits in zip(self.others, (plain, shown if coloured else plain), strict=True))
        return left, right

    def spec(self, plain: PictureSpec) -> PictureSpec:
        """The description of a picture of both dates.  plain: of one of all points, with two views."""
        left, right = self.edits(plain.edits)
        return replace(plain, edits=left, other_edits=right, side_names=self.names)


def dates_of(parts: "list[FilePart]", before: int, after: int) -> TwoDates:
    """before, after: numbers of files in ``parts``, which are all told apart."""
    from pathlib import Path

    from ...common.text import printable

    numbers = [tuple(number for other, part in enumerate(parts) if other != shown for number in part.numbers)
               for shown in (before, after)]
    names = [printable(Path(parts[number].path).name) for number in (before, after)]
    return TwoDates((numbers[0], numbers[1]), (names[0], names[1]))
