"""2-D keypoints of any network as measurements: one table of layouts, rays, and robust 3-D points from registered depth."""

from voodoo.recordings.keypoint_layouts import LAYOUTS as LAYOUTS
from voodoo.sensors.keypoints.sensor import KeypointReport as KeypointReport
from voodoo.sensors.keypoints.sensor import KeypointSensor as KeypointSensor
