"""Files written whole or not at all, links and devices included."""

import os
import threading

import pytest

from model.whole import write_whole


def test_an_older_file_stays_until_the_new_one_is_whole(tmp_path):
    path = tmp_path / "a.json"
    path.write_text("old")

    def fails(beside):
        beside.write_text("ha")
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_whole(path, fails)
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]
    write_whole(path, lambda beside: beside.write_text("new"))
    assert path.read_text() == "new" and list(tmp_path.iterdir()) == [path]


def test_a_link_stays_one_and_what_it_leads_to_is_written(tmp_path):
    (tmp_path / "results").mkdir()
    real, link = tmp_path / "results" / "real.json", tmp_path / "link.json"
    link.symlink_to(real)
    for text in ("first", "second"):  # at first it leads nowhere
        write_whole(link, lambda beside, text=text: beside.write_text(text))
        assert link.is_symlink() and real.read_text() == text
    assert [path.name for path in real.parent.iterdir()] == ["real.json"]


def test_a_pipe_is_written_to_and_stays_one(tmp_path):
    pipe, heard = tmp_path / "pipe", []
    os.mkfifo(pipe)
    listener = threading.Thread(target=lambda: heard.append(pipe.read_text()), daemon=True)
    listener.start()
    write_whole(pipe, lambda beside: beside.write_text("figures"))
    listener.join(10.0)
    assert heard == ["figures"] and pipe.is_fifo() and list(tmp_path.iterdir()) == [pipe]
