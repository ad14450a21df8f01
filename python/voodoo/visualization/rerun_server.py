"""Serves Rerun's web viewer to browsers from a separate process, only on this machine unless another address is given."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from typing import Any

from voodoo.children import NEUTRAL_FOLDER, children
from voodoo.errors import VoodooError

LOOPBACK = "127.0.0.1"
_MEMORY = "256MB"
"""Amount of past data for browsers that connect late."""
_PATIENCE_S = 20.0


class Server:
    """Serves a page at a port, and receives data at the next one.

    Args:
        where: "PORT", or "HOST:PORT" with the address to listen on.

    Attributes:
        address: address of the page.
        data: address for the data.

    Raises:
        VoodooError: an invalid port, one that is in use, or a server that does not start.
    """

    def __init__(self, where: str) -> None:
        """Start the server."""
        host, _, port = where.rpartition(":")
        if not port.isdecimal() or not 0 < int(port) < 65535:
            raise VoodooError(f"serve: expected PORT or HOST:PORT with a port from 1 to 65534, found {where!r}")
        host, page = host.strip("[]") or LOOPBACK, int(port)
        for each in (page, page + 1):
            if _answers(host, each):
                raise VoodooError(f"serve: expected a free port, found {each} taken")
        command = [sys.executable, "-m", "rerun", "--serve-web", "--bind", host, "--port", str(page + 1)]
        command += ["--web-viewer-port", str(page), "--server-memory-limit", _MEMORY]
        with children(quiet=True):
            silent: Any = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.DEVNULL)
            self._process = subprocess.Popen(command, cwd=NEUTRAL_FOLDER, start_new_session=True, **silent)
        self.data = f"rerun+http://{_reached(host)}:{page + 1}/proxy"
        self.address = f"http://{_reached(host)}:{page}/?url={self.data.replace(':', '%3A').replace('/', '%2F')}"
        until = time.monotonic() + _PATIENCE_S
        while not (_answers(host, page) and _answers(host, page + 1)):
            if self._process.poll() is not None or time.monotonic() > until:
                self.close()
                raise VoodooError(f"serve: Rerun's server did not start on {host}:{page}")
            time.sleep(0.05)

    def close(self) -> None:
        """Stop the server and its child processes."""
        if sys.platform == "win32":  # which has no groups of processes
            self._process.kill()
            return
        for number in (signal.SIGTERM, signal.SIGKILL):
            try:
                os.killpg(self._process.pid, number)
            except ProcessLookupError:
                break
            try:
                self._process.wait(5.0)
            except subprocess.TimeoutExpired:
                continue


def _reached(host: str) -> str:
    """An address at which this machine reaches a server that listens on `host`."""
    everywhere = {"0.0.0.0": LOOPBACK, "::": "[::1]"}
    return everywhere.get(host, f"[{host}]" if ":" in host else host)


def _answers(host: str, port: int) -> bool:
    try:
        with socket.create_connection((_reached(host).strip("[]"), port), timeout=0.5):
            return True
    except OSError:
        return False
