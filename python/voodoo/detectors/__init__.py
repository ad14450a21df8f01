"""Custom detectors for the `detector` argument of `Tracker` and `People`, besides the shipped one."""

from voodoo.detectors.base import JOINTS as JOINTS
from voodoo.detectors.base import LENGTHS as LENGTHS
from voodoo.detectors.base import AnyDetector as AnyDetector
from voodoo.detectors.base import CallableDetector as CallableDetector
from voodoo.detectors.base import DetectedPerson as DetectedPerson
from voodoo.detectors.base import DetectorImage as DetectorImage
from voodoo.detectors.base import PersonDetector as PersonDetector
from voodoo.detectors.onnx import OnnxDetector as OnnxDetector
