"""What a person reads holds nothing that a terminal obeys, whichever way it gets there."""

import io
import json
import logging
import sys

import pytest

from pointglass.viewer import cli
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.text import escaped_output, printable

EVIL = "\x1b]0;owned\x07\x1b[2J\u202egnp\x9b31m\r\n\x00\udcff"


def test_control_sequences_are_shown_and_lines_joined():
    assert printable(EVIL).isprintable() and "\\x1b]0;owned\\x07" in printable(EVIL) and "\\u202e" in printable(EVIL)
    assert printable("a\n b\tc") == "a b c" and printable("a\n b\tc", lines=True) == "a\n b\tc"
    assert printable("Grüße, 東京") == "Grüße, 東京" and printable(3) == "3"


def test_all_that_is_printed_is_escaped_and_a_bar_may_go_back(monkeypatch):
    out, error = io.StringIO(), io.StringIO()
    monkeypatch.setattr(sys, "stdout", out)
    monkeypatch.setattr(sys, "stderr", error)
    with escaped_output():
        print(EVIL, "\u202e")
        sys.stderr.writelines([EVIL, "\n"])
        sys.stderr.write("\rbar 50 % \x1b[31m")
        sys.stderr.write("\x1b[A")
    assert sys.stdout is out and sys.stderr is error
    assert not set(out.getvalue()) & set("\x1b\x07\r\x00\u202e\x9b\udcff") and out.getvalue().endswith("\n")
    assert error.getvalue().endswith("\n\rbar 50 % \\x1b[31m\x1b[A") and error.getvalue().count("\x1b") == 1


def test_errors_and_the_log_are_escaped(tmp_path, capsys, monkeypatch):
    assert str(InputError(f"{EVIL}: damaged")).isprintable()

    def run(_options):
        logging.getLogger("pointglass.x").warning("%s is odd", EVIL)
        print(json.dumps(EVIL), EVIL)
        raise InputError(f"{EVIL}: damaged")

    monkeypatch.setitem(cli._RUN, "doctor", run)
    log = tmp_path / "log.txt"
    assert cli.main(["doctor", "--log-file", str(log)]) == 2
    told = capsys.readouterr()
    assert told.err.count("\n") == 2
    for text in (told.out, told.err, log.read_text("utf-8")):
        assert all(c.isprintable() or c in "\n\t" for c in text) and "\\x1b" in text


@pytest.mark.parametrize("argument", ["--like", "--cameras"])
def test_arguments_with_escape_sequences(argument, capsys):
    assert cli.main(["render", "x.laz", argument, f"{EVIL}.png".replace("\0", ""), "--out", "out"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and error[:-1].isprintable()
