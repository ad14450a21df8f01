"""A robot on ROS 2: depth images and odometry, by voodoo's own node. Run with cyclonedds.

    python ros_robot.py images.npz --rate 30 --count 300 --odometry 50

The file has `images` (N, H, W) uint16 [mm] and `k` (9,). The camera is said to drive to and fro by 1 mm. Prints JSON as
`ros_peer.py` does: `sent` and `states` (stamp, latency [s] from stamp to arrival).
"""

import argparse
import json
import math
import time

import numpy as np

import voodoo
from voodoo.export.ros2 import STORE, cdr, header_at
from voodoo.live.recorder import _depth, camera_info, transforms
from voodoo.live.ros2.dds import Node
from voodoo.measurements import DepthImage

TOPIC, STATES, STATE = "/camera/depth/image_raw", "/humans/bodies/p1/joint_states", "sensor_msgs/msg/JointState"


class Robot:
    def __init__(self, file, odometry_hz):
        content = np.load(file)
        height, width = content["images"].shape[1:]
        k = content["k"].reshape(3, 3)
        self.camera = voodoo.Camera(width, height, k[0, 0], k[1, 1], k[0, 2], k[1, 2])
        self.images, self.odometry_hz = content["images"], odometry_hz
        self.node, self.heard = Node(), None
        kinds = {TOPIC: "sensor_msgs/msg/Image", "/tf": "tf2_msgs/msg/TFMessage"}
        kinds[TOPIC.rsplit("/", 1)[0] + "/camera_info"] = "sensor_msgs/msg/CameraInfo"
        self.images_out, self.transforms_out, self.infos_out = (self.node.advertise(*item) for item in kinds.items())
        self.sent, self.states = [], []

    def send_image(self, number):
        now = time.time()
        item = DepthImage("depth", now, self.images[number % len(self.images)], 0.001, self.camera, np.eye(4))
        self.infos_out.write(cdr(camera_info(header_at(now, "camera"), self.camera)))
        self.images_out.write(cdr(_depth(header_at(now, "camera"), item)))
        self.sent.append(now)

    def send_transform(self):
        pose, now = np.eye(4), time.time()
        pose[0, 3] = 1e-3 * math.sin(now)
        self.transforms_out.write(cdr(transforms("odom", "camera", now, pose)))

    def wait_until(self, due):
        """Take what comes until then."""
        while (left := due - time.time()) > 0.0:
            self.node.wait(left)
            if self.heard is None and STATES in (offers := self.node.offers()):
                self.heard = self.node.subscribe(STATES, offers[STATES], depth=50)
            for raw in self.heard.take() if self.heard else ():
                stamp = STORE.deserialize_cdr(raw, STATE).header.stamp
                seconds = stamp.sec + 1e-9 * stamp.nanosec
                self.states.append((seconds, time.time() - seconds))


def main():
    options = argparse.ArgumentParser()
    options.add_argument("images")
    options.add_argument("--rate", type=float, default=30.0)
    options.add_argument("--count", type=int, default=300)
    options.add_argument("--odometry", type=float, default=50.0, help="transforms a second")
    chosen = options.parse_args()
    robot = Robot(chosen.images, chosen.odometry)
    until = time.time() + 20.0
    while not (robot.images_out.subscribers and robot.transforms_out.subscribers) and time.time() < until:
        time.sleep(0.05)
    started = time.time() + 0.5
    due = [(started + (number + 0.2) / chosen.rate, number) for number in range(chosen.count)]
    seconds = chosen.count / chosen.rate
    due += [(started + number / chosen.odometry, None) for number in range(round(seconds * chosen.odometry))]
    for when, number in sorted(due, key=lambda item: item[0]):
        robot.wait_until(when)
        if number is None:
            robot.send_transform()
        else:
            robot.send_image(number)
    robot.wait_until(time.time() + 2.0)
    print(json.dumps({"sent": robot.sent, "states": robot.states}), flush=True)


if __name__ == "__main__":
    main()
