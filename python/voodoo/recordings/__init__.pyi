from typing import Any

from voodoo.measurements import ColorImage as ColorImage
from voodoo.measurements import DepthImage as DepthImage
from voodoo.measurements import KeypointImage as KeypointImage
from voodoo.measurements import LaserScan as LaserScan
from voodoo.measurements import MarkerSet as MarkerSet
from voodoo.measurements import Measurement as Measurement
from voodoo.measurements import PointCloud as PointCloud
from voodoo.measurements import RecordedFrame as RecordedFrame
from voodoo.recordings.loaders import LOADERS as LOADERS
from voodoo.recordings.loaders import open_recording as open_recording
from voodoo.recordings.loaders import sample_path as sample_path
from voodoo.recordings.recording import Recording as Recording
from voodoo.recordings.recording import RecordingInfo as RecordingInfo
from voodoo.recordings.recording import Reference as Reference
from voodoo.recordings.recording import SensorInfo as SensorInfo
from voodoo.recordings.recording import Start as Start

def __getattr__(name: str) -> Any: ...  # noqa: ANN401 - whatever the name stands for
