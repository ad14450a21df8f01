from typing import Any

from voodoo import ik as ik
from voodoo._core import ClosestPoints as ClosestPoints
from voodoo._core import Detector as Detector
from voodoo._core import Estimate as Estimate
from voodoo._core import Frame as Frame
from voodoo._core import TaperedEllipticCylinder as TaperedEllipticCylinder
from voodoo._core import __version__ as __version__
from voodoo.config import Config as Config
from voodoo.detectors.base import Detection as Detection
from voodoo.errors import BodyError as BodyError
from voodoo.errors import CameraError as CameraError
from voodoo.errors import ConfigError as ConfigError
from voodoo.errors import DetectorWarning as DetectorWarning
from voodoo.errors import MeasurementError as MeasurementError
from voodoo.errors import RecordingError as RecordingError
from voodoo.errors import UnitWarning as UnitWarning
from voodoo.errors import VoodooError as VoodooError
from voodoo.model.body import Body as Body
from voodoo.model.body import Joint as Joint
from voodoo.model.body import Limb as Limb
from voodoo.model.body import Place as Place
from voodoo.model.camera import Camera as Camera
from voodoo.people import People as People
from voodoo.people import PeopleEstimate as PeopleEstimate
from voodoo.people import Person as Person
from voodoo.recordings.loaders import open_recording as open_recording
from voodoo.synthetic.render import RenderedDepth as RenderedDepth
from voodoo.synthetic.render import render_depth as render_depth
from voodoo.tracker import Tracker as Tracker

def __getattr__(name: str) -> Any: ...  # noqa: ANN401 - whatever the name stands for
