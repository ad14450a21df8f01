"""Recordings: the measurements of sensors as frames with stamps, calibrations and poses in one root frame."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from voodoo.measurements import (
        ColorImage,
        DepthImage,
        KeypointImage,
        LaserScan,
        MarkerSet,
        Measurement,
        PointCloud,
        RecordedFrame,
    )
    from voodoo.recordings.loaders import LOADERS, open_recording
    from voodoo.recordings.recording import Recording, RecordingInfo, Reference, SensorInfo, Start
    from voodoo.recordings.sample import sample_path

__all__ = [
    "LOADERS",
    "ColorImage",
    "DepthImage",
    "KeypointImage",
    "LaserScan",
    "MarkerSet",
    "Measurement",
    "PointCloud",
    "RecordedFrame",
    "Recording",
    "RecordingInfo",
    "Reference",
    "SensorInfo",
    "Start",
    "open_recording",
    "sample_path",
]

# Imported on first use, so that the command line lists the loaders without NumPy.
_HOMES = {
    "voodoo.recordings.loaders": ("LOADERS", "open_recording"),
    "voodoo.recordings.recording": ("Recording", "RecordingInfo", "Reference", "SensorInfo", "Start"),
    "voodoo.recordings.sample": ("sample_path",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever the name stands for
    if name not in __all__:
        raise AttributeError(f"module 'voodoo.recordings' has no attribute {name!r}")
    value = getattr(import_module(_HOME_OF.get(name, "voodoo.measurements")), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
