"""A ROS 2 node of others, by rclpy from the package index; run by its own Python, without voodoo.

    python ros_peer.py images.npz --rate 30 --count 300

Publishes depth images with CameraInfo, counts the joint states and markers that come back, and prints JSON: `sent` and `states`
(stamp, latency [s] from stamp to arrival), `markers` (stamps), `names` of the last joint state.
"""

import argparse
import array
import json
import time

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image, JointState
from visualization_msgs.msg import MarkerArray

TOPIC = "/camera/depth/image_raw"
STATES = "/humans/bodies/p1/joint_states"


def seconds(stamp):
    return stamp.sec + stamp.nanosec * 1e-9


class Peer(Node):
    def __init__(self, file, topic, sensor_data, queue):
        super().__init__("peer")
        content = np.load(file)
        self.images = [array.array("B", image.tobytes()) for image in content["images"]]
        self.height, self.width = content["images"].shape[1:]
        self.k = content["k"].tolist()
        qos = qos_profile_sensor_data if sensor_data else QoSProfile(depth=queue)
        self.pictures = self.create_publisher(Image, topic, qos)
        self.infos = self.create_publisher(CameraInfo, topic.rsplit("/", 1)[0] + "/camera_info", qos)
        self.create_subscription(JointState, STATES, self.take_state, 50)
        self.create_subscription(MarkerArray, "/humans/bodies/p1/markers", self.take_markers, 50)
        self.sent, self.states, self.markers, self.names = [], [], [], []

    def is_connected(self):
        """Whether somebody listens, and publishes joint states."""
        listen = self.pictures.get_subscription_count() and self.infos.get_subscription_count()
        return listen and self.count_publishers(STATES)

    def send(self, number):
        now = time.time()
        image = Image(height=self.height, width=self.width, encoding="16UC1", step=2 * self.width)
        image.header.frame_id = "camera_optical"
        image.header.stamp.sec, image.header.stamp.nanosec = int(now), int(now % 1 * 1e9)
        image.data = self.images[number % len(self.images)]
        info = CameraInfo(header=image.header, height=self.height, width=self.width, distortion_model="plumb_bob")
        info.k = self.k
        self.infos.publish(info)
        self.pictures.publish(image)
        self.sent.append(seconds(image.header.stamp))

    def take_state(self, message):
        stamp = seconds(message.header.stamp)
        self.states.append((stamp, time.time() - stamp))
        self.names = list(message.name)

    def take_markers(self, message):
        if message.markers and message.markers[0].action == 0:
            self.markers.append(seconds(message.markers[0].header.stamp))


def main():
    options = argparse.ArgumentParser()
    options.add_argument("images")
    options.add_argument("--rate", type=float, default=30.0)
    options.add_argument("--count", type=int, default=300)
    options.add_argument("--topic", default=TOPIC)
    options.add_argument("--sensor-data", action="store_true")
    options.add_argument(
        "--queue", type=int, default=10, help="images that wait to be confirmed before they are overwritten"
    )
    options.add_argument("--wait", type=float, default=20.0, help="for somebody who listens and answers [s]")
    chosen = options.parse_args()
    rclpy.init()
    peer = Peer(chosen.images, chosen.topic, chosen.sensor_data, chosen.queue)
    executor = SingleThreadedExecutor()
    executor.add_node(peer)
    until = time.time() + chosen.wait
    while not peer.is_connected() and time.time() < until:
        executor.spin_once(timeout_sec=0.05)
    due = time.time() + 1.0  # the publisher of joint states has to discover us as well
    for number in range(chosen.count):
        while time.time() < due:
            executor.spin_once(timeout_sec=max(due - time.time(), 0.0))
        peer.send(number)
        due += 1.0 / chosen.rate
    until = time.time() + 2.0
    while time.time() < until:
        executor.spin_once(timeout_sec=0.05)
    found = {"sent": peer.sent, "states": peer.states, "markers": peer.markers, "names": peer.names}
    print(json.dumps(found), flush=True)


if __name__ == "__main__":
    main()
