"""Implementation of `voodoo live`: tracks and publishes until a signal. Not imported for its help."""

from __future__ import annotations

import gc
import json
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from itertools import islice
from pathlib import Path
from typing import Any

from voodoo._core import Estimate
from voodoo.cli.common import print_message
from voodoo.cli.options import Outputs
from voodoo.cli.running import ParsedTracking
from voodoo.cli.signals import deferred
from voodoo.errors import VoodooError, reason
from voodoo.export.ros2 import cdr, description, instant
from voodoo.export.spool import Spool
from voodoo.export.upright import Turn
from voodoo.live.assembly import LiveFrame
from voodoo.live.follow import Follower, Step
from voodoo.live.recorder import Recorder
from voodoo.live.session import Output, Session
from voodoo.live.sinks import sink_of
from voodoo.live.stream import Live
from voodoo.measurements import FloatArray, RecordedFrame
from voodoo.model.body import Body
from voodoo.people import ONE, PeopleEstimate
from voodoo.pipeline.start import starts_of
from voodoo.recordings import sample_path
from voodoo.recordings.loaders import open_recording
from voodoo.recordings.recording import Recording, SensorInfo
from voodoo.tracker import Tracker
from voodoo.visualization.rerun_viewer import Viewer
from voodoo.whole import write_whole

ROS2 = "ros2://"
"""Address of `--publish`."""
_TICK_S = 0.05
_LINE_S = 1.0
_TOGETHER = 30
"""Frames of files that a power cut costs at most."""
_NO_SCREEN = "--save FILE.rrd writes a file"
"""Advice in the error of `Viewer` without a screen."""
_SWITCH_S = 5e-4
"""Switch interval of Python threads: the default of 5 ms is as long as a whole step."""


def run(live: Live, start: ParsedTracking, asked: Outputs, *, duration: float | None) -> tuple[list[Path], bool, int]:
    """Track until the sources end, for `duration` [s], or until a signal; finish files and write the report.

    Returns:
        The written files, whether a signal ended the session, and the number of steps with a person.

    Raises:
        VoodooError, OSError: a source or an output failed.
    """
    warm_up()
    with _prompt_threads(), deferred() as ended, live:
        outputs = _outputs(live, asked)
        session = Session(live, lambda frame: _follower(start, FirstFrame(live, frame)), outputs=outputs)
        try:
            _check_states(session, ended, duration)
        finally:
            try:
                session.finish()
            finally:
                if asked.report is not None:
                    write_whole(asked.report, json.dumps(session.report(), indent=2) + "\n")
        print_message(f"{session.line()}; {session.published} published")
        others = [path for path in (asked.record, asked.report) if path is not None and path.exists()]
        files = [path for output in outputs if isinstance(output, FileOutput) for path in output.written]
        return [*files, *others], ended.is_set(), session.with_pose


def _check_states(session: Session, ended: threading.Event, duration: float | None) -> None:
    """Print a line every second until the end."""
    clock = session.live.clock
    began = reported = clock.now()
    while session.wait(_TICK_S) and not ended.is_set():
        now = clock.now()
        if duration is not None and now - began >= duration:
            return
        if now - reported >= _LINE_S:
            reported += _LINE_S
            print_message(session.line())


class FirstFrame(Recording):
    """A recording without frames that has the sensors of a live source, from which the start of tracking is told.

    Args:
        live: the source.
        frame: its first frame.
    """

    loader = "live"

    def __init__(self, live: Live, frame: LiveFrame) -> None:
        """Store source and frame."""
        self.name = live.sources[0].name
        self.path = Path(self.name)
        self.root_frame = live.root_frame
        self._live, self._stamps = live, [frame.stamp]

    def __len__(self) -> int:
        """No frames."""
        return 0

    def __iter__(self) -> Iterator[RecordedFrame]:
        """No frames."""
        return iter(())

    def _sensors(self) -> Iterator[SensorInfo]:
        for name, kind in self._live.kinds.items():
            yield SensorInfo.of(name, kind, self.root_frame, self._stamps, "live")

    def root_from(self, frame: str, stamp: float) -> FloatArray:
        """See Recording."""
        known = self._live.root_from(frame, stamp)
        return super().root_from(frame, stamp) if known is None else known


