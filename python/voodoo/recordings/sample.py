"""The recording that ships with the package."""

from __future__ import annotations

from pathlib import Path


def sample_path() -> Path:
    """Folder of the bundled recording: 90 frames of a rendered person who bends over, scoops and reaches up.

    It opens like any other: `open_recording(sample_path())`. Source and license are in its README.md.
    """
    return Path(__file__).resolve().parent.parent / "data" / "bend_scoop"
