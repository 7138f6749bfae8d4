"""Writes a publication: a folder whose index.html shows places of a scan in any browser, from a disk or from any web server.

    index.html page.css page.js    the page, the same for every scan
    scene.js                       names, places, notes, viewpoints, plans
    overview.html                  of several files: a plan with their outlines, names, dates, and the places
    places/000.first.js            of each place: small pictures and depth, enough to look around and to go on
    places/000.full.js             pictures at full size
    places/000.depth.js            depth at the size of the small pictures, to measure on
    places/000.second.js           the small pictures in another view
    notes/000.picture.js           the picture attached to a note

All of them are made in ``coming/`` and replace those of an earlier publication at the end, all at once (coming_files.py); the
files of one place appear there together, and the next run goes on with those of a run that was stopped.
Neither paths nor names of the machine are written: only what a person called things.
"""

import contextlib
import hashlib
import json
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....model.common.files.atomic_write import write_atomic
from ... import __version__
from ...common.errors import InputError, Option
from ...common.files import out_folder, write_together
from ...common.workers.run_tasks import run_tasks
from ...common.workers.worker_choice import Workers
from ...picture.edits import Edits
from ...picture.json_values import to_json
from ...picture.point_sets import NO_POINTS
from ...picture.spec import PictureSpec
from ..comparing.published_change import CHANGE, published_change
from .coming_files import ComingFiles
from .cube_faces import DISC, PlaceFaces, face_cameras, open_heading, render_place
from .data_scripts import base64_text, comment_of, script, webp_bytes
from .depth_codes import packed_depth
from .face_margins import BAND, MARGIN
from .note_pictures import picture_scripts
from .own_files import ENTRIES, OVERVIEW, PAGE_FILES, PARTS, check_folder
from .scene_data import scene_data

if TYPE_CHECKING:
    from ...grid.scene import Scene
    from ...picture.settings import Settings
    from ...render.described_picture import Composer
    from ...render.renderer import Renderer
    from ...work.document import Document
    from ..comparing.published_change import PublishedChange
    from .places import Place

PAGE = Path(__file__).parent / "page"
"""The page as it is copied; built from web/ by `make web`."""
_FORMAT = 1
"""Of the data; a folder of another format is made anew."""
_FIRST_QUALITY, _FULL_QUALITY, _SECOND_QUALITY = 86, 90, 70
"""WebP, chosen by eye.  Six filled faces of demo.laz have 172 kB at 512 pixels and 85, 812 kB at 1024 pixels and 92, six raw
ones 625 kB at 512 pixels and 70."""
FIRST_STRIDE = 2
"""The first depth has every second row and column of the full one: a quarter of its bytes, 350 kB (studio.laz, demo.laz)."""


@dataclass(frozen=True)
class Form:
    """side: pixels of a face, a multiple of ``small``.  small: of the first pictures, of depth and of the second view.
    second: a view without the network; ``change``: the comparison that the document has; or None."""

    side: int = 1024
    small: int = 512
    second: str | None = "raw"


