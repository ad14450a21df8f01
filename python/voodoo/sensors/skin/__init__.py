"""Skin color as a cue for head and hands (K06 III-A)."""

from voodoo.sensors.skin.settings import SkinSettings
from voodoo.sensors.skin.tracker import SkinTracker

__all__ = ["SkinSettings", "SkinTracker"]
