"""The photographs of a scan: which are in reach of a view, prepared by need and kept within a budget of memory.

A photograph is decoded and compared with the points once (viewer.render.photographs.photo_fit); one that does not fit is left
out, and named in the log.  ``ready(wait=True)`` is pure: the same camera gives the same photographs.  Without waiting, a thread
prepares those that are missing.
"""

import logging
import threading
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ....model.common.process.processors import usable_processors
from ...common.errors import InputError
from ...readers.e57.e57_photographs import KINDS
from ...readers.photographs.posed_photograph import PosedPhotograph
from .photo_fit import PhotoFit, PointSample, fitted, point_sample, unfitted
from .photo_pool import PhotoPool, PreparedPhoto, prepared_photo
from .shadow_kernels import count_votes

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.camera import Camera

BUDGET = 1 << 30
"""Bytes of decoded photographs that are kept: a choice, 24 panoramas of 4096 x 2048 with their mip levels."""
LONGEST = 4096
"""Pixels of a photograph's longer side as it is kept; larger ones are averaged down, as in the station view."""
IN_REACH = 24
"""Photographs at most for one picture."""
PLACES = 600
"""Places in the view by which photographs are chosen."""
FADE = 6
"""Pictures over which a photograph fades in that arrives while the window shows others: 0.4 s at 15 pictures a second."""
LEAST_VOTES = 0.002
"""Share of all votes below which a photograph is not worth its memory."""

log = logging.getLogger(__name__)


