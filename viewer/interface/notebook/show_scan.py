"""Checks what ``Scan.show`` is given and makes its widget."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ...common.errors import InputError
from ...picture.camera import Camera
from ..arguments import settings_of, vector_of
from .guided_view import LARGEST, GuidedView

if TYPE_CHECKING:
    from ...grid.scene import Scene


def show_scan(render: Callable[..., Any], scene: Scene, name: str, camera: Camera | None, view: str, height: int,
              up: npt.ArrayLike) -> Any:  # fmt: skip
    """See Scan.show.  render: ``Scan.render``."""
    settings_of(view, {})
    if camera is not None and not isinstance(camera, Camera):
        raise InputError("expected a pointglass.Camera, as look_at makes one, or None", option="camera", value=camera)
    if isinstance(height, bool) or not isinstance(height, int) or not 100 <= height <= LARGEST:
        raise InputError(f"expected whole pixels from 100 to {LARGEST}", option="height", value=height)
    axis = vector_of("up", up)
    if not axis.any():
        raise InputError("up [0, 0, 0]: expected a direction, such as (0, 0, 1)")
    try:
        from .scan_widget import ScanWidget
    except ImportError:
        raise InputError("show needs anywidget", remedy="pip install 'pointglass[notebook]'") from None
    guided = GuidedView(scene, render, view=view, start=camera, up=axis / np.linalg.norm(axis))
    return ScanWidget(guided, height=height, title=name)
