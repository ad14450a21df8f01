"""Results for other programs: BVH, TRC and ROS 2 bags (.csv and .npz are written by voodoo.export.track)."""

from voodoo.export.bvh import write_bvh
from voodoo.export.ros2 import write_bag
from voodoo.export.trc import write_trc

__all__ = ["write_bag", "write_bvh", "write_trc"]
