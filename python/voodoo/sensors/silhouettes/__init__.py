"""Masks of the person in depth and color pictures, for voodoo.ik."""

from voodoo.sensors.silhouettes.color import Silhouettes, StillBackground
from voodoo.sensors.silhouettes.depth import StillScene, from_depth
from voodoo.sensors.silhouettes.masks import filled, without_specks
from voodoo.sensors.silhouettes.regions import RegionSilhouettes
from voodoo.sensors.silhouettes.surroundings import surroundings

__all__ = [
    "RegionSilhouettes",
    "Silhouettes",
    "StillBackground",
    "StillScene",
    "filled",
    "from_depth",
    "surroundings",
    "without_specks",
]
