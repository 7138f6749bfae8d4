"""The same frame twice is the same bytes: by another renderer, context and rasteriser, and as it was when last approved."""

import json

import hashes
import point_claims
import pytest
from hashes import FILE, hashes_of

from pointglass.viewer.picture.settings import Settings
from pointglass.viewer.render.device.context import create_context, describe_device

pytestmark = pytest.mark.gl


def test_the_same_frame_again_is_byte_identical(renderers, seed, claims):
    other = create_context()
    renderers.context.__enter__()
    try:
        claims(point_claims.repeats(renderers, other, seed, (96, 72)))
    finally:
        other.__enter__()
        other.release()
        renderers.context.__enter__()


def test_the_reference_pictures_are_as_they_were(renderers):
    known = json.loads(FILE.read_text())
    name = describe_device(renderers.context).renderer
    if name not in known:
        pytest.skip(f"no hashes for {name!r}; listed are {', '.join(known)}")
    made = hashes_of(renderers)
    changed = [key for key in made if made[key] != known[name].get(key)]
    assert made.keys() == known[name].keys() and not changed, (
        f"{len(changed)} of {len(made)} reference pictures changed, the first is {changed[:1]}; where that is meant, renew "
        "them with `python tests/stability/hashes.py`")


def test_a_changed_picture_changes_its_hash(renderers, monkeypatch):
    monkeypatch.setattr(hashes, "PLACES", hashes.PLACES[:1])
    both = []
    for settings in (Settings(), Settings(filter="off")):
        monkeypatch.setattr(hashes, "SETTINGS", {"the same name": settings})
        monkeypatch.setattr(hashes, "WEIGHTED", {"weighted": settings})
        both.append(hashes_of(renderers))
    first, second = both
    assert first.keys() == second.keys() and not set(first.values()) & set(second.values())
