"""Passes depth images and their calibration on, and loses every Nth image: a bad network. Run with cyclonedds.

python ros_relay.py /camera/depth/image_raw /relayed/depth/image_raw --lose 5
"""

import argparse
import time

from voodoo.live.ros2.dds import Node


def main():
    options = argparse.ArgumentParser()
    options.add_argument("source")
    options.add_argument("target")
    options.add_argument("--lose", type=int, default=5)
    chosen = options.parse_args()
    node = Node()
    info, image = "sensor_msgs/msg/CameraInfo", "sensor_msgs/msg/Image"
    # A calibration goes before the image that comes with it.
    pairs = {chosen.source.rsplit("/", 1)[0] + "/camera_info": (chosen.target.rsplit("/", 1)[0] + "/camera_info", info)}
    pairs[chosen.source] = (chosen.target, image)
    targets = {name: node.advertise(*pair) for name, pair in pairs.items()}
    while not all(target.subscribers for target in targets.values()):
        time.sleep(0.05)
    while not pairs.keys() <= node.offers().keys():
        node.wait(0.05)
    received = [node.subscribe(name, node.offers()[name], depth=50) for name in pairs]
    count = 0
    while True:
        node.wait(0.1)
        for subscription in received:
            for raw in subscription.take():
                count += subscription.kind == image
                if subscription.kind == info or count % chosen.lose:
                    targets[subscription.topic].write(raw)


if __name__ == "__main__":
    main()