@dataclass(frozen=True, eq=False)
class Publication:
    """All that a publication is made of.  title: for a person.  project: the file of the project, None for scans."""

    scene: "Scene"
    document: "Document"
    settings: "Settings"
    places: "list[Place]"
    out: Path
    title: str
    form: Form = Form()
    project: Path | None = None

    def write(self, renderer: "Renderer", composer: "Composer", problem: Callable[[str], object]) -> tuple[int, int]:
        """Makes the folder, in this process, which compresses a place while it renders the next one; as :meth:`write_by`."""
        return self.write_by(_Overlapped(self, renderer, composer), None, problem)

    def write_by(self, make: Any, workers: Workers | None, problem: Callable[[str], object]) -> tuple[int, int]:
        """Makes the folder.  make: does :meth:`write_place` for the number of a place, as run_tasks takes it.

        Returns how many places were rendered and the bytes of all files.  problem: is told, in a line, what is left out.
        Raises InputError where the folder holds other files, another process publishes into it, or it cannot be written,
        DeviceError where a picture cannot be made."""
        check_folder(self.out)
        change = self._change
        if self.document.comparison is not None and change is None:
            problem("the comparison that the project shows is not part of this publication: --second change shows it")
        attached, note_files = picture_scripts(self.document.annotations, self.project, problem)
        with self._coming.opened(self._waiting, len(self.places)):
            finished = [self._finished(number) for number in range(len(self.places))]
            missing = [number for number, record in enumerate(finished) if record is None]
            with closing(run_tasks(make, missing, workers, label="publishing", unit="place",
                                   name=lambda number: self.places[number].name)) as made:
                records = [next(made) if record is None else record for record in finished]
            sizes = [{part: self._file(number, part).stat().st_size for part in self._parts} for number in range(len(records))]
            data = scene_data(self.scene, self.document, self.places, records, title=self.title, view=self.settings.view,
                              attached=attached)
            data |= {"format": _FORMAT, "side": self.form.side, "small": self.form.small, "stride": FIRST_STRIDE,
                     "second": self.form.second, "sizes": sizes}
            data |= {} if change is None else {"change": change.data}
            if note_files:
                with out_folder(self._coming.folder / "notes"):
                    write_together(self._coming.folder / "notes", {
                        name: lambda path, data=data: path.write_bytes(data) for name, data in note_files.items()
                    })
            page = self._write_page(script("scene", data))
            places = [self._file(number, part).name for number in range(len(records)) for part in self._parts]
            self._coming.replace(places, [*page, *(["notes"] if note_files else [])])
        return len(missing), sum(file.stat().st_size for file in self.out.rglob("*") if file.is_file())

    def write_place(self, number: int, renderer: "Renderer", composer: "Composer") -> dict[str, Any]:
        """Renders a place and writes its files.  Returns its record."""
        faces, record = self.render_place(number, renderer, composer)
        self.write_faces(number, faces, record)
        return record

    def render_place(self, number: int, renderer: "Renderer", composer: "Composer") -> tuple[PlaceFaces, dict[str, Any]]:
        """The pictures of a place, and its record."""
        place = self.places[number]
        faces = render_place(renderer, composer, self._spec(place), place.position, side=self.form.side,
                             depth_side=self.form.small, second=self.form.second,
                             changes=None if self._change is None else self._change.levels)
        return faces, {"made_of": self._digest(place), "near": faces.scale.near, "step": faces.scale.step,
                       "floor": floor_below(faces), "yaw": open_heading(faces)}

    @property
    def _parts(self) -> tuple[str, ...]:
        return PARTS if self.form.second is not None else PARTS[:-1]

    @cached_property
    def _change(self) -> "PublishedChange | None":
        """The comparison, where it is the second view.  Raises InputError where it cannot be made."""
        if self.form.second != CHANGE:
            return None
        try:
            return published_change(self.scene, self.document.edits)
        except InputError as error:
            raise InputError((error, ", or leave it out with ", Option("--second", "raw"))) from None

    @property
    def _coming(self) -> ComingFiles:
        return ComingFiles(self.out, ENTRIES)

    def _file(self, number: int, part: str) -> Path:
        return self._coming.places / f"{number:03d}.{part}.js"

    @property
    def _edits(self) -> Edits:
        """Those of the document, without the tint of selected points and the colours of a comparison."""
        return replace(self.document.edits, selection=NO_POINTS, comparison=None)

    def _spec(self, place: "Place") -> PictureSpec:
        background = self.document.background if self.document.background in ("black", "plain") else "plain"
        camera = face_cameras(place.position, 8, self.document.up)[0]
        return PictureSpec(camera, self.settings, edits=self._edits, background=background)

    def _digest(self, place: "Place") -> str:
        """Stands for everything that the files of a place depend on."""
        sources = [Path(source) for source in self.scene.meta.sources]
        made_of = {
            "format": _FORMAT, "version": __version__, "points": self.scene.count, "bounds": self.scene.bounds.tolist(),
            "changed": [file.stat().st_mtime_ns if file.exists() else 0 for file in sources], "settings": asdict(self.settings),
            "edits": to_json(self._edits), "position": place.position.tolist(), "form": asdict(self.form),
            "background": self._spec(place).background,
            "quality": [_FIRST_QUALITY, _FULL_QUALITY, _SECOND_QUALITY, FIRST_STRIDE], "edges": [MARGIN, BAND],
        }  # fmt: skip
        if self.form.second == CHANGE:
            made_of["comparison"] = [to_json(self.document.comparison), DISC]
        return hashlib.sha256(json.dumps(made_of, sort_keys=True).encode()).hexdigest()

    def _finished(self, number: int) -> dict[str, Any] | None:
        """The record of a place whose files are there and were made of the same, by a run that was stopped or in the present
        publication, from which they are taken over."""
        files = [self._file(number, part) for part in self._parts]
        if (record := self._record(number, files)) is not None:
            return record
        record = self._record(number, [self.out / "places" / file.name for file in files])
        for file in files if record is not None else ():
            self._coming.keep(file.name)
        return record

    def _waiting(self) -> int:
        """How many places have been made and not been published yet."""
        return sum(self._record(number, [self._file(number, part) for part in self._parts]) is not None
                   for number in range(len(self.places)))

    def _record(self, number: int, files: list[Path]) -> dict[str, Any] | None:
        made_of = self._digest(self.places[number])
        if not all(file.is_file() for file in files):
            return None
        try:
            with files[0].open("rb") as file:
                record = json.loads(comment_of(file.read(1000)))
            numbers = [float(record[key]) for key in ("near", "step", "floor", "yaw")]
            good = record["made_of"] == made_of and np.isfinite(numbers).all()
        except (ValueError, KeyError, TypeError):
            return None
        return record if good else None

    def write_faces(self, number: int, faces: PlaceFaces, record: dict[str, Any]) -> None:
        """Compresses the pictures of a place and writes its files, all of them or none."""
        def pictures(made: np.ndarray, quality: int) -> list[str]:
            return [base64_text(webp_bytes(picture, quality)) for picture in made]

        def depth(stride: int) -> str:
            return base64_text(packed_depth(faces.codes[:, ::stride, ::stride], faces.measured[:, ::stride, ::stride]))

        values: dict[str, Any] = {
            "first": {"pictures": pictures(faces.first, _FIRST_QUALITY), "depth": depth(FIRST_STRIDE)},
            "full": {"pictures": pictures(faces.pictures, _FULL_QUALITY)},
            "depth": {"depth": depth(1)},
        }
        if faces.second is not None:
            values["second"] = {"pictures": pictures(faces.second, _SECOND_QUALITY)}
        files = {part: script(f"{number}.{part}", value, json.dumps(record)) for part, value in values.items()}
        write_together(self._coming.places, {
            self._file(number, part).name: lambda path, data=data: path.write_bytes(data) for part, data in files.items()
        })

    def _write_page(self, scene_script: bytes) -> list[str]:
        """Returns the names of its files."""
        from html import escape

        files = {"scene.js": scene_script, **{name: (PAGE / name).read_bytes() for name in PAGE_FILES}}
        if len(self.scene.meta.sources) > 1 and self.scene.records is not None:
            from .overview_page import overview_page

            page = overview_page(self.scene, self.title, edits=self._edits, up=self.document.up, places=self.places)
            files[OVERVIEW] = page.encode("utf-8")
        files["index.html"] = files["index.html"].replace(b"{{title}}", escape(self.title).encode("utf-8", "replace"))
        for name, data in files.items():
            write_atomic(self._coming.folder / name, lambda path, data=data: path.write_bytes(data))
        return list(files)


@dataclass(frozen=True, eq=False)
class _Overlapped:
    """``write_place`` for run_tasks: a thread compresses and writes one place while the next one is rendered."""

    made: Publication
    renderer: "Renderer"
    composer: "Composer"

    @contextlib.contextmanager
    def opened(self) -> Iterator[Callable[[int], dict[str, Any]]]:
        with ThreadPoolExecutor(1) as pool:
            before: list[Future[None]] = []

            def write_place(number: int) -> dict[str, Any]:
                faces, record = self.made.render_place(number, self.renderer, self.composer)
                if before:  # no more than one waits: a place has 30 MB
                    before.pop().result()
                before.append(pool.submit(self.made.write_faces, number, faces, record))
                return record

            try:
                yield write_place
            finally:
                if before:
                    before.pop().result()


def floor_below(faces: PlaceFaces) -> float:
    """Distance from the eye straight down to the surface there; 0 where nothing is below."""
    side = faces.codes.shape[1]
    middle = slice(side // 2 - side // 16, side // 2 + side // 16)
    depth = faces.scale.depths(faces.codes[-1, middle, middle])
    return float(np.median(depth[depth > 0])) if (depth > 0).any() else 0.0

