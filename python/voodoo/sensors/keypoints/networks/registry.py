"""The registered networks that `--keypoints` can run, and functions of the user's own."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from voodoo.errors import ConfigError
from voodoo.sensors.keypoints.networks.network import Detect, KeypointNetwork

NETWORKS = {"mediapipe": "MediaPipe", "rtmpose": "RtmPose"}
"""Name, which is that of the module here, -> class, which is made of the words after the colon."""


def network_of(word: str, *, layout: str | None = None) -> KeypointNetwork:
    """The network of a word: "NAME", "NAME:WORDS", or "MODULE:FUNCTION", which may be in the current folder.

    Args:
        word: as it was given.
        layout: of the keypoints; None: the attribute `layout` of the function.

    Raises:
        ConfigError: an unknown network, one that cannot be loaded, or no layout.
        MeasurementError: an unknown layout.
    """
    name, colon, words = word.partition(":")
    if name in NETWORKS:
        detect: Any = getattr(import_module(f"{__package__}.{name}"), NETWORKS[name])(words)
    elif colon and words:
        detect = _own(name, words)
    else:
        known = ", ".join(NETWORKS)
        raise ConfigError(f"keypoints: expected SENSOR=FOLDER, {known} or MODULE:FUNCTION, found {word!r}")
    chosen = layout or getattr(detect, "layout", None)
    if not isinstance(chosen, str):
        raise ConfigError(f"{word}: expected the layout of its keypoints, as its attribute or by --layout, found none")
    return KeypointNetwork(word, detect, chosen)


def _own(module: str, function: str) -> Detect:
    here = str(Path.cwd())
    sys.path.append(here)
    try:
        found: Any = import_module(module)
        for name in function.split("."):
            found = getattr(found, name)
    except Exception as error:
        raise ConfigError(
            f"{module}:{function}: expected a function that can be imported, found {type(error).__name__}: {error}"
        ) from error
    finally:
        sys.path.remove(here)
    if not callable(found):
        raise ConfigError(f"{module}:{function}: expected a function, found {type(found).__name__}")
    return found
