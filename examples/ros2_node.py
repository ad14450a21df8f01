"""A ROS 2 node of your own: depth images in, transforms, joint states and markers out. For those who have ROS.

    ros2 run ...    or    python ros2_node.py --ros-args -r depth:=/camera/depth/image_rect_raw

Without ROS `voodoo live ros2:TOPIC` does the same.
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
from voodoo.live.ros2.feed import CAMERA_INFO, IMAGE, TF, RosFeed

PERSON, BODY = "1", "/humans/bodies/body_1"


class Skeletons(Node):
    """Follows one person in the depth images of the topic `depth`."""

    def __init__(self) -> None:
        super().__init__("voodoo")
        depth = self.resolve_topic_name("depth")
        faults = Faults(self.get_logger().warning)
        self.feed, self.frames = RosFeed([depth], faults, HostClock()), Assembler(faults)
        self.feed.expects_transforms = TFMessage is not None
        self.follower = Follower(voodoo.Tracker(voodoo.Body.human(model="measured")))
        types = {f"{BODY}/joint_states": JointState, f"{BODY}/markers": MarkerArray}
        latched = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
        heard = [(depth, Image, IMAGE, qos_profile_sensor_data)]
        heard += [(self.feed.info_topic(depth), CameraInfo, CAMERA_INFO, qos_profile_sensor_data)]
        if TFMessage is not None:
            types["/tf"] = TFMessage
            heard += [("/tf", TFMessage, TF, 100), ("/tf_static", TFMessage, TF, latched)]
        self.outputs = {topic: self.create_publisher(kind, topic, 10) for topic, kind in types.items()}
        for topic, kind, name, qos in heard:
            take = lambda raw, topic=topic, name=name: self.take(topic, name, raw)  # noqa: E731
            self.create_subscription(kind, topic, take, qos, raw=True)

    def take(self, topic: str, kind: str, raw: bytes) -> None:
        """A message came, as it was sent."""
        now = self.get_clock().now().nanoseconds * 1e-9
        for arrival in self.feed.take(topic, kind, raw):
            self.frames.feed(arrival, now)
            frame = self.frames.flush(now)
            if frame is not None:
                step = self.follower.step(frame)
                where = {"root_frame": self.feed.root_frame, "person": PERSON, "topic": BODY}
                for name, message in instant(step.estimates[1], step.bodies[1], **where).items():
                    if name in self.outputs:
                        self.outputs[name].publish(cdr(message))


if __name__ == "__main__":
    rclpy.init()
    rclpy.spin(Skeletons())
