"""voodoo: the 3-D pose of a person, or any articulated body, every frame, on a plain CPU, from the sensors of the robot."""

from voodoo.lazily import lazily

# Names are imported when they are first used: `voodoo --help` needs neither NumPy nor OpenCV.
__all__, __getattr__, __dir__ = lazily(__name__)
