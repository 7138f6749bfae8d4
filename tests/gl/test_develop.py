"""Development passes against their NumPy references, on random pictures of odd sizes."""

from types import SimpleNamespace

import numpy as np
import pytest

from pointglass.viewer.picture.look import EDL_GAIN, Look, enlarged, eye_dome, tone_curves, toned
from pointglass.viewer.picture.provenance import provenance
from pointglass.viewer.picture.provenance_tint import COLOURS, FULLY_REPAINTED, locked, repainted_by, shares, tinted
from pointglass.viewer.render.device.shader import Programs
from pointglass.viewer.render.passes.develop import Developer, needs


def picture(random, height: int, width: int, holes: float = 0.4) -> np.ndarray:
    alpha = np.where(random.random((height, width, 1)) < holes, 0, 255)
    alpha = np.where(random.random((height, width, 1)) < 0.1, random.integers(0, 256, (height, width, 1)), alpha)
    return np.concatenate([random.integers(0, 256, (height, width, 3)) * alpha // 255, alpha], axis=-1).astype(np.uint8)


@pytest.fixture
def bench(context, seed):
    """A random frame as the renderer returns it, its arrays, and a Developer of its size."""
    random = np.random.default_rng(seed)
    width, height = (int(n) for n in random.integers(20, 90, 2))
    raw = picture(random, height, width)
    depth = np.where(raw[..., 3] > 0, random.uniform(1, 9, (height, width)), np.inf).astype(np.float32)
    mask = (raw[..., 3] > 0) & (random.random((height, width)) < 0.7)
    images = {"raw": raw, "filtered": raw * mask[..., None], "filled": picture(random, height, width, 0.1),
              "neural": picture(random, height, width, 0.1)}  # fmt: skip
    near = np.clip(raw.astype(int) + random.integers(-20, 21, raw.shape), 0, 255).astype(np.uint8)  # mostly nearly as measured
    images["neural"] = np.where(mask[..., None], near, images["neural"])
    size = (width, height)
    textures = {view: context.texture(size, 4, image.tobytes(), alignment=1) for view, image in images.items()}
    depths = context.texture(size, 1, depth.tobytes(), alignment=1, dtype="f4")
    masks = context.texture(size, 1, (mask * np.uint8(255)).tobytes(), alignment=1)
    frame = SimpleNamespace(textures=textures, depth_texture=depths, mask_texture=masks, photo_shares={}, ratio_depth=None)
    programs = Programs(context)
    developer = Developer(programs, size)
    yield SimpleNamespace(frame=frame, images=images, depth=depth, mask=mask, developer=developer, random=random)
    for owned in (developer, programs, depths, masks, *textures.values()):
        owned.release()


def read(texture) -> np.ndarray:
    return np.frombuffer(texture.read(alignment=1), np.uint8).reshape(texture.height, texture.width, 4)


def test_tones_are_those_of_the_reference_to_the_byte(bench):
    look = Look(exposure=float(bench.random.uniform(-2, 2)), brightness=0.3, temperature=-0.5, tint=0.8)
    for view in bench.images:
        assert (read(bench.developer.run(bench.frame, view, look)) == toned(bench.images[view], tone_curves(look))).all()


@pytest.mark.parametrize("size", [2, 3, 7])
def test_points_are_enlarged_as_in_the_reference(bench, size):
    front = {"raw": bench.depth, "filtered": np.where(bench.mask, bench.depth, np.inf).astype(np.float32)}
    for view, depth in front.items():
        out = read(bench.developer.run(bench.frame, view, Look(point_size=size)))
        assert (out == enlarged(bench.images[view], depth, size)[0]).all()


def test_eye_dome_lighting_is_that_of_the_reference(bench):
    strength = float(bench.random.uniform(0.001, 0.05))
    for view, depth in (("raw", bench.depth), ("filtered", np.where(bench.mask, bench.depth, np.inf).astype(np.float32))):
        out = read(bench.developer.run(bench.frame, view, Look(edl=strength)))
        wanted = bench.images[view].astype(float)
        wanted[..., :3] *= eye_dome(depth, strength)[..., None]
        assert np.abs(out - wanted).max() <= 1.0
    assert EDL_GAIN > 0


def test_filled_and_neural_views_show_no_points(bench):
    for view in ("filled", "neural"):
        assert not needs(Look(point_size=5, edl=0.5), view, tint=False, lock=False)
        assert (read(bench.developer.run(bench.frame, view, Look(point_size=5, edl=0.5))) == bench.images[view]).all()


def test_the_tint_is_that_of_the_reference_to_the_byte(bench):
    for view, image in bench.images.items():
        out = read(bench.developer.run(bench.frame, view, Look(), tint=True))
        assert (out == tinted(view, image, bench.mask, bench.images["filtered"])).all(), view


def test_the_tint_of_photographs_is_that_of_the_reference_to_the_byte(bench, context):
    share = bench.random.integers(0, 256, bench.mask.shape, dtype=np.uint8)
    texture = context.texture(share.shape[::-1], 1, share.tobytes(), alignment=1)
    bench.frame.photo_shares = {"filled": texture, "neural": texture}
    for view, image in bench.images.items():
        out = read(bench.developer.run(bench.frame, view, Look(), tint=True))
        assert (out == tinted(view, image, bench.mask, bench.images["filtered"], share > 127)).all(), view
    shown = locked(bench.images["neural"], bench.images["filtered"], bench.mask)
    out = read(bench.developer.run(bench.frame, "neural", Look(), tint=True, lock=True))
    assert (out == tinted("neural", shown, bench.mask, bench.images["filtered"], (share > 127) & ~bench.mask)).all()
    texture.release()


def test_the_lock_shows_measured_pixels_as_measured(bench):
    out = read(bench.developer.run(bench.frame, "neural", Look(), lock=True))
    assert (out[bench.mask] == bench.images["filtered"][bench.mask]).all()
    assert (out[~bench.mask] == bench.images["neural"][~bench.mask]).all()
    assert (out == locked(bench.images["neural"], bench.images["filtered"], bench.mask)).all()


def test_shares_are_counted_pixels(bench):
    for view, image in bench.images.items():
        found = provenance(view, image, bench.mask)
        told = shares(view, image, bench.mask, bench.images["filtered"])
        assert sum(told.percent.values()) == pytest.approx(100.0)
        for key, percent in told.percent.items():
            assert percent == pytest.approx(100.0 * np.mean(found == key))
    change = repainted_by(bench.images["neural"], bench.images["filtered"])[provenance("neural", bench.images["neural"],
                                                                                        bench.mask) == 2]  # fmt: skip
    assert told.change == pytest.approx(change.mean())


def test_the_tint_of_a_repainted_pixel_tells_how_much():
    grey = np.full((1, 3, 4), 128, np.uint8)
    neural = grey.copy()
    neural[0, 1, :3] += FULLY_REPAINTED // 2
    neural[0, 2, :3] += FULLY_REPAINTED
    out = tinted("neural", neural, np.ones((1, 3), bool), grey).astype(int)
    toward = np.array(COLOURS[2]) - COLOURS[1]
    along = out[0, :, :3] @ toward
    assert along[0] < along[1] < along[2]
