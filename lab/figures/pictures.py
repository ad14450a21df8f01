"""The pictures of the documentation, drawn with this build."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2

from lab.figures.pages import ROOT
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import open_recording, sample_path
from voodoo.visualization.overlay import Overlay
from voodoo.visualization.sheet import contact_sheet

PICTURED = (0, 18, 53, 71)
"""Frames of the bundled recording in docs/demo.png."""
WIDTH = 1068
"""Of docs/demo.png [px]."""


def draw(data: Path) -> None:
    """Draw docs/demo.png and docs/failures.png; `data` is the folder of the measurement data."""
    _demo(ROOT / "docs" / "demo.png")
    recordings = sorted((data / "rendered").glob("dev_*"))
    if not recordings:
        sys.exit(f"lab.figures: expected recordings in {data / 'rendered'}, found none")
    command = [sys.executable, ROOT / "lab" / "experiments" / "failures.py", *recordings]
    subprocess.run([*command, "--out", ROOT / "docs" / "failures.png"], check=True)


def _demo(target: Path) -> None:
    """The model over the images of the bundled recording."""
    recording = open_recording(sample_path())
    tracker, overlay, tiles = start_tracker(recording), Overlay(recording), []
    for frame in track(recording, tracker):
        if frame.index in PICTURED:
            displayed = overlay.draw(
                frame.recorded, tracker.body, frame.estimate, index=frame.index, front_end=frame.front_end
            )
            tiles.append(displayed.copy())
    cv2.imwrite(str(target), contact_sheet(tiles, columns=2, width=WIDTH))
