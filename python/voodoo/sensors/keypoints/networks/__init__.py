"""Networks that find 2-D keypoints in color images: one file for each library."""

from voodoo.sensors.keypoints.networks.network import Detect as Detect
from voodoo.sensors.keypoints.networks.network import KeypointNetwork as KeypointNetwork
from voodoo.sensors.keypoints.networks.network import network_of as network_of
