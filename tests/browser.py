"""A page in headless Chromium, which sends back what it finds."""

import json
import shutil
import subprocess
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
needs_chromium = pytest.mark.skipif(CHROMIUM is None, reason="needs Chromium (Debian: chromium)")
GL = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


def told_by(page, folder, *, meanwhile=lambda: None, seconds=40.0):
    """What a page POSTs to "/" as JSON, and the messages of its console; `meanwhile` is called until then."""
    told = []

    class Server(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200 if self.path == "/" else 204)
            self.send_header("Content-Type", "text/html; charset=utf-8")
            self.end_headers()
            self.wfile.write(page.encode() if self.path == "/" else b"")

        def do_POST(self):
            told.append(json.loads(self.rfile.read(int(self.headers["Content-Length"]))))
            self.send_response(204)
            self.end_headers()

        def log_message(self, *words):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Server)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    words = ["--headless=new", "--no-sandbox", *GL, "--enable-logging=stderr", f"--user-data-dir={folder / 'profile'}"]
    log = folder / "browser.log"
    with log.open("w") as file:
        browser = subprocess.Popen(
            [CHROMIUM, *words, f"http://localhost:{server.server_port}/"], stdout=subprocess.DEVNULL, stderr=file
        )
        try:
            end = time.monotonic() + seconds
            while not told:
                meanwhile()
                time.sleep(0.03)
                assert time.monotonic() < end, "the page said nothing"
        finally:
            browser.kill()
            browser.wait()
            server.shutdown()
    console = [line for line in log.read_text(errors="replace").splitlines() if "CONSOLE" in line]
    return told[0], [line for line in console if "willReadFrequently" not in line]
