"""2-D keypoints of any network as measurements: one table of layouts, rays, and robust 3-D points from registered depth."""

from voodoo.recordings.keypoint_layouts import LAYOUTS as LAYOUTS
from voodoo.sensors.keypoints.sites import KeypointReport as KeypointReport
from voodoo.sensors.keypoints.sites import KeypointSensor as KeypointSensor
