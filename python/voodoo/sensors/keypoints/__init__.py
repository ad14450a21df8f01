"""2-D keypoints of any network as measurements: one table of layouts, rays, and robust 3-D points from registered depth."""

from voodoo.recordings.keypoint_files import read_openpose_json
from voodoo.recordings.keypoint_layouts import LAYOUTS, Layout, SiteKeypoints, layout_of
from voodoo.sensors.keypoints.sensor import KeypointReport, KeypointSensor
from voodoo.sensors.keypoints.sites import MIN_CONFIDENCE, SitePixel, check_confidence, nearest_person, site_pixels
from voodoo.sensors.keypoints.surface import BEHIND_SURFACE_M, window_depth

__all__ = [
    "BEHIND_SURFACE_M",
    "LAYOUTS",
    "MIN_CONFIDENCE",
    "KeypointReport",
    "KeypointSensor",
    "Layout",
    "SiteKeypoints",
    "SitePixel",
    "check_confidence",
    "layout_of",
    "nearest_person",
    "read_openpose_json",
    "site_pixels",
    "window_depth",
]
