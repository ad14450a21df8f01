"""The words that options, files and settings choose from: a leaf, so that the command line can list them at once."""

from __future__ import annotations

from typing import Literal, TypeAlias, get_args

HumanModel: TypeAlias = Literal["papers", "full", "measured"]
"""How finely the default human is divided, see `voodoo.Body.human`."""
TopicKind: TypeAlias = Literal["depth", "points", "scan", "color"]
TOPIC_KINDS: tuple[TopicKind, ...] = get_args(TopicKind)
"""What a bag's topics are read as, in the order of precedence: the first kind a recording has makes its frames."""
INPUTS = ("depth", "points", "scan", "keypoints", "skin", "color", "markers")
"""Kinds of measurements that a front end can use; `voodoo.sensors.adapters.register` adds others. Skin and color are two cues of
the same pictures: rays of head and hands, and the color regions of all limbs."""
SEARCHING = "searching"
"""Status of a frame without a pose: nobody was found yet, or the person is gone."""
