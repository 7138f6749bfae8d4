"""Golden pictures of the demo: what a change of any room does to what a person sees.

Where one differs, out/golden has what was made, what was expected, and the difference eight times as strong.  ``make golden``
renews the pictures where the change is meant.
"""

import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from pointglass.viewer.picture.views import VIEWS
from pointglass.viewer.render.device.context import describe_device

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
sys.path.insert(0, str(GOLDEN))

from demo_pictures import ROOT, SIZE, difference, render  # noqa: E402

DIFFERING = 0.001
"""Share of the pixels without a network that may differ by more than a level: processors contract multiplications differently,
and a point then falls into the next pixel."""
NEURAL_MEAN, NEURAL_FAR = 0.25, 0.002
"""Mean difference of the neural view, levels, and the share of its pixels that differ by more than 4: sums of a network in
another order."""


@pytest.fixture(scope="module")
def made(context):
    if not describe_device(context).software:
        pytest.skip("the golden pictures are those of software OpenGL")
    return render(context)


def test_there_are_golden_pictures_of_every_camera(made):
    assert sorted(made) == sorted(file.name for file in GOLDEN.glob("demo-*.png"))


def problems(picture: np.ndarray, golden: np.ndarray) -> list[str]:
    """A line for each view that differs."""
    found = []
    for number, view in enumerate(VIEWS):
        side = slice(number * SIZE[0], (number + 1) * SIZE[0])
        apart = np.abs(picture[:, side].astype(int) - golden[:, side]).max(axis=-1)
        good = (apart.mean() <= NEURAL_MEAN and (apart > 4).mean() <= NEURAL_FAR if view == "neural"
                else (apart > 1).mean() <= DIFFERING)
        if not good:
            found.append(f"{view}: {(apart > 1).mean():.2%} of the pixels differ, at most by {apart.max()}")
    return found


@pytest.mark.parametrize("name", sorted(file.name for file in GOLDEN.glob("demo-*.png")))
def test_a_picture_equals_its_golden_one(made, name):
    golden = np.asarray(Image.open(GOLDEN / name))
    picture = made[name]
    assert picture.shape == golden.shape == (SIZE[1], SIZE[0] * len(VIEWS), 4)
    wrong = problems(picture, golden)
    if wrong:
        out = ROOT / "out" / "golden" / name
        out.parent.mkdir(parents=True, exist_ok=True)
        Image.fromarray(difference(picture, golden)).save(out)
    assert wrong == [], f"look at {ROOT / 'out' / 'golden' / name}; where the change is meant: make golden"


def test_a_picture_moved_by_a_pixel_or_one_level_brighter_in_the_network_is_noticed(made):
    golden = next(iter(made.values()))
    assert problems(golden, golden) == []
    assert len(problems(np.roll(golden, 1, axis=0), golden)) == len(VIEWS)
    brighter = golden.copy()
    neural = brighter[:, -SIZE[0] :, :3]
    neural[:] = np.minimum(neural.astype(int) + 1, 255)
    assert [line.partition(":")[0] for line in problems(brighter, golden)] == ["neural"]
