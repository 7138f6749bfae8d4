"""Options that cannot be followed are refused at once: one line, exit code 2, and nothing made."""

import pytest

from viewer.cli import main


def refused(capsys, *arguments) -> str:
    """The one line that a command line is refused with."""
    assert main([str(a) for a in arguments]) == 2
    said = capsys.readouterr()
    assert said.err.startswith("pointglass: ") and said.err.count("\n") == 1 and not said.out, said
    return said.err


@pytest.mark.parametrize(("options", "said"), [
    (("--procedural", "-3"), "--procedural -3: expected at least 0"),
    (("--seed", "-1"), "--seed -1: expected at least 0"),
    (("--seed", "4294967296"), "--seed 4294967296: expected at most"),
    (("--batch", "0"), "--batch 0: expected at least 1"),
    (("--steps", "0"), "--steps 0: expected at least 1"),
    (("--crop", "7"), "--crop 7: expected at least 32"),
    (("--crop", "300"), "--crop 300: thing 1 has pictures of 640x480"),
    (("--rate", "nan"), "--rate nan"),
    (("--rate", "0"), "--rate 0"),
    (("--minutes", "nan"), "--minutes nan"),
    (("--minutes", "-1"), "--minutes -1"),
    (("--start-from", "/nope"), "--start-from /nope: no such weights"),
    (("--perceptual", "/nope"), "--perceptual /nope: holds no sqz_notop.mat"),
    (("--device", "cuda"), "--device cuda: "),
])
def test_training_refuses_options_before_a_place_is_built(options, said, tmp_path, capsys, monkeypatch):
    import model.data.procedural as procedural
    import model.reconstruct as reconstruct

    monkeypatch.setattr(procedural.ProceduralPlace, "views", property(lambda self: pytest.fail("a place was built")))
    monkeypatch.setattr(reconstruct, "cuda_problem", lambda: "none here")
    assert said in refused(capsys, "train", "--procedural", "1", "--out", tmp_path / "out", *options)
    assert not (tmp_path / "out").exists()


def test_an_empty_list_of_pairs_does_not_stop_a_later_training(tmp_path, capsys, monkeypatch):
    """As earlier versions left it after `--procedural -3`."""
    import model.data.procedural as procedural

    class Built(Exception):
        pass

    def build(_place):
        raise Built

    monkeypatch.setattr(procedural.ProceduralPlace, "views", property(build))
    (tmp_path / "pairs-filtered.txt").write_text("\n")
    with pytest.raises(Built):
        main(["train", "--procedural", "1", "--out", str(tmp_path)])
