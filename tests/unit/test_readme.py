"""The README's figures come from bench files, and from nothing else."""

import json

from viewer.bench.readme import filled, main

BENCH = {
    "machine": {"cores": 2, "processor": "X", "versions": {"torch": "9"}}, "opengl": "soft",
    "views": {v: {"total": {"p50": 1.4, "p95": 2.6}} for v in ("raw", "filtered", "filled", "neural")},
}


def test_a_block_is_replaced_and_the_rest_kept():
    text = "before\n<!-- frames -->\nold\n<!-- /frames -->\nafter <!-- truth -->\nkept\n<!-- /truth -->\n"
    made = filled(text, {"frame-plant_room": BENCH})
    assert "old" not in made and "1 / 3" in made and "kept" in made
    assert made.startswith("before\n<!-- frames -->\n") and made.endswith("<!-- /truth -->\n")
    assert filled(made, {"frame-plant_room": BENCH}) == made
    assert filled(text, {}) == text


def test_documents_are_renewed_and_missing_benches_named(tmp_path, capsys):
    document = tmp_path / "README.md"
    document.write_text("<!-- frames -->\n<!-- /frames -->\n")
    (tmp_path / "frame-plant_room.json").write_text(json.dumps(BENCH))
    assert main(tmp_path, [document]) == 0
    assert "balanced | 1 / 3" in document.read_text()
    assert "not there: ablation, evaluate" in capsys.readouterr().out
