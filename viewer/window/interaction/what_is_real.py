"""What is real: every pixel in the colour of its provenance, with the shares in a legend, and the lock on measured pixels."""

from typing import TYPE_CHECKING, Any

from ...picture.provenance import PHOTOGRAPHED, REPAINTED
from ...picture.provenance_tint import COLOURS, NAMES, Shares, shares
from ..kit import icons
from ..kit.widgets import facts, tooltip_beside
from .editing import edit
from .tool import Tool, ToolContext

if TYPE_CHECKING:
    from ...render.frame import Frame


class WhatIsReal(Tool):
    """While it is selected, pictures are tinted by provenance."""

    name, label, icon, key = "provenance", "What is real", icons.PROVENANCE, "M"
    help = "tint pixels: measured, repainted, filled or background"

    def __init__(self) -> None:
        self._frame: Frame | None = None
        self._seen = ("", False, False)  # the view that was counted, whether its network was running, and the lock
        self.shares: Shares | None = None

    def selected(self, context: ToolContext) -> None:
        context.session.work.tint = True

    def left(self, context: ToolContext) -> None:
        context.session.work.tint = False
        self._frame = self.shares = None

    def _count(self, context: ToolContext) -> None:
        """Counts the pixels of the picture at rest, once per picture; while something moves the last numbers stay."""
        frame, view = context.viewport.frame, context.session.screen.drawn[-1]
        if not context.session.work.tint or frame is None or context.session.flight.moving or view not in frame.textures:
            return
        pending = bool(frame.facts.network_pending)
        seen = (view, pending, context.document.lock_measured)
        if frame is self._frame and seen == self._seen:
            return
        names = ("mask", view, *(["filtered"] if "filtered" in frame.textures else []),
                 *([f"{view} photographs"] if view in frame.photo_shares else []))
        read = {name: context.viewport.pixels.read(frame, name) for name in names}
        mask, image = read["mask"], read[view]
        if mask is None or image is None or any(pixels is None for pixels in read.values()):
            return  # it follows a frame or two later
        locked = view == "neural" and context.document.lock_measured  # then nothing that was measured is repainted
        photographs = read.get(f"{view} photographs")
        if locked and photographs is not None:
            photographs = photographs & ~mask
        self.shares = shares("filled" if locked else view, image, mask, read.get("filtered"), photographs)
        self._frame, self._seen = frame, seen

    def rows(self) -> list[tuple[int, str, str]]:
        """(provenance, its share, its name) of the legend's rows; repainted and from photographs only where there is such a
        pixel."""
        if self.shares is None:
            return []
        rows = []
        for key, name in NAMES.items():
            percent = self.shares.percent[key]
            if key in (REPAINTED, PHOTOGRAPHED) and percent == 0:
                continue
            by = f" by {self.shares.change:.0f} of 255 levels" if key == 2 and self.shares.change is not None else ""
            rows.append((key, f"{percent:.1f} %", name + by))
        return rows

    def follow(self, context: ToolContext) -> None:
        self._count(context)
        context.session.work.tint_rows = [(COLOURS[key], f"{share:\u2007>6}  {name}") for key, share, name in self.rows()]

    def panel(self, ui: Any, context: ToolContext) -> None:
        facts([(share, name) for _, share, name in self.rows()], context.theme, first=50.0)
        lock(ui, context)
        ui.text_wrapped("Measured pixels hold points that the filter kept. Filled pixels hold none: they are interpolated. "
                        "The network repaints both: measured pixels from green (little) to violet (much).")


def lock(ui: Any, context: ToolContext) -> None:
    """The switch that keeps measured pixels of the neural view as they were measured."""
    changed, on = ui.checkbox("Keep measured pixels", context.document.lock_measured)
    if changed:
        edit(context, "Lock measured pixels" if on else "Unlock measured pixels", lock_measured=on)
    if ui.is_item_hovered():
        tooltip_beside(ui, "The network then paints only the pixels in which nothing was measured")
