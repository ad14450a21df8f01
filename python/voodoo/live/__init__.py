"""Live sources: measurements of a camera, a robot's topics, a growing folder or a replayed recording, as recorded frames."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from voodoo.live.assembly import LiveFrame as LiveFrame
from voodoo.live.follow import Follower as Follower
from voodoo.live.follow import Step as Step
from voodoo.live.source import FAULTS as FAULTS
from voodoo.live.source import Arrival as Arrival
from voodoo.live.source import Faults as Faults
from voodoo.live.source import Source as Source
from voodoo.live.source import SourceEnded as SourceEnded
from voodoo.live.source import SourceGone as SourceGone
from voodoo.live.sources.words import source_of
from voodoo.live.stream import Live as Live


def open(
    *sources: str | Path | Source,
    rate: float = 1.0,
    loop: bool = False,
    root_frame: str | None = None,
    on_message: Callable[[str], None] | None = None,
) -> Live:
    """Live sources as an iterator of recorded frames; use it in a `with` block.

    Args:
        *sources: see voodoo.live.sources.words.source_of, or a Source of your own. The first one's images make the frames.
        rate: for recordings: playback speed relative to real time.
        loop: for recordings: start again at the end.
        root_frame: for recordings and ROS 2: root frame to use instead of their own.
        on_message: called with a readable line for every fault.

    Raises:
        VoodooError: no such recording, or a library that the source needs is missing.
    """
    made = [
        source if isinstance(source, Source) else source_of(source, rate=rate, loop=loop, root_frame=root_frame)
        for source in sources
    ]
    return Live(made, on_message=on_message)
