"""Results for other programs (.csv and .npz are written by voodoo.export.track)."""

from voodoo.export.foxglove import write_foxglove
from voodoo.export.glb import write_glb
from voodoo.export.motion import write_bvh, write_c3d, write_mot, write_sto, write_trc
from voodoo.export.ros2 import write_bag

__all__ = ["write_bag", "write_bvh", "write_c3d", "write_foxglove", "write_glb", "write_mot", "write_sto", "write_trc"]
