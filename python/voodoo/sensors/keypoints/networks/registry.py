"""The registered networks that `--keypoints` can run, and functions of the user's own."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from voodoo.errors import ConfigError
from voodoo.sensors.keypoints.networks.network import Detect, KeypointNetwork


def _mediapipe(words: str) -> Detect:
    from voodoo.sensors.keypoints.networks.mediapipe import MediaPipe

    return MediaPipe(words)


def _rtmpose(words: str) -> Detect:
    from voodoo.sensors.keypoints.networks.rtmpose import RtmPose

    return RtmPose(words)


_networks: dict[str, Callable[[str], Detect]] = {"mediapipe": _mediapipe, "rtmpose": _rtmpose}


def register(name: str, load: Callable[[str], Detect]) -> None:
    """Register a network: `register("mine", lambda words: MyNetwork(words))`.

    Args:
        name: `--keypoints NAME` or `--keypoints NAME:WORDS`.
        load: imports and loads it; called with the words after the colon. The result has the attribute `layout`.

    Raises:
        ConfigError: the name is taken.
    """
    if name in _networks:
        raise ConfigError(f"network {name!r}: expected a new name, found one that is registered")
    _networks[name] = load


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
    if name in _networks:
        detect: Any = _networks[name](words)
    elif colon and words:
        detect = _own(name, words)
    else:
        known = ", ".join(sorted(_networks))
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
