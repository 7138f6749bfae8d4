"""Scans at an address of nginx, the web server of many archives: ranges, its tags (time and length), folders."""

import os
import shutil
import socket
import subprocess
import time
from pathlib import Path

import numpy as np
import pytest
from format_files import some, write_ept
from test_remote_scans import scan

from pointglass.viewer.grid.open_scene import open_scene
from pointglass.viewer.readers.remote.address import address_in
from pointglass.viewer.readers.remote.fetch import fetched

pytestmark = pytest.mark.skipif(shutil.which("nginx", path=f"{os.environ.get('PATH', '')}:/usr/sbin") is None,
                                reason="nginx is not installed (apt-get install nginx-light)")  # fmt: skip

CONFIGURATION = """
daemon off; pid {home}/pid; error_log {home}/error.log; worker_processes 1;
events {{ worker_connections 64; }}
http {{
    access_log {home}/access.log; server_tokens off;
    client_body_temp_path {home}/t1; proxy_temp_path {home}/t2; fastcgi_temp_path {home}/t3; uwsgi_temp_path {home}/t4;
    scgi_temp_path {home}/t5;
    server {{ listen 127.0.0.1:{port}; root {root}; }}
}}
"""


@pytest.fixture
def nginx(tmp_path, monkeypatch):
    """(address, folder that is served); the server ends with the test."""
    monkeypatch.setenv("POINTGLASS_CACHE", str(tmp_path / "cache"))
    home, root = tmp_path / "nginx", tmp_path / "served"
    home.mkdir()
    root.mkdir()
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    user = "user root;" if os.geteuid() == 0 else ""  # else its workers run as one who may not read the folder
    (home / "conf").write_text(user + CONFIGURATION.format(home=home, root=root, port=port))
    program = shutil.which("nginx", path=f"{os.environ.get('PATH', '')}:/usr/sbin")
    process = subprocess.Popen([program, "-c", str(home / "conf"), "-p", str(home), "-e", str(home / "error.log")])
    try:
        while True:
            assert process.poll() is None, (home / "error.log").read_text()
            try:
                socket.create_connection(("127.0.0.1", port), 1).close()
                break
            except OSError:
                time.sleep(0.05)
        yield f"http://127.0.0.1:{port}", root
    finally:
        process.terminate()
        process.wait(10)


def test_a_file_and_an_octree_of_nginx_are_those_of_the_disk_and_new_ones_are_noticed(nginx, tmp_path):
    address, root = nginx
    scan(root, 30_000)
    write_ept(root / "house", some(2000), data="binary")
    for name in ("a.laz", "house", "house/ept.json"):
        assert np.array_equal(open_scene(f"{address}/{name}").points, open_scene(root / name, cache=False).points)
    lines = (tmp_path / "nginx" / "access.log").read_text().splitlines()
    assert lines and not [line for line in lines if '" 200 ' in line], "parts only"
    scan(root, 20_000)
    os.utime(root / "a.laz", (1e9, 1e9))
    shutil.rmtree(root / "house")
    write_ept(root / "house", some(1500, seed=4), data="binary")
    os.utime(root / "house" / "ept.json", (1e9, 1e9))
    assert open_scene(f"{address}/a.laz").count == 20_000 and open_scene(f"{address}/house").count == 1500
    (root / "house" / "ept-data" / "0-0-0-0.bin").unlink()
    assert Path(fetched(address_in(f"{address}/house"))).is_file(), "all of it is here"
