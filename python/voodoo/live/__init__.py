"""Live sources: measurements of a camera, a robot's topics, a growing folder or a replayed recording, as recorded frames."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import zip_longest
from pathlib import Path
from typing import Any

from voodoo.errors import VoodooError
from voodoo.live.assembly import LiveFrame as LiveFrame
from voodoo.live.follow import Follower as Follower
from voodoo.live.follow import Step as Step
from voodoo.live.source import FAULTS as FAULTS
from voodoo.live.source import Arrival as Arrival
from voodoo.live.source import Faults as Faults
from voodoo.live.source import Source as Source
from voodoo.live.source import SourceEnded as SourceEnded
from voodoo.live.source import SourceGone as SourceGone
from voodoo.live.sources.words import options_for, source_of
from voodoo.live.stream import Live as Live
from voodoo.sensors.keypoints.networks import KeypointNetwork


def open(
    *sources: str | Path | Source,
    rate: float = 1.0,
    loop: bool = False,
    root_frame: str | None = None,
    on_message: Callable[[str], None] | None = None,
    calibrations: Sequence[Path] = (),
    options: Mapping[str, Any] | None = None,
    eager: bool = True,
    network: KeypointNetwork | None = None,
) -> Live:
    """Live sources as an iterator of recorded frames; use it in a `with` block.

    Args:
        *sources: see voodoo.live.sources.words.source_of, or a Source of your own. The first one's images make the frames.
        rate: for recordings: playback speed relative to real time.
        loop: for recordings: start again at the end.
        root_frame: for recordings and ROS 2: root frame to use instead of their own.
        on_message: called with a readable line for every fault.
        calibrations: files for the first sources, in their order, see source_of.
        options: of loaders; each source gets those that it can use.
        eager, network: see Live.

    Raises:
        VoodooError: no such recording, more calibrations than sources, or a library that a source needs is missing.
    """
    if len(calibrations) > len(sources):
        raise VoodooError(f"calibration: expected one for each source at most, found {len(calibrations)}")
    how: dict[str, Any] = {"rate": rate, "loop": loop, "root_frame": root_frame}
    made = [
        source
        if isinstance(source, Source)
        else source_of(source, options=options_for(str(source), options or {}), calibration=place, **how)
        for source, place in zip_longest(sources, calibrations)
    ]
    return Live(made, on_message=on_message, eager=eager, network=network)
