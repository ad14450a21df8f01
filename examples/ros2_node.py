"""A ROS 2 node of your own for those who have ROS: depth images in, transforms, joint states and markers out.

python ros2_node.py --ros-args -r depth:=/camera/depth/image_rect_raw
"""

import rclpy
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image, JointState
from visualization_msgs.msg import MarkerArray

try:
    from tf2_msgs.msg import TFMessage
except ImportError:  # a ROS without tf2: no transforms in, none out
    TFMessage = None

import voodoo
from voodoo.export.ros2 import cdr, instant
from voodoo.live import Faults, Follower
from voodoo.live.assembly import Assembler
from voodoo.live.clock import HostClock
from voodoo.live.ros2.feed import TF, RosFeed
from voodoo.recordings.ros_topics import CAMERA_INFO, IMAGE, info_topic

PERSON, CLOCK = "p1", HostClock()
BODY = f"/humans/bodies/{PERSON}"


class Skeletons(Node):
    """Follows one person in the depth images of the topic `depth`."""

    def __init__(self) -> None:
        super().__init__("voodoo")
        depth, faults = self.resolve_topic_name("depth"), Faults(self.get_logger().warning)
        self.feed, self.frames = RosFeed([depth], faults, CLOCK), Assembler(faults)
        self.feed.expects_transforms = TFMessage is not None
        self.follower = Follower(voodoo.Tracker(voodoo.Body.human()))
        types = {"/tf": TFMessage, f"{BODY}/joint_states": JointState, f"{BODY}/markers": MarkerArray}
        self.outputs = {name: self.create_publisher(kind, name, 10) for name, kind in types.items() if kind}
        self.on_message(depth, Image, IMAGE, qos_profile_sensor_data)
        self.on_message(info_topic(depth), CameraInfo, CAMERA_INFO, qos_profile_sensor_data)
        if TFMessage is not None:
            self.on_message("/tf", TFMessage, TF, 100)
            self.on_message(
                "/tf_static", TFMessage, TF, QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
            )

    def on_message(self, topic: str, kind: type, name: str, qos: QoSProfile | int) -> None:
        self.create_subscription(kind, topic, lambda raw: self.take(topic, name, raw), qos, raw=True)

    def take(self, topic: str, kind: str, raw: bytes) -> None:
        """A message came, as it was sent."""
        for arrival in self.feed.take(topic, kind, raw):
            self.frames.feed(arrival, CLOCK.now())
            frame = self.frames.flush(CLOCK.now())
            if frame is not None:
                step, where = self.follower.step(frame), {"root_frame": self.feed.root_frame, "person": PERSON}
                for name, message in instant(step.estimates[1], step.bodies[1], **where).items():
                    if name in self.outputs:
                        self.outputs[name].publish(cdr(message))


rclpy.init()
rclpy.spin(Skeletons())
