"""Recordings: what sensors saw, as frames with stamps, calibrations and poses in one root frame."""

from voodoo.recordings.loaders import LOADERS, open_recording
from voodoo.recordings.measurements import (
    ColorImage,
    DepthImage,
    KeypointImage,
    LaserScan,
    MarkerSet,
    Measurement,
    PointCloud,
    RecordedFrame,
)
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
