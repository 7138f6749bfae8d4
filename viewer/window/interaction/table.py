"""The tools and overlays of the window.  A new tool or overlay is one row here.

The order is that of the buttons; Fly stays first because it receives what the selected tool leaves.
"""

from viewer.window.interaction.clip_tool import ClipOutlines, ClipTool
from viewer.window.interaction.colours import AttributeLegend, Colours
from viewer.window.interaction.film_tool import Film
from viewer.window.interaction.fly import Fly
from viewer.window.interaction.inspect_point import InspectPoint, UnderPointer
from viewer.window.interaction.measure import Measure, Measurements
from viewer.window.interaction.scene_settings import SceneSettings
from viewer.window.interaction.section_tool import SectionTool
from viewer.window.interaction.stations import Stations
from viewer.window.interaction.tool import Overlay, Tool, Toolbox
from viewer.window.interaction.what_is_real import WhatIsReal

TOOLS: tuple[type[Tool], ...] = (
    Fly, InspectPoint, Measure, ClipTool, SectionTool, Colours, Stations, WhatIsReal, Film, SceneSettings,
)  # fmt: skip
OVERLAYS: tuple[type[Overlay], ...] = (UnderPointer, ClipOutlines, Measurements, AttributeLegend)


def toolbox() -> Toolbox:
    """New tools and overlays, for one window."""
    return Toolbox([make() for make in TOOLS], [make() for make in OVERLAYS])
