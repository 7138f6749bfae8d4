"""Arrow keys in an open list of choices or menu: imgui has the keys while one is open, the tools and the camera otherwise."""

from typing import Any


def list_is_open(imgui: Any) -> bool:
    """Whether a list of choices or a menu is open; a dialog is none, it has keys of its own."""
    return imgui.is_popup_open("", imgui.PopupFlags_.any_popup) and imgui.internal.get_top_most_popup_modal() is None


def keys_in_lists(imgui: Any) -> None:
    """While a list is open, arrow keys move in it and Enter chooses; otherwise imgui leaves the keys to the tools and the
    camera."""
    io, navigation = imgui.get_io(), imgui.ConfigFlags_.nav_enable_keyboard
    io.config_flags = io.config_flags | navigation if list_is_open(imgui) else io.config_flags & ~navigation
