"""Values that options, files and settings can have. This module imports nothing heavy, so that the command line starts fast."""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

Automatic: TypeAlias = Literal["auto"]
"""Requests a search, even if a first pose comes with the recording."""
OLDEST = 120.0
"""Greatest age of a person in years."""
HumanModel: TypeAlias = Literal["measured", "full", "papers"]
"""Models of the default human, see `voodoo.Body.human`."""
TopicKind: TypeAlias = Literal["depth", "points", "scan", "color"]
TOPIC_KINDS: tuple[TopicKind, ...] = get_args(TopicKind)
"""Kinds of measurements of a bag's topics, in order of precedence: the first kind that a recording has defines its frames."""
INPUTS = ("depth", "points", "scan", "keypoints", "skin", "color", "markers")
"""Kinds of measurements that a front end can use; `voodoo.sensors.adapters.register` adds others. Skin and color are two cues of
the same images: rays of head and hands, and the color regions of all limbs."""
ROS1_SUFFIXES, ROS2_SUFFIXES = (".bag",), (".mcap", ".db3")
"""Suffixes of bags."""
SEARCHING = "searching"
"""Status of a frame without a pose: no person was found yet, or the person has left."""
