"""Detectors of one's own: what `Tracker` and `People` take as `detector` besides the one that comes with the package."""

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
