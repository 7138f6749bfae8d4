"""What is typed is what is done: every option reaches what it is for, and every outcome the exit code."""

import errno
from pathlib import Path
from typing import Any

import pytest

from pointglass.model.evaluation.metrics.perceptual import SQUEEZE_FILES
from pointglass.viewer import cli
from pointglass.viewer.cli import main
from pointglass.viewer.command_table import make_parser
from pointglass.viewer.commands.options import memory_of, settings_of
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.picture.settings import CHOICES, Memory, Settings

RENDER = ("render", "scan.laz", "--cameras", "c.json", "--out", "out")


def typed(*words):
    return make_parser().parse_args([*RENDER, *words])


@pytest.mark.parametrize("name, value", [(name, value) for name, table in CHOICES.items() for value in table])
def test_every_choice_reaches_the_settings_and_nothing_else_changes(name, value):
    assert settings_of(typed(f"--{name.replace('_', '-')}", value)) == Settings(**{name: value})


@pytest.mark.parametrize("option, text, value", [
    ("filter-strength", "0.5", 0.5), ("filter-strength", "1000", 1000), ("filter-levels", "1", 1), ("filter-levels", "12", 12),
    ("lod", "0.25", 0.25), ("weights", "mine.safetensors", "mine.safetensors"),
])
def test_every_number_and_file_reaches_the_settings(option, text, value):
    assert settings_of(typed(f"--{option}", text)) == Settings(**{option.replace("-", "_"): value})


def test_nothing_typed_is_what_the_settings_are_without():
    assert settings_of(typed()) == Settings() and memory_of(typed()) == Memory()


@pytest.mark.parametrize("option, text, said", [
    ("filter-levels", "0", "filter levels 0"), ("filter-levels", "13", "filter levels 13"), ("lod", "0", "level of detail 0"),
    ("filter-strength", "1000.5", "filter strength 1000.5"), ("filter-strength", "nan", "filter strength nan"),
    ("lod", "nan", "level of detail nan"),
])
def test_values_beyond_the_limits_are_refused(option, text, said):
    with pytest.raises(InputError, match=said):
        settings_of(typed(f"--{option}", text))


@pytest.mark.parametrize("words, name", [
    (("--size", ""), "--size"), (("--shard=",), "--shard"), (("--out", ""), "--out"), (("",), "an argument"),
])
def test_what_an_unset_variable_leaves_is_refused(words, name):
    with pytest.raises(InputError, match=f"^{name} is empty; "):
        typed(*words)


def test_every_option_tells_its_default():
    commands: Any = next(action for action in make_parser()._actions if action.dest == "command")
    untold = [f"{name} {action.option_strings[0]}" for name, command in commands.choices.items() for action in command._actions
              if action.option_strings and action.default not in (None, False, [], "==SUPPRESS==")
              and "default" not in (action.help or "")]  # fmt: skip
    assert not untold


def test_each_kind_of_memory_is_given_its_own_size():
    assert memory_of(typed("--gpu-memory", "2G")) == Memory(gpu=2 << 30)
    assert memory_of(typed("--read-ahead", "3M")) == Memory(read_ahead=3 << 20)
    assert memory_of(typed("--gpu-memory", "1G", "--read-ahead", "5M")) == Memory(1 << 30, 5 << 20)


def test_tuning_is_told_what_was_asked_for(monkeypatch, tmp_path):
    for name in SQUEEZE_FILES:
        (tmp_path / name).write_bytes(b"some")
    told = []
    monkeypatch.setattr("pointglass.viewer.commands.tuning.tune.tune",
                        lambda scan, out, **given: told.append((scan, out, given)))
    line = ("train", "--tune", "house.e57", "--quality", "fast", "--device", "cpu")
    assert main([*line, "--out", "mine", "--minutes", "2.5", "--seed", "7", "--perceptual", str(tmp_path)]) == 0
    assert main(list(line)) == 0
    given = {"quality": "fast", "minutes": 2.5, "perceptual": tmp_path, "seed": 7, "device": "cpu"}
    assert told[0] == (Path("house.e57"), Path("mine"), given)
    assert told[1] == (Path("house.e57"), None, given | {"minutes": 10.0, "perceptual": None, "seed": 1})


@pytest.mark.parametrize("code", [0, 3])
def test_the_doctors_finding_is_the_exit_code(monkeypatch, capsys, code):
    monkeypatch.setattr("pointglass.viewer.doctor.examine", dict)
    monkeypatch.setattr("pointglass.viewer.doctor.exit_code", lambda found: code)
    assert main(["doctor", "--json"]) == code
    assert capsys.readouterr().out == "{}\n"


def test_what_the_system_refuses_is_one_line_and_exit_2(monkeypatch, capsys):
    def full(_):
        raise OSError(errno.ENOSPC, "No space left on device", "out/a.png")

    monkeypatch.setitem(cli._RUN, "info", full)
    assert main(["info", "any.laz"]) == 2
    assert capsys.readouterr().err == "pointglass: out/a.png: No space left on device\n"
