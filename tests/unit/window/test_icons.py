"""Every icon of the interface is a letter of a typeface that is added to the interface's fonts."""

import pytest

from pointglass.viewer.window.interaction.table import TOOLS
from pointglass.viewer.window.kit import icons


def test_every_icon_is_in_the_typeface():
    imgui = pytest.importorskip("imgui_bundle", reason="the window's packages are not installed").imgui
    from PIL import ImageFont

    from pointglass.viewer.window.kit.theme import ICONS

    assert imgui is not None
    font = ImageFont.truetype(str(ICONS), 16)
    missing = font.getmask("\U000fffff").getbbox(), bytes(font.getmask("\U000fffff"))
    for icon in icons.USED:
        drawn = font.getmask(icon)
        assert drawn.getbbox() is not None and (drawn.getbbox(), bytes(drawn)) != missing, hex(ord(icon))


def test_every_tool_has_an_icon_of_its_own():
    found = [tool.icon for tool in TOOLS]
    assert len(set(found)) == len(found) and all(icon in icons.USED for icon in found)
