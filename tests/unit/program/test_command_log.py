"""What a command logs: warnings to standard error, more with --verbose, everything to --log-file."""

import logging

import pytest

from pointglass.viewer import cli
from pointglass.viewer.cli import main
from pointglass.viewer.common.errors import InputError

LEVELS = {"fallback taken": logging.WARNING, "engine chosen": logging.INFO, "cell counted": logging.DEBUG}


@pytest.fixture
def talkative(monkeypatch):
    """A command that logs one message of each level from a module of ours, and one from a library."""

    def work(options):
        for message, level in LEVELS.items():
            logging.getLogger("pointglass.viewer.render.somewhere").log(level, message)
        logging.getLogger("PIL").info("library talk")
        if options.json:
            raise InputError("house.e57: is damaged; export it again")
        return 0

    monkeypatch.setitem(cli._RUN, "doctor", work)


@pytest.mark.parametrize(("options", "shown"), [
    ([], {"fallback taken"}), (["--verbose"], {"fallback taken", "engine chosen"}),
])  # fmt: skip
def test_standard_error_shows_warnings_and_with_verbose_what_was_chosen(talkative, capsys, options, shown):
    assert main(["doctor", *options]) == 0
    lines = capsys.readouterr().err.splitlines()
    assert {message for message in LEVELS if any(line.endswith(message) for line in lines)} == shown
    assert len(lines) == len(shown) and all(line.startswith("pointglass: ") for line in lines)


def test_the_log_file_has_everything_and_is_appended_to(talkative, tmp_path, capsys):
    log = tmp_path / "run.log"
    assert main(["doctor", "--log-file", str(log)]) == 0
    assert main(["doctor", "--json", "--log-file", str(log)]) == 2
    text = log.read_text("utf-8")
    assert [text.count(message) for message in LEVELS] == [2, 2, 2] and "library talk" not in text
    assert "Traceback" in text and "house.e57: is damaged" in text
    assert "Traceback" not in capsys.readouterr().err


def test_a_command_leaves_no_handler_behind(talkative, tmp_path):
    before = [(logging.getLogger(name).level, len(logging.getLogger(name).handlers)) for name in ("pointglass",)]
    main(["doctor", "--verbose", "--log-file", str(tmp_path / "run.log")])
    assert before == [(logging.getLogger(name).level, len(logging.getLogger(name).handlers)) for name in ("pointglass",)]


def test_a_log_that_cannot_be_written_is_refused_in_one_line(talkative, tmp_path, capsys):
    assert main(["doctor", "--log-file", str(tmp_path / "missing" / "run.log")]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "run.log" in said and "--log-file" in said