def _follower(start: ParsedTracking, first: FirstFrame) -> Follower:
    if start.limit != 1:
        return Follower(people=lambda: start.tracker(first), settings=start.settings(first))
    starts = starts_of(start.beginning, first)
    return Follower(start.tracker(first), settings=start.settings(first), starts=starts)


def _outputs(live: Live, asked: Outputs) -> list[Output]:
    # Addresses come first: one that is of no use leaves no file behind.
    addresses = list(asked.to or ())
    if asked.publish and ROS2 not in addresses:
        addresses.append(ROS2)
    outputs = [sink_of(address, root_frame=lambda: live.root_frame, on_message=print_message) for address in addresses]
    if asked.out:
        outputs.append(FileOutput(asked.out, root_frame=lambda: live.root_frame))
    if asked.record is not None:
        outputs.append(Recorder(asked.record, root_frame=lambda: live.root_frame))
        print_message(f"{asked.record} stores pictures of people")
    if asked.view or asked.serve is not None:
        try:
            viewer = Viewer(name=live.sources[0].name, serve=asked.serve)
        except VoodooError as error:
            raise VoodooError(str(error).replace(_NO_SCREEN, "--serve PORT shows it in a browser")) from error
        outputs.append(ShowOutput(viewer))
        if viewer.address:
            print_message(f"look at {viewer.address} in a browser")
    return outputs


def _estimate_of(step: Step) -> Estimate | PeopleEstimate:
    return step.people if step.front_end is None else step.estimates[ONE]


class FileOutput(Output):
    """Keeps poses on disk, and writes the files when the session ends; see `Spool`.

    Attributes:
        written: files that exist after `close`.
    """

    name = "files"
    waiting = 256

    def __init__(self, paths: Sequence[Path], *, root_frame: Callable[[], str]) -> None:
        """Make the folder of the poses."""
        self._spool = Spool(paths, root_frame=root_frame, together=_TOGETHER)
        self._turn: Turn | None = None
        self.written: list[Path] = []

    def publish(self, step: Step) -> None:
        """See Output."""
        self._turn = step.turn
        self._spool.add(_estimate_of(step), step.bodies)

    def close(self) -> None:
        """Write the files.

        Raises:
            VoodooError: there were no frames, or a file cannot be written; names the folder that is kept then.
        """
        self.written, failed = self._spool.write(turn=self._turn)
        if failed:
            raise VoodooError("; ".join(map(reason, failed))) from failed[0]


class ShowOutput(Output):
    """Shows steps in Rerun; a slow viewer skips steps."""

    name = "view"

    def __init__(self, viewer: Viewer) -> None:
        """Store the viewer."""
        self.viewer = viewer

    def publish(self, step: Step) -> None:
        """See Output."""
        how: dict[str, Any] = {"recorded": step.frame, "front_end": step.front_end, "seconds": step.seconds}
        self.viewer.log(_estimate_of(step), step.bodies, **how)

    def close(self) -> None:
        """See Output."""
        self.viewer.close()


@contextmanager
def _prompt_threads() -> Iterator[None]:
    """Shortens the switch interval of threads, and excludes the loaded objects from garbage collection."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(_SWITCH_S)
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
        sys.setswitchinterval(before)


def warm_up() -> None:
    """Run initialization that would delay the first frames: track some of the bundled recording and serialize the result."""
    follower = Follower(Tracker(Body.human()))
    for number, recorded in enumerate(islice(open_recording(sample_path()), 3)):
        step = follower.step(LiveFrame(recorded.stamp, recorded.measurements, number, 0.0, 0.0, False))
    messages = instant(step.estimates[ONE], step.bodies[ONE], root_frame="base_link", person="p1")
    for message in (messages | description(step.bodies[ONE], "p1")).values():
        cdr(message)
