"""From points to the raw picture and its depth: what the rasterisers have in common, with the soft z-buffer.

All draw every point as 1x1 pixels in two passes (paper, "Point Cloud Projection"): nearest depth, then whole-number colour sums
of the points within a tolerance behind it.  viewer.render.raster.raster_compute uses compute shaders and integer atomics,
viewer.render.raster.raster_points OpenGL point primitives with MIN blending, viewer.render.raster.raster_cpu compiled loops
where OpenGL is software; all choose the pixel by the same expressions, and make the same bytes (on a GPU: within the tolerance
of viewer.render.device.device_class).  View-dependent blending: where scanner positions are known, points are weighted by the
angle between the viewing ray and their scanner's ray (model/reference/station_weights.py).  ``weight`` holds the sum of each
pixel's weights, or the number of its points.  Points that do not fit the GPU together come in rounds, depth first to last,
colours last to first.
"""

from typing import TYPE_CHECKING

import numpy as np

from ..culling.cull import DrawList
from ..culling.occlusion import LAST, History, OcclusionPasses
from .batches import BatchTable, PageMap

if TYPE_CHECKING:
    import moderngl

    from ....model.reference.soft_z import SoftZ
    from ...picture.camera import Camera
    from ...stream.residency import Round
    from .mark_pages import MarkPages
    from .points import PointPages

FRAME_FIELDS = np.dtype(
    [("axes", "<f4", (3, 4)), ("lens", "<f4", 4), ("size", "<u4", 4), ("soft", "<f4", 4)]
)
"""The uniform block Frame of common_project.glsl (std140)."""


class Rasteriser:
    """Owns the targets of one picture size; ``run`` fills ``colour`` (RGBA8), ``depth`` (R32F, +inf where empty) and
    ``weight`` (R8: MAX_AVERAGED / 255 at most), row 0 at the top."""

    kind = ""
    overlap = 0  # points behind a page's end that a batch may include

    table: BatchTable
    hider: "OcclusionPasses | None" = None

    def __init__(self, context: "moderngl.Context", size: tuple[int, int]):
        self.context, self.size = context, size
        self.colour = context.texture(size, 4, dtype="f1")
        self.depth = context.texture(size, 1, dtype="f4")
        self.weight = context.texture(size, 1, dtype="f1")
        self._record = np.zeros((), FRAME_FIELDS)
        self._loaded: Round | None = None
        self.weighted = False  # whether points have weights in this picture
        self.edited = False  # whether edits remove or recolour points in this picture
        self.marks: MarkPages | None = None  # of its points

    def run(self, pages: "PointPages", draw: DrawList, camera: "Camera", soft: "SoftZ", rounds: "list[Round]", *,
            history: History | None = None, stations: np.ndarray | None = None, edits: bytes | None = None,
            marks: "MarkPages | None" = None) -> bool:
        """Rasterises a draw list in the rounds that ``pages`` prepared for it.

        stations: (MOST_STATIONS, 4) float32 view position of each scan's scanner, and 1, or 0 where unknown; None: all points
        count the same.
        edits: the block of viewer.render.raster.edit_block; None: every point is drawn as it is.
        marks: of the points, in pictures with edits; None: none is marked.
        history: hidden cells may be left out, where this rasteriser can and it is worth it.  Returns whether history was used.
        """
        raise NotImplementedError

    @property
    def can_hide(self) -> bool:
        """Whether this rasteriser can leave out hidden cells at this picture size."""
        return False

    def _begin(self, draw: DrawList, camera: "Camera", soft: "SoftZ", *, weighted: bool, edited: bool,
               marks: "MarkPages | None" = None) -> None:
        """Writes the Frame record, except for its size."""
        record = self._record
        record["axes"][:, :3] = draw.axes
        record["axes"][0, 3] = soft.unlit
        record["axes"][1, 3] = 0.0 if camera.orthographic is None else 1.0 / camera.orthographic
        record["lens"] = (camera.fx, camera.fy, camera.cx, camera.cy)
        record["soft"] = (1.0 + soft.relative, soft.absolute, 0.5 if soft.rounded else 0.0, float(soft.linear))
        self._loaded = None
        self.weighted, self.edited = weighted, edited
        self.marks = marks if edited else None

    def _bring(self, pages: "PointPages", draw: DrawList, part: "Round", group: np.ndarray | None = None) -> bool:
        """Loads the points of a round into the pages and fills ``table`` with its batches.  Returns whether this is news."""
        if part is self._loaded:
            return False
        if not pages.residency.complete:
            pages.load(part)
        if self.marks is not None:
            self.marks.follow(pages)
        where = PageMap.of(pages, self.overlap)
        self.table.fill(draw, where, group=group, groups=1 if group is None else LAST + 1, start=part.start, stop=part.stop)
        self._loaded = part
        return True

    def release(self) -> None:
        for texture in (self.colour, self.depth, self.weight):
            texture.release()
