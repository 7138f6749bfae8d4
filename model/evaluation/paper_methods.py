"""The methods of the paper's table: hole filling, networks, functions of your own, and pictures in a folder."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from types import SimpleNamespace
from typing import Protocol

import numpy as np
import torch
from PIL import Image, UnidentifiedImageError
from torch import Tensor, nn

from ..common.errors import DataError
from ..data.dataset import MemoryPicture, MergedScan, TruePicture
from ..data.surfaces.projected import Projected, raster_of
from ..network.reconstruct import PRECISIONS
from ..network.unet import CompactUNet
from ..network.weights import load_weights
from ..reference.depth_filter import keep_mask
from ..reference.projection import SoftZ, network_input, pixels, rasterise
from .outside import density_folder
from .own_methods import OwnNetwork, OwnPicture


@dataclass(frozen=True)
class Shown:
    """What a method makes a picture of.

    scan: all points.  seen: those in the picture at this density.  spacing: of the points at this density, metres.  density:
    share of the points.  place: name.  view: the true picture at its own size.
    """

    scan: MergedScan
    seen: Projected
    spacing: float
    density: float
    place: str
    view: TruePicture


class PaperMethod(Protocol):
    """A method of the table.  name: unique."""

    @property
    def name(self) -> str: ...

    def picture(self, shown: Shown) -> Tensor:
        """(3, H, W) in 0..1."""
        ...

    def seconds(self, shown: Shown, repeats: int) -> tuple[float, float] | None:
        """Median seconds of a frame, and of the network alone (0 without one); None where it is not measured."""
        ...


class Reconstruction:
    """Pull-push behind our filter, and a network if there is one.

    network: (6, H, W) -> (3, H, W) on the device; None: hole filling only.  filtered: whether it takes filtered points.
    """

    def __init__(self, name: str, network: Callable[[Tensor], Tensor] | None, device: str, *, filtered: bool = True):
        self.name, self.network, self.device, self.filtered = name, network, device, filtered

    def reconstruct(self, given: Tensor) -> Tensor:
        """(6, H, W) network input -> (3, H, W) in 0..1."""
        return given[:3].clamp(0, 1) if self.network is None else self.network(given)

    def _mask(self, depth: Tensor) -> Tensor:
        return keep_mask(depth, "auto" if self.filtered else "off")

    def picture(self, shown: Shown) -> Tensor:
        """(3, H, W) in 0..1."""
        raster = raster_of(shown.seen, torch.ones(len(shown.seen.z), dtype=torch.bool), shown.spacing)
        given = network_input(raster, self._mask(raster.depth), shown.seen.camera.fx, shown.spacing)
        return self.reconstruct(given.to(self.device)).cpu()

    @torch.inference_mode()
    def seconds(self, shown: Shown, repeats: int) -> tuple[float, float]:
        """From points on the device to the picture."""
        camera, pose, scan = shown.seen.camera, shown.seen.camera_to_world, shown.scan
        chosen = np.random.default_rng(0).random(len(scan.xyz)) < shown.density
        xyz = torch.from_numpy((scan.xyz[chosen] - pose[:3, 3]).astype(np.float32)).to(self.device)
        rgb = torch.from_numpy(scan.rgb[chosen]).to(self.device)
        rotation = torch.from_numpy((pose[:3, :3] * (1.0, -1.0, -1.0)).astype(np.float32)).to(self.device)
        soft = SoftZ.preset("auto", shown.spacing, 1.0)

        def frame() -> Tensor:
            x, y, z = (xyz @ rotation).unbind(1)
            index, inside = pixels(x, y, z, camera)
            raster = rasterise(index, z[inside], rgb[inside], camera.width, camera.height, soft)
            return network_input(raster, self._mask(raster.depth), camera.fx, shown.spacing)

        given = frame()
        whole = median_seconds(lambda: self.reconstruct(frame()), self.device, repeats)
        alone = 0.0 if self.network is None else median_seconds(lambda: self.reconstruct(given), self.device, repeats)
        return whole, alone


def network_of(name: str, path: Path, device: str, precision: str) -> Reconstruction:
    """A network from a weights file.  precision: a key of PRECISIONS.  Raises WeightsError."""
    network, header = load_weights(path)
    dtype = PRECISIONS[precision]
    placed: nn.Module = network.to(device, dtype, memory_format=torch.channels_last)  # type: ignore[call-overload]
    takes = torch.float32 if isinstance(network, CompactUNet) else dtype

    @torch.inference_mode()
    def run(given: Tensor) -> Tensor:
        return placed(given[None].to(takes, memory_format=torch.channels_last))[0, :3].float().clamp(0, 1)

    return Reconstruction(name, run, device, filtered=header.get("input") != "unfiltered")


def own_reconstruction(network: OwnNetwork) -> Reconstruction:
    """A network of your own."""
    return Reconstruction(network.name, network, network.device)


@dataclass(frozen=True)
class OwnFunction:
    """A function of your own."""

    made_by: OwnPicture

    @property
    def name(self) -> str:
        """In tables."""
        return self.made_by.name

    def picture(self, shown: Shown) -> Tensor:
        """(3, H, W) in 0..1."""
        return self.made_by.picture(shown.scan, shown.seen)

    def seconds(self, shown: Shown, repeats: int) -> tuple[float, float]:
        """Of the function, which gets the points in view."""
        return median_seconds(lambda: self.picture(shown), "cpu", repeats), 0.0


@dataclass(frozen=True)
class OutsidePictures:
    """Pictures in a folder: ``PLACE/960x720/D10/VIEW.png``, where each of the folders may be left out.  A place of ScanNet++ is
    its scene, or scene/camera.

    A picture has the size of the table, or that of the true picture; the latter is cropped and resampled like it.
    """

    name: str
    folder: Path

    def file(self, place: str, view: TruePicture, size: tuple[int, int], density: float) -> Path:
        """Path of a picture."""
        folder = self.folder
        for inner in (*place.split("/"), f"{size[0]}x{size[1]}", density_folder(density)):
            folder = folder / inner if (folder / inner).is_dir() else folder
        return folder / f"{view.name}.png"

    def problem(self, place: str, view: TruePicture, size: tuple[int, int], density: float) -> str | None:
        """Why a picture cannot be used; None where it can."""
        path = self.file(place, view, size, density)
        if not path.is_file():
            return f"{path} is missing"
        try:
            with Image.open(path) as image:
                if image.size not in (size, (view.width, view.height)):
                    return f"{path} is {image.width}x{image.height}, not {size[0]}x{size[1]} or {view.width}x{view.height}"
                image.load()
        except (UnidentifiedImageError, OSError, SyntaxError, ValueError, Image.DecompressionBombError):
            return f"{path} cannot be read as a picture"
        return None

    def picture(self, shown: Shown) -> Tensor:
        """(3, H, W) in 0..1."""
        size = shown.seen.camera.width, shown.seen.camera.height
        with Image.open(self.file(shown.place, shown.view, size, shown.density)) as image:
            colour = np.array(image.convert("RGB"))
        if colour.shape[:2] != size[::-1]:
            colour = scaled_colour(colour, *size)
        return torch.from_numpy(colour).permute(2, 0, 1) / 255

    def seconds(self, shown: Shown, repeats: int) -> None:
        """Unknown."""
        return None


def median_seconds(work: Callable[[], Tensor], device: str, repeats: int) -> float:
    """Median of ``repeats`` runs after one that warms up."""
    taken = []
    for number in range(repeats + 1):
        begun = perf_counter()
        work()
        if device.startswith("cuda"):
            torch.cuda.synchronize()
        if number:
            taken.append(perf_counter() - begun)
    return float(np.median(taken))


def scaled(view: TruePicture, width: int, height: int) -> MemoryPicture:
    """The view, cropped around its centre to the aspect ratio and resampled to the size in pixels, with adapted intrinsics.

    A pixel is known if all source pixels are known.
    """
    known = view.known()
    if known is not None:
        box = _box(view.width, view.height, width, height)
        share = Image.fromarray(known.astype(np.float32)).resize((width, height), Image.Resampling.BILINEAR, box=box)
        known = np.asarray(share) > 0.999
    lens = scaled_camera(view, width, height)
    colour = scaled_colour(view.rgb(), width, height)
    return MemoryPicture(colour, lens.fx, view.camera_to_world, usable=known, centre=(lens.cx, lens.cy), name=view.name)


def scaled_colour(colour: np.ndarray, width: int, height: int) -> np.ndarray:
    """(height, width, 3) uint8: a picture (H, W, 3) uint8, cropped around its centre and resampled."""
    box = _box(colour.shape[1], colour.shape[0], width, height)
    return np.array(Image.fromarray(colour).resize((width, height), Image.Resampling.LANCZOS, box=box))


def scaled_camera(view: TruePicture, width: int, height: int) -> SimpleNamespace:
    """The camera of :func:`scaled`, without the picture."""
    scale = _scale(view.width, view.height, width, height)
    left, top, *_ = _box(view.width, view.height, width, height)
    cx, cy, fl = (view.cx - left) * scale, (view.cy - top) * scale, view.fl * scale
    return SimpleNamespace(width=width, height=height, fx=fl, fy=fl, cx=cx, cy=cy, camera_to_world=view.camera_to_world)


def _scale(full_width: int, full_height: int, width: int, height: int) -> float:
    return max(width / full_width, height / full_height)


def _box(full_width: int, full_height: int, width: int, height: int) -> tuple[float, float, float, float]:
    """Left, top, right, bottom of the largest part of a picture with the aspect ratio of ``width`` and ``height``, centred."""
    scale = _scale(full_width, full_height, width, height)
    left, top = (full_width - width / scale) / 2, (full_height - height / scale) / 2
    return left, top, left + width / scale, top + height / scale


def check_outside(folders: list[OutsidePictures], wanted: list[tuple[str, TruePicture]], sizes, densities) -> None:
    """Raises DataError naming the first pictures that are missing or cannot be used."""
    for outside in folders:
        if not outside.folder.is_dir():
            raise DataError("no such folder", option="--outside", value=f"{outside.name}={outside.folder}")
    problems = {
        problem for outside in folders for place, view in wanted for size in sizes for density in densities
        if (problem := outside.problem(place, view, size, density)) is not None
    }
    if problems:
        first = sorted(problems)
        more = f" and {len(first) - 10} more" if len(first) > 10 else ""
        raise DataError(f"{len(first)} pictures of outside methods cannot be used: {'; '.join(first[:10])}{more}")
