"""The settings that were chosen, two views compared, and the network that a choice may have to wait for.

A choice that needs a network which is not loaded is shown at once; the picture follows when the network has been loaded.
Where that fails, the choice is undone and a message says why.
"""

import operator
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from ...common.errors import InputError
from ...common.paths import own_weights
from ...picture.settings import Settings
from ...picture.views import POINT_VIEWS, VIEWS
from ..kit.notices import Notices
from ..kit.worker import Worker
from .folder_photographs import PhotoFolder
from .networks import network_key, smaller_networks
from .picture_plan import RefinementState

if TYPE_CHECKING:
    from ...render.renderer import Renderer
    from ...work.document import Document


class ViewSettings:
    """settings: what pictures are made with.  wanted: settings that wait for their network, else None.
    split: whether views are compared, ``left`` at the left of ``split_at`` (0 to 1 of the width).
    two_dates: whether the sides show two dates, and may have one view.
    background: what is laid behind the picture, a key of viewer.picture.background.COLOURS.
    photo_folder: of photographs, that the settings name or named.
    own_weights: name -> file of the user's own weights.  network_load: the load under way.

    picture: marked as out of date by changes.  load_network, wake: replaceable in tests.
    """

    def __init__(
        self,
        settings: Settings,
        picture: RefinementState,
        notices: Notices,
        load_network: Callable[[Settings], None],
        wake: Callable[[], None],
    ):
        self._picture, self._notices = picture, notices
        self.load_network, self._wake = load_network, wake
        self.own_weights = own_weights()
        self.settings = replace(settings, view="filled") if settings.view == "neural" else settings
        self.wanted: Settings | None = None
        self.split, self.split_at, self.left = False, 0.5, "raw"
        self.two_dates = False
        self.background = "plain"
        self.photo_folder = PhotoFolder()
        self._right = "filled"
        self._put_aside: str | None = None  # the view before points were coloured by attribute
        self._left_wanted: str | None = None
        self.network_load: Worker | None = None
        self._loaded: tuple | None = None  # the key of what is loading
        self._networks: set[tuple] = set()
        self._last_good = replace(settings, view="raw")
        self._failed: set[Settings] = set()
        if settings != self.settings:
            self.request(settings)

    @property
    def shown_settings(self) -> Settings:
        """What the panel shows: the settings asked for, even while their network loads."""
        return self.wanted or self.settings

    @property
    def sides(self) -> tuple[str, ...]:
        """The view shown, or the two that are compared, left first."""
        return (self.left, self.settings.view) if self.split else (self.settings.view,)

    @property
    def shows_points(self) -> bool:
        """Whether the view that was chosen, or one of the two that are compared, shows points alone."""
        return self.shown_settings.view in POINT_VIEWS or (self.split and self.left in POINT_VIEWS)

    @property
    def networks(self) -> tuple[str, ...]:
        """The quality chosen, then those of smaller networks that are loaded with it, for flight."""
        return self.settings.quality, *smaller_networks(self.settings)

    # -- settings ----------------------------------------------------------------------------------------------------

    def request(self, settings: Settings) -> None:
        """Requests settings.  Where they need a network that is not loaded, the picture stays until it is."""
        if settings == self.shown_settings:
            return
        if settings.view != "raw":
            self._right = settings.view
        neural = settings.view == "neural" or (self.split and self.left == "neural")
        network = operator.attrgetter("quality", "weights", "precision", "device")
        neural |= network(settings) != network(self.settings)  # missing weights or devices are reported at once
        if neural and network_key(settings) not in self._networks:
            self._wait_for_network(settings)
            return
        self.settings, self.wanted = settings, None
        self._picture.renew()

    def begin(self, document: "Document") -> None:
        """A document is opened: a project brings its settings; a scan in its own colours is not shown as the last one, where
        that was coloured by attribute."""
        if not document.look.recolours:
            self.show_colours()
        if document.view is not None:
            self.request(document.settings)
            self.background = document.background

    def give_photographs(self, renderer: "Renderer") -> None:
        """Has a renderer use the folder of photographs that the settings name.  Where it cannot be read, a message says why,
        and the settings go on without it."""
        try:
            self.photo_folder.give(renderer, self.settings.photos)
        except InputError as error:
            self._notices.say("Photographs are left out", error)
            self.settings = replace(self.settings, photos="auto")
            self.wanted = self.wanted and replace(self.wanted, photos="auto")

    def show_photographs(self, on: bool) -> None:
        """Colours surfaces by photographs, of the folder that was named or else of the scan, or not."""
        self.request(replace(self.shown_settings, photos=(self.photo_folder.name or "auto") if on else "off"))

    def show_points(self) -> None:
        """Chooses a view that colours points by attribute; :meth:`show_colours` comes back to the present one."""
        self._put_aside = self.shown_settings.view
        self.request(replace(self.shown_settings, view="filtered"))

    def show_colours(self) -> None:
        """Points have their own colours again, or another scan is shown: the view that :meth:`show_points` put aside, unless
        another was chosen meanwhile."""
        view, self._put_aside = self._put_aside, None
        if view is not None and self.shown_settings.view == "filtered":
            self.request(replace(self.shown_settings, view=view))

    def show(self, view: str) -> None:
        """Chooses the view (in a comparison: the right side)."""
        self._put_aside = None
        self.request(replace(self.shown_settings, view=view))

    def worked(self) -> None:
        """A picture was made with the settings."""
        self._last_good = self.settings
        self._failed.clear()

    def fall_back(self) -> bool:
        """No picture can be made with the settings: returns to those that worked last.  False where nothing is left to try."""
        self._failed.add(self.settings)
        tries = [self._last_good, replace(self._last_good, view="raw", raster="auto", soft_z="auto", lod=None)]
        back = next((settings for settings in tries if settings not in self._failed), None)
        self.split = False
        self.settings = back or self.settings
        return back is not None

    # -- comparison --------------------------------------------------------------------------------------------------

    def compare(self, on: bool) -> None:
        """Splits the picture, raw on the left unless chosen otherwise, or undoes it."""
        self.split, self._picture.dirty = on, True
        if on and self.shown_settings.view == self.left and not self.two_dates:
            self.show(self._right if self._right != self.left else next(v for v in VIEWS if v != self.left))

    def compare_dates(self, on: bool) -> None:
        """The sides of the handle show two dates from now on, in the view that is shown, or the same points."""
        if on != self.two_dates:
            self.two_dates, self._picture.dirty = on, True
            self.left, self._left_wanted = self.settings.view if on else "raw", None
            self.split = self.split and on

    def choose_left(self, view: str) -> None:
        """The left side of the comparison."""
        self._picture.dirty = True
        if view == "neural" and network_key(self.shown_settings) not in self._networks:
            self._left_wanted = view  # shown once its network is there; see poll
            self._wait_for_network(self.shown_settings)
        else:
            self.left, self._left_wanted = view, None

    # -- the network -------------------------------------------------------------------------------------------------

    def _wait_for_network(self, settings: Settings) -> None:
        """Loads the network of ``settings``; after the one that is loading, where there is one."""

        self.wanted = settings
        if self.network_load is None:
            self._loaded = network_key(settings)
            self.network_load = Worker(lambda: self.load_network(settings), "Loading the network", self._wake)

    def poll(self) -> None:
        """Applies the choice that waited for the network, or undoes it with a message."""
        work = self.network_load
        if work is None or not work.finished:
            return
        self.network_load, loaded = None, self._loaded
        wanted = self.wanted
        if work.error is not None:
            self._notices.say("The network cannot be used", work.error)
            if wanted is not None and network_key(wanted) != loaded:  # another was chosen meanwhile
                self._wait_for_network(wanted)
            else:
                self.wanted = self._left_wanted = None
            return
        assert loaded is not None
        self._networks.add(loaded)
        if self._left_wanted is not None and network_key(self.shown_settings) in self._networks:
            self.left, self._left_wanted = self._left_wanted, None
            self._picture.dirty = True
        if wanted is not None:
            self.wanted = None
            self.request(wanted)

    def close(self) -> None:
        """Waits until a network under way is loaded."""
        if self.network_load is not None:
            self.network_load.join(15.0)
