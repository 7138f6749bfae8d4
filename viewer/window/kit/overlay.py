"""Drawing over the picture: lines, polygons, markers and labels given as world points.

An :class:`OverlayCanvas` projects with ``Camera.project`` and draws with imgui's draw list, clipped to the picture.  World
points are (N, 3), file coordinates.  Sizes, widths and offsets are design units, ``at`` is in pixels of the interface
(kit.theme).  Parts of a line behind the camera are cut off.  Colours are keys of theme.OVERLAY_COLOURS
("accent", "text", "warn", ...), so that a tool need not import imgui.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from imgui_bundle import ImVec2, imgui

from ...picture.drawn_lines import Area, clipped, in_front, kept_inside, label_places, leader
from . import theme
from .theme import Theme, packed

if TYPE_CHECKING:
    from ...picture.camera import Camera

_EDGE = 4.0  # design units between a plate and the edge of the picture
_GAP = 10.0  # design units from a point to its label
_REACHES = (1.0, 2.5, 4.0)  # multiples of the gap in which room is looked for
Shape = Literal["dot", "ring", "cross", "square", "diamond", "block"]


class OverlayCanvas:
    """camera: of the picture.  area: the picture's left, top, width, height in pixels of the interface.

    draw_list: imgui's; its clip rectangle is set to ``area`` until :meth:`end`.
    legend: left, top, width, height of the legend in this frame, None where none is drawn.
    Labels are laid out once all marks are drawn (:meth:`lay_labels`), so that no label lies over another, or over a mark.
    """

    def __init__(self, draw_list: Any, camera: "Camera", style: Theme, area: tuple[float, float, float, float]):
        self.draw_list, self.camera, self.theme, self.area = draw_list, camera, style, area
        left, top, width, height = area
        self._scale = np.array([width / camera.width, height / camera.height])
        self._origin = np.array([left, top])
        self._taken: list[Area] = []  # where marks and plates lie
        self._marks: list[tuple[float, float]] = []
        self.legend: Area | None = None
        self._waiting: list[tuple[np.ndarray, Sequence[str], str, int]] = []
        draw_list.push_clip_rect(ImVec2(left, top), ImVec2(left + width, top + height), True)

    def keep_legend(self, area: Area) -> None:
        """Keeps labels, and messages, off the legend."""
        self.legend = area
        self._taken.append(area)

    def end(self) -> None:
        """Draws the labels that wait, and restores the draw list."""
        self.lay_labels()
        self.draw_list.pop_clip_rect()

    def place(self, points) -> tuple[np.ndarray, np.ndarray]:
        """Interface pixels (N, 2) of world points, NaN behind the camera, and whether each is in the picture (N,) bool."""
        pixels, depth = self.camera.project(points)
        with np.errstate(invalid="ignore"):
            inside = (depth > 0) & (pixels >= 0).all(axis=1)
            inside &= (pixels <= (self.camera.width, self.camera.height)).all(axis=1)
        return self._origin + pixels * self._scale, inside

    def line(self, start, end, colour: str = "accent", width: float = 2.0, *, halo: bool = True) -> None:
        """A straight line between two world points.  halo: a dark edge, so that it is seen on any picture."""
        self.polyline(np.array([start, end]), colour, width, halo=halo)

    def polyline(self, points, colour: str = "accent", width: float = 2.0, *, closed: bool = False,
                 halo: bool = True) -> None:
        """Straight lines from each world point to the next; closed: and from the last to the first."""
        points = np.asarray(points, np.float64).reshape(-1, 3)
        ends = np.roll(points, -1, axis=0) if closed else points[1:]
        for strength, shade in (((width + 2.5, "shade"), (width, colour)) if halo else ((width, colour),)):
            for a, b in zip(points, ends):
                self._segment(a, b, shade, strength)

    def _segment(self, a: np.ndarray, b: np.ndarray, colour: str, width: float) -> None:
        pixels = in_front(self.camera, a, b)
        if pixels is None:
            return
        start, end = self._origin + pixels * self._scale
        part = clipped(start, end, self.area, 4 * self.theme.px(width))
        if part is not None:
            (x0, y0), (x1, y1) = part
            self.draw_list.add_line(ImVec2(x0, y0), ImVec2(x1, y1), _shade(colour), self.theme.px(width))

    def outline(self, pixels, colour: str = "accent", width: float = 1.5, *, closed: bool = True) -> None:
        """Straight lines between positions of the picture, (N, 2) pixels."""
        places = [ImVec2(*place) for place in (self._origin + np.asarray(pixels, np.float64) * self._scale).tolist()]
        flags = imgui.ImDrawFlags_.closed if closed else imgui.ImDrawFlags_.none
        for shade, strength in (("shade", width + 2.5), (colour, width)):
            self.draw_list.add_polyline(places, _shade(shade), self.theme.px(strength), int(flags))

    def polygon(self, points, colour: str = "accent", alpha: float = 0.25) -> None:
        """A filled convex polygon of world points; not drawn where a corner is behind the camera."""
        places, _ = self.place(points)
        if len(places) >= 3 and np.isfinite(places).all():
            self.draw_list.add_convex_poly_filled([ImVec2(*map(float, place)) for place in places], _shade(colour, alpha))

    def marker(self, point, colour: str = "accent", size: float = 5.0, shape: Shape = "dot") -> None:
        """A mark at a world point.  size: half its width."""
        places, inside = self.place([point])
        if inside[0]:
            self.mark(tuple(places[0]), colour, size, shape)

    def mark(self, at: tuple[float, float], colour: str = "accent", size: float = 5.0, shape: Shape = "dot") -> None:
        """A mark at a position of the interface."""
        x, y, r, draw = float(at[0]), float(at[1]), self.theme.px(size), self.draw_list
        if shape != "ring":  # which follows the pointer: labels would jump
            half = min(1.3 * r, self.theme.px(_GAP - 1.0))  # the label of the marked point itself has room in its corners
            self._taken.append((x - half, y - half, 2 * half, 2 * half))
            self._marks.append((x, y))
        edge, line = _shade("shade"), max(self.theme.px(2.0), 1.0)
        if shape in ("dot", "ring"):
            if shape == "dot":
                draw.add_circle_filled(ImVec2(x, y), r + 0.75 * line, edge, 24)
                draw.add_circle_filled(ImVec2(x, y), r, _shade(colour), 24)
            else:
                draw.add_circle(ImVec2(x, y), r, edge, 24, 2.2 * line)
                draw.add_circle(ImVec2(x, y), r, _shade(colour), 24, line)
            return
        if shape == "block":
            for half, shade in ((r + 0.75 * line, edge), (r, _shade(colour))):
                draw.add_rect_filled(ImVec2(x - half, y - half), ImVec2(x + half, y + half), shade)
            return
        corners = {
            "square": [(-1, -1), (1, -1), (1, 1), (-1, 1)], "diamond": [(0, -1.3), (1.3, 0), (0, 1.3), (-1.3, 0)],
        }.get(shape)  # fmt: skip
        for shade, width in ((edge, 2.2 * line), (_shade(colour), line)):
            if corners is None:
                draw.add_line(ImVec2(x - r, y), ImVec2(x + r, y), shade, width)
                draw.add_line(ImVec2(x, y - r), ImVec2(x, y + r), shade, width)
            else:
                for (ax, ay), (bx, by) in zip(corners, corners[1:] + corners[:1]):
                    draw.add_line(ImVec2(x + r * ax, y + r * ay), ImVec2(x + r * bx, y + r * by), shade, width)

    def crosshair(self, position: tuple[float, float], colour: str = "text") -> None:
        """A crosshair with an open middle at a position in pixels of the picture."""
        x, y = (self._origin + np.array(position) * self._scale).tolist()
        inner, outer, px = self.theme.px(4.0), self.theme.px(11.0), self.theme.px
        for shade, width in (("shade", px(3.0)), (colour, px(1.2))):
            for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
                start, end = ImVec2(x + dx * inner, y + dy * inner), ImVec2(x + dx * outer, y + dy * outer)
                self.draw_list.add_line(start, end, _shade(shade), width)

    def hint(self, position: tuple[float, float], text: str) -> None:
        """A line of help below the pointer, which is at a position in pixels of the picture."""
        x, y = (self._origin + np.array(position) * self._scale + self.theme.px(16.0)).tolist()
        self.text((x, y), text, "dim")

    def label(self, point, text: str, colour: str = "text", offset: tuple[float, float] = (10.0, -10.0)) -> None:
        """Text on a dark plate beside a world point.  offset: design units from the point to the plate's nearest corner."""
        places, inside = self.place([point])
        if inside[0]:
            shift = np.array([self.theme.px(offset[0]), self.theme.px(offset[1])])
            align = (0.0 if offset[0] >= 0 else 1.0, 0.0 if offset[1] >= 0 else 1.0)
            self.text(tuple(places[0] + shift), text, colour, align=align)

    def labels(self, points, texts: "Sequence[str]", colour: str = "text", *, of_marks: bool = False) -> None:
        """Labels of world points, over no mark and no other label: each in the first free place beside its point, the nearest
        points first; a label without room near its point is left out.  of_marks: the marks drawn before are those of what is
        named, which none of these labels is kept away from."""
        first = len(self._marks) if of_marks else 0
        self._waiting.append((np.asarray(points, np.float64).reshape(-1, 3), texts, colour, first))

    def lay_labels(self) -> None:
        """Draws the labels that wait for the marks, those asked for first first."""
        waiting, self._waiting = self._waiting, []
        gap, edge, taken, laid = self.theme.px(_GAP), self.theme.px(_EDGE), list(self._taken), []
        for points, texts, colour, first in waiting:
            places, _ = self.place(points)
            sizes = [self._plate((0.0, 0.0), text, (0.0, 0.0))[2:] for text in texts]
            depths, marks = self.camera.project(points)[1], self._marks[first:]
            found = label_places(places, depths, sizes, gap, self.area, edge, taken, _REACHES, marks)
            for number, at in found.items():
                taken.append((*at, *sizes[number]))
                laid.append((at, texts[number], colour))
                if (end := leader(places[number], at, sizes[number], gap, [*places, *marks])) is not None:
                    self._leader(places[number], end)
        for at, text, colour in laid:  # over the lines of all
            self.text(at, text, colour)

    def _leader(self, point: np.ndarray, end: tuple[float, float]) -> None:
        """A line from the rim of a point's mark to its label."""
        along = np.subtract(end, point)
        share = min(0.6 * self.theme.px(_GAP) / max(float(np.hypot(*along)), 1e-9), 1.0)
        start = ImVec2(*(point + share * along).tolist())
        for shade, width in (("shade", 3.0), ("text", 1.2)):
            self.draw_list.add_line(start, ImVec2(*end), _shade(shade), self.theme.px(width))

    def divider(self, x: float) -> None:
        """A vertical line across the picture at a position of the interface."""
        _, top, _, height = self.area
        for shade, width in (("shade", 3.0), ("text", 1.0)):
            self.draw_list.add_line(ImVec2(x, top), ImVec2(x, top + height), _shade(shade), self.theme.px(width))

    def _plate(self, at: tuple[float, float], text: str, align: tuple[float, float]) -> tuple[float, float, float, float]:
        """Left, top, width and height of the plate of a text, kept inside the picture."""
        size, px = imgui.calc_text_size(text), self.theme.px
        width, height = size.x + 2 * px(7), size.y + 2 * px(3)
        left, top = at[0] - align[0] * width, at[1] - align[1] * height
        return *kept_inside(left, top, (width, height), self.area, px(_EDGE)), width, height

    def text(self, at: tuple[float, float], text: str, colour: str = "text", *,
             align: tuple[float, float] = (0.0, 0.0)) -> None:
        """Text on a dark plate at a position of the interface, kept inside the picture.  align: the plate's point that lies
        at ``at``; (0, 0) its top left corner, (1, 1) its bottom right one."""
        px = self.theme.px
        x, y, width, height = plate = self._plate(at, text, align)
        self._taken.append(plate)
        self.draw_list.add_rect_filled(ImVec2(x, y), ImVec2(x + width, y + height), packed(theme.PANEL, 0.92), px(4))
        self.draw_list.add_text(ImVec2(x + px(7), y + px(3)), _shade(colour), text)


def _shade(colour: str, alpha: float | None = None) -> int:
    return packed(theme.OVERLAY_COLOURS[colour], alpha)
