"""The tools and overlays of the window.  A new tool or overlay is one row here.

The order is that of the buttons; Fly stays first because it receives what the selected tool leaves.
"""

from .clipping.clip_tool import ClipOutlines, ClipTool
from .colours import AttributeLegend, Colours
from .comparing.compare_tool import Compare
from .film.film_tool import Film
from .fly import Fly
from .inspect_point import InspectPoint, UnderPointer
from .measuring.drawing import Measurements
from .measuring.measure import Measure
from .meshes.mesh_tool import Meshes
from .notes.note_markers import NoteMarkers
from .notes.notes_tool import Notes
from .registering.align_tool import Align
from .scene_settings import SceneSettings
from .section.section_tool import SectionTool
from .selecting.select_tool import Select
from .stations.stations_tool import Stations
from .tool import Overlay, Tool
from .toolbox import Toolbox
from .what_is_real import WhatIsReal

TOOLS: tuple[type[Tool], ...] = (
    Fly, InspectPoint, Measure, Notes, Select, ClipTool, SectionTool, Colours, Stations, Align, Compare, Meshes, WhatIsReal,
    Film, SceneSettings,
)  # fmt: skip
OVERLAYS: tuple[type[Overlay], ...] = (UnderPointer, ClipOutlines, Measurements, NoteMarkers, AttributeLegend)


def toolbox() -> Toolbox:
    """New tools and overlays, for one window."""
    return Toolbox([make() for make in TOOLS], [make() for make in OVERLAYS])
