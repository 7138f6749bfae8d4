"""A photograph blended over a view: how much of it is seen, and how far both agree.  Pictures are (H, W, 4) uint8."""

import numpy as np

FADE = 2.0
"""Metres from its place over which a photograph fades out.  Measured on 59 views of five rendered rooms, with the photographs
of a station: up to 3 m from it they show 85 to 94 % of a view and agree with it within 21 to 26 dB PSNR (means of five ranges
of distance), from 3 to 4 m they show 70 % and 15 dB.  Twice the distance would show those; half would fade out what agrees as
well as nearer views."""


def strength(distance: float, metres_per_unit: float | None, blend: float) -> float:
    """How much of the photograph is seen, 0 to 1: ``blend`` at its own place, 0 from FADE metres on.  distance: file units."""
    return blend * max(0.0, 1.0 - distance * (metres_per_unit or 1.0) / FADE)


def blended(view: np.ndarray, photo: np.ndarray, share: float, split: int | None = None) -> np.ndarray:
    """A picture, premultiplied, with a photograph of viewer.render.photographs.lone_photograph over it.

    share: of the photograph, 0 to 1.  split: the photograph is shown left of this column only; None: everywhere.
    """
    weight = photo[..., 3:] * np.float32(share / 255)
    if split is not None:
        weight[:, split:] = 0
    over = photo.astype(np.float32)
    over[..., 3] = 255
    return np.rint(view.astype(np.float32) * (1 - weight) + over * weight).astype(np.uint8)


def agreement(view: np.ndarray, photo: np.ndarray) -> float | None:
    """PSNR in dB between a picture and a photograph, at pixels that both show in full; None where there are none.  +inf where
    they are equal."""
    both = (view[..., 3] == 255) & (photo[..., 3] == 255)
    if not both.any():
        return None
    error = np.mean((view[both][:, :3].astype(np.float64) - photo[both][:, :3]) ** 2)
    return float("inf") if error == 0 else float(10 * np.log10(255.0**2 / error))
