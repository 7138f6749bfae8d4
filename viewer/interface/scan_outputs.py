"""What a scan is written to and shown in besides pictures: files of points and splats, fitted surfaces, views of notebooks."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any, Literal

import numpy.typing as npt

from ..picture.camera import Camera
from ..picture.views import ViewName
from .arguments import PathLike, path_of, python_names

if TYPE_CHECKING:
    from ..grid.scene import Scene
    from ..work.fits.fit import Fit


class ScanOutputs:
    """The part of :class:`Scan` that needs no picture of its own."""

    _name: str
    render: Callable[..., Any]

    @property
    def _open(self) -> Scene:
        raise NotImplementedError

    def export(
        self, path: PathLike, *, clip: npt.ArrayLike | None = None, stations: Iterable[int] | None = None,
        classes: Iterable[int] | None = None,
        exposures: Literal["as-scanned", "matched"] = "as-scanned", all_columns: bool = False, reproject: str | None = None,
        splats: bool = False, budget: int | None = None,
    ) -> int:  # fmt: skip
        """Writes measured points as a LAS, LAZ, PLY or E57 file, by its ending; returns how many.  ``pointglass export`` too.
        Names that end in .glb, .spz or splats.ply get Gaussian splats made from the points, with compensated exposures.

        The scan's files are read again and whole records are copied: every attribute, and the colours of the file.  What the
        format cannot hold is reported in one line to ``logging``, as a warning.  An existing file is replaced, in one step.
        clip: (2, 3) lowest and highest corner in file coordinates, such as ``scan.bounds``, or (B, 2, 3) boxes that add up.
        stations: rows of :attr:`stations` whose points are written; None: all.  classes: codes of LAS likewise.
        exposures: matched writes the colours as they are drawn.  all_columns: PLY: also columns besides coordinates, colour,
        intensity, scan and class.
        reproject: an EPSG code, "EPSG:25832", into whose coordinates the points are transformed; "auto": the UTM zone.
        splats: PLY: splats whatever the name.  budget: splats at most; None: two million.
        Raises InputError naming the argument; then nothing is left behind.
        """
        from .export_points import export_points

        with python_names():
            return export_points(self._open, path_of(path), clip, stations, exposures, all_columns, reproject, classes,
                                 splats, budget)

    def show(self, camera: Camera | None = None, *, view: ViewName = "neural", height: int = 480,
             up: npt.ArrayLike = (0.0, 0.0, 1.0)) -> Any:  # fmt: skip
        """A view to look around in, as the value of a notebook's cell (JupyterLab, VS Code): drag, wheel, W A S D Q E, Home.

        This process renders: quick pictures in motion, ``view`` at rest.  ``camera`` of what is returned is the present camera.
        camera: where to begin; None: the start viewpoint.  height: logical pixels.  up: (3,) direction that is up.
        Raises InputError naming the argument, or where anywidget is missing (``pip install 'pointglass[notebook]'``).
        """
        from .notebook.show_scan import show_scan

        with python_names():
            return show_scan(self.render, self._open, self._name, camera, view, height, up)

    def fit(self, position: npt.ArrayLike, kind: Literal["plane", "pipe", "circle"] = "plane") -> Fit:
        """The surface of a kind at a place on the scan, from all of it that is measured, with its uncertainty at 95 %.

        position: (3,) file coordinates; the nearest measured point counts.  Its radius, direction and uncertainties are fields
        of what is returned.  Raises PointglassError where nothing of this kind lies there.
        """
        from .fit_surface import fit_surface

        with python_names():
            return fit_surface(self._open, position, kind)
