"""The pictures of the documentation, drawn with this build."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import matplotlib.pyplot as plt
import numpy as np

from lab.figures.pages import ROOT
from voodoo.export.skeleton import bones
from voodoo.model.body import Body
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import open_recording, sample_path
from voodoo.visualization.overlay import Overlay

EVERY = 2
"""Frames of the bundled recording for each of docs/demo.webp."""
WIDTH, QUALITY = 800, 55
"""Of docs/demo.webp [px, %]."""


def draw(data: Path) -> None:
    """Draw docs/demo.webp, docs/joint-frames.png and docs/failures.png; `data` is the folder of the measurement data."""
    _demo(ROOT / "docs" / "demo.webp")
    _joint_frames(ROOT / "docs" / "joint-frames.png")
    recordings = sorted((data / "rendered").glob("dev_*"))
    if not recordings:
        sys.exit(f"lab.figures: expected recordings in {data / 'rendered'}, found none")
    command = [sys.executable, ROOT / "lab" / "experiments" / "failures.py", *recordings]
    subprocess.run([*command, "--out", ROOT / "docs" / "failures.png"], check=True)


def _joint_frames(target: Path) -> None:
    """The default human at rest: bones, their names, and the frame of each; x red, y green, z blue."""
    figure = plt.figure(figsize=(9.0, 8.0))
    axes = figure.add_subplot(projection="3d", proj_type="ortho", computed_zorder=False)
    for bone in bones(Body.human()):
        axes.plot(*np.array([bone.head, bone.tip]).T, color="0.6", linewidth=4.0, solid_capstyle="round", zorder=1)
        for axis, color in zip(np.eye(3), ("#d62728", "#2ca02c", "#1f77b4"), strict=True):
            axes.plot(*np.array([bone.head, bone.head + 0.09 * axis]).T, color=color, linewidth=1.8, zorder=2)
        if bone.name.startswith("r_"):  # names of the left are alike
            low = 0.05 if bone.name == "r_clavicle" else 0.0
            axes.text(*(bone.head - (0.0, 0.03, low)), bone.name, fontsize=8, ha="right", va="center")
        elif not bone.name.startswith("l_"):
            axes.text(*(bone.head + (0.0, 0.11, 0.0)), bone.name, fontsize=8, ha="left", va="center")
    axes.set_aspect("equal")
    axes.view_init(elev=14.0, azim=28.0)
    axes.set_axis_off()
    figure.savefig(target, dpi=130)
    plt.close(figure)
    image = cv2.imread(str(target))
    rows, columns = np.nonzero(image.min(axis=2) < 255)
    cv2.imwrite(str(target), image[rows.min() - 8 : rows.max() + 8, columns.min() - 8 : columns.max() + 8])


def _demo(target: Path) -> None:
    """The model over the images of the bundled recording, as a moving picture."""
    recording = open_recording(sample_path())
    tracker, overlay, moving = start_tracker(recording), Overlay(recording), cv2.Animation()
    frames = []
    for frame in track(recording, tracker):
        if frame.index % EVERY == 0:
            displayed = overlay.draw(
                frame.recorded, tracker.body, frame.estimate, index=frame.index, front_end=frame.front_end
            )
            size = (WIDTH, round(displayed.shape[0] * WIDTH / displayed.shape[1]))
            frames.append(cv2.resize(displayed, size, interpolation=cv2.INTER_AREA))
    moving.frames, moving.durations = frames, [round(1000 * EVERY / recording.info().rate_hz)] * len(frames)
    if not cv2.imwriteanimation(str(target), moving, [cv2.IMWRITE_WEBP_QUALITY, QUALITY]):
        sys.exit(f"lab.figures: {target} cannot be written")
