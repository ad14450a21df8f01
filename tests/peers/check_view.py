"""Run by test_live_peers.py in an environment with rerun-sdk: the page that --serve shows."""

import base64
import json
import shutil
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest

from voodoo.errors import VoodooError
from voodoo.recordings import sample_path
from voodoo.visualization.rerun_server import Server

CHROMIUM = next(
    (found for name in ("chromium", "chromium-browser", "google-chrome") if (found := shutil.which(name))), None
)

COLORS = 300
"""A page that loads has a few grays; one that shows points and text has thousands of shades."""


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def listening():
    """Addresses [hex] of the sockets that listen, by port."""
    lines = Path("/proc/net/tcp").read_text().splitlines()[1:]
    rows = [line.split() for line in lines]
    return {int(row[1].split(":")[1], 16): row[1].split(":")[0] for row in rows if row[3] == "0A"}


def test_it_is_for_this_machine_only_and_ends():
    port = free_port()
    server = Server(str(port))
    try:
        assert {listening()[port], listening()[port + 1]} == {"0100007F"}, "127.0.0.1"
        page = urllib.request.urlopen(f"http://127.0.0.1:{port}", timeout=5).read()
        assert b"Rerun" in page
        with pytest.raises(VoodooError, match="free port"):
            Server(str(port))
    finally:
        server.close()
    assert port not in listening()


def live(port, tmp_path):
    code = "import sys; from voodoo.cli import main; sys.argv[0] = 'voodoo'; main()"
    words = ["live", str(sample_path()), "--loop", "--serve", str(port), "--use", "depth"]
    return subprocess.Popen([sys.executable, "-c", code, *words], stderr=subprocess.PIPE, text=True, cwd=tmp_path)


def test_a_live_session_is_served(tmp_path):
    port = free_port()
    process = live(port, tmp_path)
    message = ""
    for line in process.stderr:
        message += line
        if " Hz; " in line:
            break
    try:
        assert f"look at http://127.0.0.1:{port}/?url=rerun" in message
        assert b"Rerun" in urllib.request.urlopen(f"http://127.0.0.1:{port}", timeout=5).read()
    finally:
        process.terminate()
        message += process.communicate(timeout=30)[1]
    assert process.returncode == 143, message
    assert port not in listening()


def pictures_of(address, folder):
    """What a browser without a screen draws of a page, every two seconds for a minute and a half."""
    import cv2
    import websocket

    port = free_port()
    flags = ["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader", "--mute-audio"]
    flags += ["--enable-unsafe-swiftshader", "--ignore-gpu-blocklist", "--window-size=1000,700"]
    flags += [f"--remote-debugging-port={port}", "--remote-allow-origins=*", f"--user-data-dir={folder / 'profile'}"]
    browser = subprocess.Popen([CHROMIUM, *flags, address], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        until, pages = time.monotonic() + 30.0, []
        while not pages and time.monotonic() < until:
            try:
                message = json.loads(urllib.request.urlopen(f"http://127.0.0.1:{port}/json", timeout=5).read())
                pages = [page["webSocketDebuggerUrl"] for page in message if page["type"] == "page"]
            except OSError:
                time.sleep(0.2)
        line = websocket.create_connection(pages[0], timeout=30)
        for number in range(45):
            time.sleep(2.0)
            line.send(json.dumps({"id": number, "method": "Page.captureScreenshot"}))
            answer = {}
            while answer.get("id") != number:
                answer = json.loads(line.recv())
            data = base64.b64decode(answer["result"]["data"])
            (folder / "page.png").write_bytes(data)
            yield cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    finally:
        browser.terminate()
        browser.wait()


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here")
def test_a_browser_shows_it(tmp_path):
    """A browser without a screen draws somebody: a page that loads, or fails, has a few grays."""
    port = free_port()
    process = live(port, tmp_path)
    address = ""
    for line in process.stderr:
        if "look at " in line:
            address = line.split("look at ")[1].split()[0]
        if " Hz; " in line:
            break
    try:
        most = 0
        for image in pictures_of(address, tmp_path):
            most = max(most, len({tuple(pixel) for pixel in image[::5, ::5].reshape(-1, 3).tolist()}))
            if most > COLORS:
                break
        assert most > COLORS
    finally:
        process.terminate()
        process.communicate(timeout=30)
