"""voodoo: the 3-D pose of a person, or any articulated body, every frame, on a plain CPU, from what the robot has."""

from voodoo import ik
from voodoo._core import ClosestPoints, Estimate, Frame, TaperedEllipticCylinder, __version__
from voodoo.body import Body, Joint, Limb, Place
from voodoo.camera import Camera
from voodoo.config import Config
from voodoo.errors import BodyError, CameraError, ConfigError, MeasurementError, RecordingError, VoodooError
from voodoo.recordings import open_recording
from voodoo.rendering import RenderedDepth, render_depth
from voodoo.tracker import Tracker

__all__ = [
    "Body",
    "BodyError",
    "Camera",
    "CameraError",
    "ClosestPoints",
    "Config",
    "ConfigError",
    "Estimate",
    "Frame",
    "Joint",
    "Limb",
    "MeasurementError",
    "Place",
    "RecordingError",
    "RenderedDepth",
    "TaperedEllipticCylinder",
    "Tracker",
    "VoodooError",
    "__version__",
    "ik",
    "open_recording",
    "render_depth",
]