class PhotoLibrary:
    """The posed photographs of one scene.

    wake: called, also on another thread, when a photograph has been prepared that a picture lacked, and while one fades in.
    checked: whether they are compared with the points, which a benchmark's are not.
    missing: photographs that the last picture lacked.  arrived: whether the next picture shows more of them.
    """

    def __init__(self, scene: "Scene", photographs: list[PosedPhotograph], wake: Callable[[], None] = lambda: None,
                 *, checked: bool = True):
        self.photographs, self._scene, self._wake, self._checked = photographs, scene, wake, checked
        sizes = [_words(photo) for photo in photographs]
        slot = max(sizes)
        count = int(np.clip(BUDGET // (4 * slot), 4, len(photographs)))
        self.pool = PhotoPool(count, slot)
        self.missing, self._fading = 0, False
        self._fits: dict[int, PhotoFit | None] = {}
        self._coming: dict[int, Future[PreparedPhoto | None]] = {}
        self._threads: ThreadPoolExecutor | None = None
        self._survey: Future[None] | None = None
        self._unsurveyed = False  # whether the last picture lacked photographs since nothing was known of the points
        self._sampling = threading.Lock()
        self._chosen: tuple[tuple, list[int]] | None = None
        self._lone: tuple[int, Future[PhotoPool]] | None = None

    @cached_property
    def _sample(self) -> PointSample:
        return point_sample(self._scene)

    @cached_property
    def _geometry(self) -> tuple[np.ndarray, ...]:
        """Of each photograph what count_votes takes; shifts are relative to the sample's origin."""
        poses = np.stack([photo.camera_to_world for photo in self.photographs])
        turns = np.ascontiguousarray(poses[:, :3, :3].transpose(0, 2, 1))
        shifts = np.einsum("nij,nj->ni", turns, self._sampled().origin - poses[:, :3, 3])
        return (turns, shifts, np.array([KINDS.index(photo.kind) for photo in self.photographs]),
                np.array([photo.lens for photo in self.photographs], np.float64),
                np.array([photo.around for photo in self.photographs]),
                np.array([(photo.width, photo.height) for photo in self.photographs], np.float64))  # fmt: skip

    @cached_property
    def _numbers(self) -> dict[tuple, int]:
        return {photo.key: number for number, photo in enumerate(self.photographs)}

    def number_of(self, photo: PosedPhotograph) -> int | None:
        """Of a photograph at the same pose, also one that was read again; None where it is not here."""
        return self._numbers.get(photo.key)

    def _sampled(self) -> PointSample:
        with self._sampling:
            return self._sample

    @cached_property
    def _places(self) -> np.ndarray:
        """(n, 3) float32: an even part of the sample, relative to its origin."""
        points = self._sampled().points
        return points[np.random.default_rng(0).permutation(len(points))[: 40 * PLACES]]

    def in_reach(self, camera: "Camera") -> list[int]:
        """The photographs that show best what the camera sees, at most IN_REACH, in the order of their numbers."""
        if self._chosen is not None and self._chosen[0] == camera.key:
            return self._chosen[1]
        places, rays = self._in_view(camera)
        votes = np.zeros(len(self.photographs))
        count_votes(places, rays, votes, *self._geometry)
        most = min(IN_REACH, self.pool.count)
        best = [int(k) for k in np.argsort(-votes, kind="stable")[:most] if votes[k] > LEAST_VOTES * votes.sum()]
        self._chosen = camera.key, sorted(best)
        return self._chosen[1]

    def _in_view(self, camera: "Camera") -> tuple[np.ndarray, np.ndarray]:
        """The first PLACES of the places that lie in the view, and the unit rays to them, (n, 3) float64 each."""
        eye, rotation = camera.position - self._sampled().origin, camera.view_rotation.astype(np.float32)
        found: list[np.ndarray] = []
        for first in range(0, len(self._places), 4 * PLACES):  # mostly a few parts hold enough
            part = self._places[first : first + 4 * PLACES]
            x, y, z = rotation @ (part - eye).T
            with np.errstate(divide="ignore", invalid="ignore"):
                u, v = camera.fx * x / z + camera.cx, camera.fy * y / z + camera.cy
                found.append(part[(z > 0) & (u >= 0) & (u < camera.width) & (v >= 0) & (v < camera.height)])
            if sum(map(len, found)) >= PLACES:
                break
        places = np.concatenate([self._places[:0], *found])[:PLACES]
        rays = (places - eye).astype(np.float64)
        rays /= np.maximum(np.linalg.norm(rays, axis=1, keepdims=True), 1e-12)
        return places.astype(np.float64), rays

    def ready(self, camera: "Camera", *, wait: bool) -> list[int]:
        """Numbers of the photographs in reach that are in the pool now.  wait: for all of them; else a thread prepares them,
        and each fades in over FADE pictures, the first one once the points have been sampled, also on a thread."""
        self._unsurveyed = not (wait or self._surveyed())
        if self._unsurveyed:
            return []
        wanted = [number for number in self.in_reach(camera) if self._fits.get(number, True) is not None]
        absent = [number for number in wanted if number not in self.pool]
        if absent:
            self._begin(absent)
        keep, presence = frozenset(wanted), self.pool.presence
        for number in list(presence):
            presence[number] += 1.0 / FADE
            if wait or presence[number] > 1.0 - 0.5 / FADE:
                del presence[number]
        for number in absent:
            coming = self._coming[number]
            if wait or coming.done():
                photo = self._come(number, wait=wait)
                if photo is not None:
                    self.pool.put(number, photo, keep)
                    if not wait:
                        presence[number] = 1.0 / FADE
        self.missing = sum(number in self._coming for number in absent)
        self._fading = not keep.isdisjoint(presence)
        if self._fading:
            self._wake()
        return [number for number in wanted if number in self.pool]

    def _come(self, number: int, *, wait: bool) -> PreparedPhoto | None:
        """What a thread made of a photograph.  An unforeseen error ends a still picture, which shall lack nothing; a window
        goes on without the photograph."""
        try:
            return self._coming.pop(number).result()
        except Exception:
            if wait:
                raise
            log.exception("%s could not be prepared; left out of pictures", self.photographs[number].name)
            self._fits[number] = None
            return None

    def alone(self, number: int, *, wait: bool) -> PhotoPool | None:
        """A pool with one photograph as number 0, whether or not it fits the points; None while a thread prepares it.

        Raises InputError where the photograph is damaged."""
        if self._lone is None or self._lone[0] != number:
            self._lone = number, self._pool_of_threads().submit(self._prepared_alone, number)
            self._lone[1].add_done_callback(lambda _: self._wake())
        return self._lone[1].result() if wait or self._lone[1].done() else None

    @property
    def arrived(self) -> bool:
        """Whether a photograph that the last picture lacked is there now, or one in it has not faded in."""
        if self._unsurveyed:
            return self._survey is not None and self._survey.done()
        return self._fading or (self.missing > 0 and any(coming.done() for coming in self._coming.values()))

    def _surveyed(self) -> bool:
        """Whether the points are sampled and the photographs can be chosen; else a thread begins with it: half a second."""
        if "_geometry" in self.__dict__ and "_places" in self.__dict__:
            return True
        if self._survey is None:
            self._survey = self._pool_of_threads().submit(self._look_at_points)
            self._survey.add_done_callback(lambda _: self._wake())
        if self._survey.done():
            self._survey.result()  # raises what it raised
        return self._survey.done()

    def _look_at_points(self) -> None:
        for kept in ("_places", "_geometry"):
            getattr(self, kept)

    def _begin(self, numbers: list[int]) -> None:
        for number in numbers:
            if number not in self._coming:
                self._coming[number] = self._pool_of_threads().submit(self._prepare, number)
                self._coming[number].add_done_callback(lambda _: self._wake())

    def _pool_of_threads(self) -> ThreadPoolExecutor:
        if self._threads is None:
            self._threads = ThreadPoolExecutor(min(2, usable_processors()), "photographs")
        return self._threads

    def _prepared_alone(self, number: int) -> PhotoPool:
        """On a thread.  Raises InputError."""
        photo = self.photographs[number]
        picture, valid = photo.decode(LONGEST)
        fit = self._fit(number, picture, valid) or unfitted(photo, picture.shape[:2], self._sampled())
        made = _made_ready(photo, picture, valid, fit)
        pool = PhotoPool(1, len(made.words))
        pool.put(0, made)
        return pool

    def _prepare(self, number: int) -> PreparedPhoto | None:
        """On a thread: decoded and fitted; None where it is left out, which the log says."""
        photo = self.photographs[number]
        try:
            picture, valid = photo.decode(LONGEST)
        except InputError as error:
            log.warning("%s; left out of pictures", error)
            self._fits[number] = None
            return None
        fit = self._fit(number, picture, valid)
        return None if fit is None else _made_ready(photo, picture, valid, fit)

    def _fit(self, number: int, picture: np.ndarray, valid: np.ndarray | None) -> PhotoFit | None:
        """None where it does not fit, which the log says once."""
        photo = self.photographs[number]
        if not self._checked:
            return unfitted(photo, picture.shape[:2], self._sampled())
        if number not in self._fits:
            fit = fitted(photo, picture, valid, self._sampled())
            if fit is not None and not fit.fits:
                log.warning("%s does not fit the points (it explains %.0f %% of their differences in colour, the median "
                            "difference is %.0f of 255); left out of pictures", photo.name, 100 * fit.explained, fit.difference)
                fit = None
            elif fit is not None and fit.refined:
                log.warning("%s: its pose was turned by %.2f degrees to fit the points", photo.name, fit.refined)
            self._fits[number] = fit
        return self._fits[number]

    def release(self) -> None:
        """Ends its threads."""
        if self._threads is not None:
            self._threads.shutdown(wait=True, cancel_futures=True)
            self._threads = None


def _made_ready(photo: PosedPhotograph, picture: np.ndarray, valid: np.ndarray | None, fit: PhotoFit) -> PreparedPhoto:
    height, width = picture.shape[:2]
    across, down = width / photo.width, height / photo.height
    fx, fy, cx, cy = photo.lens
    lens = fx * across, fy * down, cx * across, cy * down
    return prepared_photo(picture, valid, KINDS.index(photo.kind), lens, photo.around, fit.camera_to_world, fit.nearest,
                          fit.gains)  # fmt: skip


def _words(photo: PosedPhotograph) -> int:
    """Words at most of a photograph in the pool: mip levels with repeated borders, and the shadow map."""
    share = min(1.0, LONGEST / max(photo.width, photo.height))
    width, height = photo.width * share + 2, photo.height * share + 2
    return int(width * height * 4 / 3 + 8 * (width + height)) + 64 + int(width * height / 9) + 64


def library_of(scene: "Scene", wake: Callable[[], None] = lambda: None) -> PhotoLibrary | None:
    """The photographs in the E57 files of a scene; None where there are none with a pose."""
    from ...preprocess.scan_description import RecordOrigin
    from ...readers.moved_source import moved_pose

    found: list[PosedPhotograph] = []
    origin = scene.meta.records or RecordOrigin()
    for number, source in enumerate(map(Path, scene.meta.sources)):
        if source.suffix.lower() != ".e57" or not source.is_file():
            continue
        from dataclasses import replace

        from ...readers.e57.e57_photographs import posed_photographs

        try:
            posed, _ = posed_photographs(source)
        except InputError as error:
            log.warning("%s", error)
            continue
        move = origin.move_of(number)
        found += [replace(photo, camera_to_world=moved_pose(move, photo.camera_to_world)) for photo in posed]
    return PhotoLibrary(scene, found, wake) if found else None
