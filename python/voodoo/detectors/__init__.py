"""Custom detectors for the `detector` argument of `Tracker` and `People`, besides the shipped one."""

from voodoo.detectors.base import (
    JOINTS,
    LENGTHS,
    AnyDetector,
    CallableDetector,
    DetectedPerson,
    DetectorImage,
    PersonDetector,
)
from voodoo.detectors.onnx import OnnxDetector

__all__ = [
    "JOINTS",
    "LENGTHS",
    "AnyDetector",
    "CallableDetector",
    "DetectedPerson",
    "DetectorImage",
    "OnnxDetector",
    "PersonDetector",
]
