"""voodoo: the 3-D pose of a person, or any articulated body, every frame, on a plain CPU, from the sensors of the robot."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from voodoo import ik
    from voodoo._core import ClosestPoints, Detection, Detector, Estimate, Frame, TaperedEllipticCylinder, __version__
    from voodoo.config import Config
    from voodoo.errors import (
        BodyError,
        CameraError,
        ConfigError,
        DetectorWarning,
        MeasurementError,
        RecordingError,
        VoodooError,
    )
    from voodoo.model.body import Body, Joint, Limb, Place
    from voodoo.model.camera import Camera
    from voodoo.people import People, PeopleEstimate, Person
    from voodoo.recordings.loaders import open_recording
    from voodoo.synthetic.render import RenderedDepth, render_depth
    from voodoo.tracker import Tracker

__all__ = [
    "Body",
    "BodyError",
    "Camera",
    "CameraError",
    "ClosestPoints",
    "Config",
    "ConfigError",
    "Detection",
    "Detector",
    "DetectorWarning",
    "Estimate",
    "Frame",
    "Joint",
    "Limb",
    "MeasurementError",
    "People",
    "PeopleEstimate",
    "Person",
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

# Names are imported when they are first used: `voodoo --help` needs neither NumPy nor OpenCV.
_HOMES = {
    "voodoo._core": (
        "ClosestPoints",
        "Detection",
        "Detector",
        "Estimate",
        "Frame",
        "TaperedEllipticCylinder",
        "__version__",
    ),
    "voodoo.config": ("Config",),
    "voodoo.errors": (
        "BodyError",
        "CameraError",
        "ConfigError",
        "DetectorWarning",
        "MeasurementError",
        "RecordingError",
        "VoodooError",
    ),
    "voodoo.model.body": ("Body", "Joint", "Limb", "Place"),
    "voodoo.model.camera": ("Camera",),
    "voodoo.people": ("People", "PeopleEstimate", "Person"),
    "voodoo.recordings.loaders": ("open_recording",),
    "voodoo.synthetic.render": ("RenderedDepth", "render_depth"),
    "voodoo.tracker": ("Tracker",),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever the name stands for
    if name in _HOME_OF:
        value = getattr(import_module(_HOME_OF[name]), name)
        globals()[name] = value
        return value
    from importlib.util import find_spec

    if name.isidentifier() and find_spec(f"voodoo.{name}") is not None:
        return import_module(f"voodoo.{name}")
    raise AttributeError(f"module 'voodoo' has no attribute {name!r}")


def __dir__() -> list[str]:
    from pkgutil import iter_modules

    return sorted({*globals(), *__all__, *(room.name for room in iter_modules(__path__))})
