"""Messages and small bags that tests of ROS recordings share."""

import cv2
import numpy as np

from bag_writer import Messages, write_bag
from voodoo.recordings import DepthImage

M = Messages()
DEPTH = np.arange(12, dtype=np.uint16).reshape(3, 4) * 300
IDENTITY = (0, 0, 0, 1)
TF = (
    "/tf_static",
    9.9,
    M.tf((9.9, "base_link", "cam", (1, 2, 3), IDENTITY), (9.9, "cam", "laser", (0, 0, 1), IDENTITY)),
)
INFO = ("/d/depth/camera_info", 10.0, M.camera_info(10.0))


def depth_entry(stamp=10.0, data=DEPTH, encoding="16UC1", topic="/d/depth/image", **options):
    return (topic, stamp, M.image(stamp, data, encoding, **options))


def only(recording, kind=DepthImage):
    return [m for frame in recording for m in frame.measurements if isinstance(m, kind)]


def bag(tmp_path, *entries, **options):
    return write_bag(tmp_path / "b", entries, **options)


def compressed_depth(data, fmt="16UC1; compressedDepth png", header=b"\0" * 12, stamp=10.0):
    png = cv2.imencode(".png", data)[1].tobytes()
    return ("/d/depth/image/compressedDepth", stamp, M.compressed(stamp, header + png, fmt))
