"""Scans at addresses: read by ranges, whole and in part, with faults of the network; errors in one line without secrets."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from cloud_files import write_las
from range_server import served

from pointglass.viewer.cli import main
from pointglass.viewer.common.errors import InputError
from pointglass.viewer.common.progress import Progress
from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.readers.remote import remote_object
from pointglass.viewer.readers.remote.address import address_in
from pointglass.viewer.readers.remote.fetch import fetched, local_path
from pointglass.viewer.readers.remote.local_copy import LocalCopy
from pointglass.viewer.readers.remote.remote_object import RemoteObject
from pointglass.viewer.work.document import Document, ScanFile
from pointglass.viewer.work.project import read_project, write_project

SECRET = "X-Amz-Signature=1f2e3d&X-Amz-Expires=60"


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))


def scan(folder, points: int = 20_000, name: str = "a.laz") -> bytes:
    random = np.random.default_rng(points)
    xyz = random.uniform(0, 10, (points, 3)) * (1, 1, 0.1) + (4e5, 5e6, 100)
    write_las(folder / name, xyz, random.integers(0, 65536, (points, 3)))
    return (folder / name).read_bytes()


def test_a_scan_at_an_address_is_the_scan(tmp_path, capsys):
    data = scan(tmp_path)
    here = open_scene(tmp_path / "a.laz")
    with served({"room one/a.laz": data}) as server:
        address = f"{server.address}/room%20one/a.laz?{SECRET}"
        there = open_scene(address)
        assert np.array_equal(here.points, there.points) and there.count == here.count
        assert set(server.queries) == {SECRET}, "the signature goes with each request"
        before = server.sent
        assert np.array_equal(open_scene(address.replace("1f2e3d", "ffffff")).points, here.points)
        assert server.sent - before < 70_000, "a new link to the same file: only compared"
        assert main(["info", address, "--json"]) == 0
        assert json.loads(capsys.readouterr().out)["points"] == 20_000
        assert main(["export", address, "--out", str(tmp_path / "out.laz")]) == 0


def test_info_reads_little_and_says_so(tmp_path, capsys):
    data = scan(tmp_path, 900_000)
    with served({"a.laz": data}) as server:
        assert main(["info", f"{server.address}/a.laz", "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert found["points"] == 900_000 and found["spacing"] is None and found["sources"] == [f"{server.address}/a.laz"]
        assert found["bounds"]["min"] == pytest.approx([4e5, 5e6, 100], abs=0.01)
        assert server.sent < 0.02 * len(data) and found["read"] == pytest.approx(server.sent / len(data), rel=0.3)
        assert main(["info", f"{server.address}/a.laz"]) == 0
        said = capsys.readouterr().out
        assert "known once it is opened" in said and re.search(r"^size +\S+ x \S+ x \S+ units$", said, re.MULTILINE)


@pytest.mark.parametrize("fault", ["", "cut", "busy"])
def test_info_of_an_e57_reads_its_header_and_xml(tmp_path, capsys, fault):
    import pye57

    random = np.random.default_rng(3)
    moved = {"rotation": np.array([0.5**0.5, 0, 0, 0.5**0.5]), "translation": np.array([10.0, 0, 0])} if fault == "cut" else {}
    with pye57.E57(str(tmp_path / "a.e57"), mode="w") as file:
        for number in range(2):
            xyz = random.uniform(0, 4, (400_000, 3)) + (10 * number, 0, 0)
            file.write_scan_raw(dict(zip(("cartesianX", "cartesianY", "cartesianZ"), xyz.T.copy(), strict=True)),
                                name=f"hall {number}", **moved)
    data = (tmp_path / "a.e57").read_bytes()
    with served({"a.e57": data}) as server:
        server.cuts, server.busy = 2 * (fault == "cut"), 2 * (fault == "busy")
        assert main(["info", f"{server.address}/a.e57", "--json"]) == 0
        found = json.loads(capsys.readouterr().out)
        assert server.sent < 0.01 * len(data) and found["read"] == pytest.approx(server.sent / len(data), rel=0.7)
        assert found["points"] == 800_000 and [scan["name"] for scan in found["scans"]] == ["hall 0", "hall 1"]
        assert main(["info", f"{server.address}/a.e57"]) == 0
        said = capsys.readouterr().out
        if moved:
            assert found["bounds"] == {"min": None, "max": None} and found["size"] is None, "its frame is not known"
            assert "hall 1: scanner at (10, 0, 0)" in said and re.search(r"size +known once it is opened", said)
        else:
            assert found["bounds"]["min"] == pytest.approx([0, 0, 0], abs=1e-3)
            assert found["bounds"]["max"] == pytest.approx([14, 4, 4], abs=1e-3)
        if not fault:
            server.files["a.e57"] = data[: len(data) // 2]
            assert main(["info", f"{server.address}/a.e57"]) == 2
            assert "a.e57: truncated or damaged: its description would end" in capsys.readouterr().err


@pytest.mark.parametrize("fault", ["cut", "silent", "busy", "whole only"])
def test_faults_of_the_network_that_pass_are_bridged(tmp_path, fault, monkeypatch):
    monkeypatch.setattr(remote_object, "SILENT", 1.0)
    data = scan(tmp_path, 60_000)
    with served({"a.laz": data}) as server:
        server.cuts, server.busy, server.whole_only = 2 * (fault == "cut"), 2 * (fault == "busy"), fault == "whole only"
        server.silences = 2 * (fault == "silent")
        path = fetched(address_in(f"{server.address}/a.laz"))
        assert path.read_bytes() == data and server.cuts == server.busy == server.silences == 0
        before = server.sent
        fetched(address_in(f"{server.address}/a.laz"))
        assert server.sent - before <= (2 * len(data) if fault == "whole only" else 70_000), "it is there"


@pytest.mark.parametrize("status, words", [(404, "no such file there (404)"), (403, "does not give it out"),
                                           (503, "cannot be read (the server answers 503"),
                                           (0, "cannot be read (nothing answers there); check")])  # fmt: skip
def test_errors_are_one_line_without_the_signature(tmp_path, capsys, status, words):
    with served({}) as server:
        server.refuse["a.laz"] = status
        address = f"{server.address if status else 'http://127.0.0.1:9'}/a.laz?{SECRET}"
        assert main(["info", address]) == 2
    line = capsys.readouterr().err
    assert words in line and line.count("\n") == 1 and "1f2e3d" not in line and not list(tmp_path.glob("cache/remote/*/a.laz"))


@pytest.mark.slow
def test_a_server_that_falls_silent_is_not_waited_for_without_end(tmp_path, capsys, monkeypatch, caplog):
    monkeypatch.setattr(remote_object, "SILENT", 0.4)
    monkeypatch.setattr(remote_object, "_FIRST_PAUSE", 0.01)
    data, progress_said = scan(tmp_path, 60_000), set[str]()
    monkeypatch.setattr(Progress, "say", lambda meter, text: progress_said.add(text))
    with served({"a.laz": data}) as server:
        server.silences = 10**6
        assert main(["info", f"{server.address}/a.laz"]) == 2
        assert "a.laz: the connection breaks off again and again (no answer for 0.4 s)" in capsys.readouterr().err
        assert "no answer for 0.4 s, trying again, 3 of 5" in caplog.text, "before there is a progress"
        server.silences = 0
        copy = LocalCopy(tmp_path / "copy", "a.laz", RemoteObject(address_in(f"{server.address}/a.laz"), 65_536))
        server.silences = 10**6
        with pytest.raises(InputError, match=r"no answer for 0\.4 s"):
            copy.fetch_all("fetching")
        assert any(text.startswith("no answer for 0.4 s, trying again, ") for text in progress_said)


def test_a_file_that_changes_on_the_server_is_read_anew_and_never_mixed(tmp_path):
    first, second = bytes(60_000_000), b"\1" * 60_000_000  # 59 requests
    with served({"a.bin": first}) as server:
        server.changes_after, server.later = 6, {"a.bin": second}
        assert fetched(address_in(f"{server.address}/a.bin")).read_bytes() == second
        server.changes_after, server.later = len(server.requests), {"a.bin": first[:100]}
        assert fetched(address_in(f"{server.address}/a.bin")).read_bytes() == first[:100]


def test_what_came_before_a_broken_network_is_not_read_again(tmp_path):
    data = np.random.default_rng(5).bytes(30_000_000)
    with served({"a.bin": data}) as server:
        address = address_in(f"{server.address}/a.bin")
        server.later, server.changes_after = {}, None
        process = subprocess.Popen([sys.executable, "-c", FETCH, f"{server.address}/a.bin"])
        server.delay = 0.2
        while len(server.requests) < 5:
            pass
        process.kill()  # -9, at any moment
        process.wait()
        server.delay, before = 0.0, server.sent
        path = fetched(address)
        assert path.read_bytes() == data
        assert server.sent - before <= len(data) + 70_000
    assert fetched(address) == path, "the server is gone, the copy is whole"
    path.parent.joinpath("state.json").unlink()
    with pytest.raises(InputError, match="cannot be read"):
        fetched(address)


FETCH = ("import sys; from pointglass.viewer.readers.remote.address import address_in; "
         "from pointglass.viewer.readers.remote.fetch import fetched; fetched(address_in(sys.argv[1]))")


def test_s3_is_asked_as_s3_with_the_keys_of_the_environment(tmp_path, monkeypatch):
    data = scan(tmp_path)
    with served({"bucket/scans/a.laz": data}) as server:
        monkeypatch.setenv("AWS_ENDPOINT_URL", server.address)
        assert fetched(address_in("s3://bucket/scans/a.laz")).read_bytes() == data
        assert "authorization" not in server.headers, "public buckets"
        monkeypatch.setenv("AWS_ACCESS_KEY_ID", "me")
        monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "mine")
        assert fetched(address_in("s3://bucket/scans/a.laz")).read_bytes() == data
        assert "Credential=me/" in server.headers["authorization"] and "mine" not in str(server.headers)


def test_copies_used_longest_ago_make_room(tmp_path, monkeypatch):
    import os

    files = {f"{k}.bin": np.random.default_rng(k).bytes(3_000_000) for k in range(3)}
    with served(files) as server:
        monkeypatch.setenv("POINTGLASS_REMOTE_GB", "0.007")
        addresses = [address_in(f"{server.address}/{name}") for name in files]
        for age, address in zip((2e5, 1e5), addresses, strict=False):
            os.utime(fetched(address).parent, (1e9 - age, 1e9 - age))
        fetched(addresses[2])
        assert [local_path(address).exists() for address in addresses] == [False, True, True]


def test_a_project_keeps_the_address_without_its_signature(tmp_path):
    data = scan(tmp_path)
    with served({"a.laz": data}) as server:
        address = f"{server.address}/a.laz?{SECRET}"
        open_scene(address)
        project = tmp_path / "p.pointglass"
        write_project(project, Document(scans=(ScanFile(address),)))
        assert "1f2e3d" not in project.read_text() and f"{server.address}/a.laz" in project.read_text()
        assert read_project(project).scans[0].path == f"{server.address}/a.laz"
        assert main(["info", str(project), "--json"]) == 0


@pytest.mark.parametrize("address", ["https://host", "ftp://host/a.laz"])
def test_what_cannot_be_read_from_an_address_is_said_at_once(capsys, address):
    assert main(["info", address]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_what_is_no_scan_is_named_by_its_address(tmp_path, capsys):
    pages = {"page.laz": b"<!DOCTYPE html><html>Please log in", "cut.laz": scan(tmp_path)[:3000], "odd.laz": b"no scan" * 99}
    words = {"page.laz": "a web page", "cut.laz": "truncated", "odd.laz": "does not begin like one"}
    with served(pages) as server:
        for whole_only in (False, True):
            server.whole_only = whole_only
            for name, word in words.items():
                assert main(["convert", f"{server.address}/{name}", "--out", str(tmp_path / "grid")]) == 2
                line = capsys.readouterr().err.splitlines()[-1]
                assert f"{server.address}/{name}: " in line and word in line and "cache" not in line
        server.whole_only, server.cuts = False, 99
        assert main(["info", f"{server.address}/odd.laz?{SECRET}"]) == 2
        line = capsys.readouterr().err
        assert line.count("\n") == 1 and "breaks off" in line and "1f2e3d" not in line
