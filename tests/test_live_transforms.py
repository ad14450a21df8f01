"""Frames that wait for the transform of a moving robot go on when it arrives, not when patience ends."""

import time

import numpy as np
import pytest

from live_rig import wall
from voodoo.export.ros2 import cdr, header_at
from voodoo.live import Live, Source
from voodoo.live.recorder import _depth, camera_info, transforms
from voodoo.live.ros2.feed import TF, RosFeed
from voodoo.live.source import SourceEnded
from voodoo.recordings.ros_topics import CAMERA_INFO, IMAGE

DEPTH = "/camera/depth/image_raw"
SECONDS, IMAGES_HZ, ON_THE_WAY_S = 1.2, 30, 0.003
P50_S, MOST_DROPPED = 0.020, 2
"""A frame waits for the next transform for half a period on average; drops are those of a busy machine."""


def driven(seconds):
    """The pose of a robot that drives at half a meter a second."""
    pose = np.eye(4)
    pose[0, 3] = 0.5 * seconds
    return pose


class Robot(Source):
    """Odometry at a rate and images, each message a little after its stamp."""

    name, root_frame = "robot", "odom"

    def __init__(self, rate):
        stamps = [(k / rate, "tf") for k in range(round(SECONDS * rate))]
        stamps += [((k + 0.2) / IMAGES_HZ, "image") for k in range(round((SECONDS - 0.1) * IMAGES_HZ))]
        self.due = sorted(stamps)

    def open(self, clock, faults):
        self.feed = RosFeed([DEPTH], faults, clock, root_frame="odom")
        self.feed.take(
            "/camera/depth/camera_info", CAMERA_INFO, cdr(camera_info(header_at(0.0, "camera"), wall(0.0).camera))
        )
        self.began = time.time()

    def read(self, timeout):
        if not self.due:
            raise SourceEnded
        (after, kind), *self.due = self.due
        stamp = self.began + after
        time.sleep(max(stamp + ON_THE_WAY_S - time.time(), 0.0))
        if kind == "tf":
            return self.feed.take("/tf", TF, cdr(transforms("odom", "camera", stamp, driven(after))))
        return self.feed.take(DEPTH, IMAGE, cdr(_depth(header_at(stamp, "camera"), wall(stamp))))

    def close(self):
        pass


@pytest.mark.parametrize("rate", [50, 200])
def test_a_transform_wakes_the_frame_that_waits_for_it(rate):
    with Live([Robot(rate)]) as live:
        late = [time.time() - frame.stamp for frame in live]
    assert len(late) >= (SECONDS - 0.1) * IMAGES_HZ - 1 - MOST_DROPPED
    assert np.median(late) < P50_S, f"{1e3 * np.median(late):.1f} ms"
    assert live.dropped <= MOST_DROPPED and not live.faults.counts
