"""Networks that find 2-D keypoints in color images: one file for each library."""

from voodoo.sensors.keypoints.networks.network import Detect, KeypointNetwork, network_of

__all__ = ["Detect", "KeypointNetwork", "network_of"]
