"""A small scene in pages of a few chunks, and what to hold the pages against: shared by the tests of pages."""

from dataclasses import replace

import numpy as np
from clouds import room

from pointglass.viewer.render.device.shader import BATCH
from pointglass.viewer.render.raster.points import PointPages

POINTS = 512  # a chunk, here
CHUNK_BYTES = POINTS * 12
LIMIT = 9 * CHUNK_BYTES + BATCH * 12 + 100  # of a storage block: nine slots a page
SCENE = room(3, 60_000)
CHUNKS = -(-SCENE.count // POINTS)


def pages_of(context, scene=SCENE, slots: float = 40.5, **options) -> PointPages:
    return PointPages(
        context, scene, LIMIT, budget=int(slots * CHUNK_BYTES), chunk_points=POINTS,
        **{"read_ahead": 5 * CHUNK_BYTES, **options},
    )  # fmt: skip


def on_disk(folder):
    np.save(folder / "points.npy", SCENE.points)
    return replace(SCENE, points=np.load(folder / "points.npy", mmap_mode="r"))


def draw_list(rng, share: float) -> tuple[np.ndarray, np.ndarray]:
    """Runs as culling makes them: ascending, apart, of any length; about ``share`` of all points."""
    edges = np.unique(rng.integers(0, SCENE.count + 1, 400))
    chosen = np.flatnonzero(rng.random(len(edges) - 1) < share)
    return edges[chosen], np.diff(edges)[chosen]


def plain_batches(first, count, pages: PointPages, start: int, stop: int) -> list[tuple[int, int, int, int]]:
    """(page, index in it, points, number of the first) of each batch of a draw list between two points of the scene.

    A run is cut at multiples of chunk_points, then from each cut on into batches; chunks without a slot are left out.
    """
    out = []
    for a, n in zip(first.tolist(), count.tolist(), strict=True):
        at, end = max(a, start), min(a + n, stop)
        while at < end:
            chunk = at // pages.chunk_points
            edge = min(end, (chunk + 1) * pages.chunk_points)
            slot = int(pages.slot_of_chunk[chunk])
            while at < edge:
                size = min(BATCH, edge - at)
                if slot >= 0:
                    index = slot % pages.slots_per_page * pages.chunk_points + at % pages.chunk_points
                    out.append((slot // pages.slots_per_page, index, size, at))
                at += size
    return out


def drawn(pages: PointPages, batches) -> np.ndarray:
    """How often each point was drawn, having made sure that the buffers hold these points."""
    times = np.zeros(SCENE.count, int)
    buffers = [np.frombuffer(buffer.read(), np.uint32).reshape(-1, 3) for buffer in pages.buffers]
    for page, index, size, at in batches:
        assert np.array_equal(buffers[page][index : index + size], SCENE.points[at : at + size])
        times[at : at + size] += 1
    return times


def expected(first, count) -> np.ndarray:
    times = np.zeros(SCENE.count, int)
    for a, n in zip(first, count, strict=True):
        times[a : a + n] += 1
    return times


def within_budget(pages: PointPages, slots: float = 40.5) -> bool:
    held = (pages.slot_of_chunk >= 0).sum()
    return pages.nbytes <= slots * CHUNK_BYTES and pages.staging <= 5 * CHUNK_BYTES and held * CHUNK_BYTES <= pages.nbytes
