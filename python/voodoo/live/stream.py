"""Live sources as an iterator of recorded frames: capture and decoding run in parallel to the consumer of the frames."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Literal, TypeAlias

from voodoo.errors import RecordingError, VoodooError
from voodoo.live.assembly import Assembler, LiveFrame
from voodoo.live.clock import Clock, HostClock
from voodoo.live.mailbox import Inbox, Mailbox
from voodoo.live.source import Arrival, Faults, Source, SourceEnded, SourceGone
from voodoo.measurements import FloatArray
from voodoo.sensors.keypoints.networks import KeypointNetwork

Status: TypeAlias = Literal["waiting", "running", "lost", "ended"]

LOST_S = 0.3
"""A source without usable data for this time is lost; for a slow source, the limit is two and a half of its periods."""
_PERIODS = 2.5
_FIRST_S = 1.0
"""Patience after the very first frame, when the period is not known."""
_REOPEN_S = 0.5
_TICK_S = 0.05


class Live:
    """Measurements of live sources as recorded frames, always the newest one; use it in a `with` block.

    `FrontEnd` and `Tracker` take the frames like those of a recording. A frame that does not continue the previous one
    (`LiveFrame.breaks`) requires a new search, see `voodoo.live.follow.Follower`.

    Args:
        sources: images of the first one define the frames; measurements of the others join them.
        clock: host clock.
        on_message: called with a readable line for every fault.
        eager: decode color images at once, in parallel to the tracker; False: at first access.
        network: finds keypoints in color images, in parallel to the tracker; frames wait for it.

    Attributes:
        faults: faults by name.
    """

    def __init__(
        self,
        sources: Sequence[Source],
        *,
        clock: Clock | None = None,
        on_message: Callable[[str], None] | None = None,
        eager: bool = True,
        network: KeypointNetwork | None = None,
    ) -> None:
        """Nothing is opened yet; entering the `with` block does that."""
        if not sources:
            raise VoodooError("sources: expected at least one, found none")
        _check_joined(sources)
        self.sources = tuple(sources)
        self.clock: Clock = clock if clock is not None else HostClock()
        self.faults = Faults(on_message)
        self._delivered = 0
        self._network = network
        self._assembler = Assembler(self.faults, eager=eager)
        self._inbox = Inbox()
        self._frames: Mailbox[LiveFrame] = Mailbox()
        self._stop = threading.Event()
        self._threads: list[threading.Thread] = []
        # Each source has a thread.
        self._lock = threading.Lock()
        self._left = len(self.sources)
        self._error: BaseException | None = None
        self._good: float | None = None
        self._stamp: float | None = None
        self._period = _FIRST_S / _PERIODS
        self._lost = False

    # Using it

    def __enter__(self) -> Live:
        """Open the sources.

        Raises:
            VoodooError: a source cannot be used at all.
        """
        there = [self._opened(source) for source in self.sources]
        for source, is_open in zip(self.sources, there, strict=True):
            self._run(self._capture, source, is_open)
        self._run(self._decode)
        return self

    def __exit__(self, *_: object) -> None:
        """Close the sources."""
        self.close()

    def __iter__(self) -> Iterator[LiveFrame]:
        """Yield the newest frame each time, until the sources end or `stop` is called.

        Raises:
            VoodooError: a source failed, or the `with` block was not entered.
        """
        if not self._threads and not self._frames.closed:
            raise VoodooError("live sources: expected a `with` block around the loop, found none")
        while not self._frames.closed:
            if (frame := self.next(_TICK_S)) is not None:
                yield frame
        self._raise()

    def next(self, timeout: float) -> LiveFrame | None:
        """The newest frame that was not taken yet; None if none arrives within `timeout` [s].

        Raises:
            VoodooError: a source failed.
        """
        self._raise()
        return self._frames.take(timeout)

    def stop(self) -> None:
        """Accept no more measurements; iterations end."""
        self._stop.set()
        self._inbox.close()

    def close(self) -> None:
        """Stop, and close the sources."""
        self.stop()
        for thread in self._threads:
            thread.join()
        self._threads.clear()
        for source in self.sources:
            source.close()
        self._frames.close()

    # What is known

    @property
    def status(self) -> Status:
        """Whether usable measurements arrive: "lost" if there were none for LOST_S."""
        if self._frames.closed:
            return "ended"
        if self._good is None:
            return "waiting"
        return "lost" if self.lost else "running"

    @property
    def lost(self) -> bool:
        """Whether there were no usable data for LOST_S, or two and a half periods of a slow source; also true at its end."""
        return self._good is not None and self.silent > max(LOST_S, _PERIODS * self._period)

    @property
    def silent(self) -> float:
        """Seconds since the last usable measurement arrived; infinite before the first."""
        return float("inf") if self._good is None else self.clock.now() - self._good

    @property
    def root_frame(self) -> str:
        """The frame of all poses: that of the first source."""
        return self.sources[0].root_frame

    @property
    def kinds(self) -> dict[str, str]:
        """Sensor -> kind, for all arrivals, and the keypoints that the network adds."""
        kinds = dict(self._assembler.kinds)
        if self._network is not None:
            kinds |= {f"{name}/keypoints": "keypoints" for name, kind in kinds.items() if kind == "color"}
        return kinds

    @property
    def received(self) -> int:
        """Number of frame-defining measurements."""
        return self._delivered + sum(source.unusable for source in self.sources)

    @property
    def dropped(self) -> int:
        """Number of frames, or frame-defining measurements, that a newer one replaced."""
        return self._inbox.dropped + self._frames.dropped

    @property
    def refused(self) -> int:
        """Number of frame-defining measurements that could not be used; `faults` has the reasons."""
        return self._assembler.refused + sum(source.unusable for source in self.sources)

    @property
    def by_host_clock(self) -> bool:
        """Whether latencies are relative to the stamps; else to the fastest arrival, because stamps are by another clock."""
        return self._assembler.host.by_host

    def root_from(self, frame: str, stamp: float) -> FloatArray | None:
        """root_from_frame (4, 4) at a time [s]; None if no source knows it."""
        return self.sources[0].root_from(frame, stamp)

    def about(self) -> list[dict[str, Any]]:
        """Properties of the sources."""
        return [source.about() for source in self.sources]

    # The stages

    def _run(self, stage: Callable[..., None], *arguments: object) -> None:
        thread = threading.Thread(target=self._guarded, args=(stage, *arguments), daemon=True)
        self._threads.append(thread)
        thread.start()

    def _guarded(self, stage: Callable[..., None], *arguments: object) -> None:
        try:
            stage(*arguments)
        except BaseException as error:
            self._error = self._error or error
            self.stop()
            self._frames.close()

    def _raise(self) -> None:
        if self._error is not None:
            error, self._error = self._error, None
            raise error

    def _opened(self, source: Source) -> bool:
        """Open a source; returns whether it is available."""
        try:
            source.open(self.clock, self.faults)
        except SourceGone as error:
            if not source.stays:
                self.close()
                raise
            source.close()
            self.faults.log(f"{source.name}: waiting for it: {error}")
            return False
        except BaseException:
            self.close()
            raise
        return True

    def _capture(self, source: Source, is_open: bool) -> None:
        """Read a source until it ends; reopen it after it has disappeared."""
        while not self._stop.is_set():
            try:
                if not is_open:
                    source.open(self.clock, self.faults)
                    is_open = True
                    self.faults.log(f"{source.name}: it is there again")
                for arrival in source.read(_TICK_S):
                    # Images of the first source define the frames.
                    self.deliver(arrival if source is self.sources[0] else replace(arrival, drives=False))
                self._inbox.wake()  # transforms and calibrations are no arrivals, but frames wait for them
            except SourceEnded:
                break
            except SourceGone as error:
                if not source.stays:
                    raise
                if is_open:
                    self.faults.add("gone", error, self.clock.now())
                is_open = False
                source.close()
                self._stop.wait(_REOPEN_S)
        with self._lock:
            self._left -= 1
            if not self._left:
                self._inbox.close()

    def _decode(self) -> None:
        """Make frames from arrivals."""
        while not self._inbox.closed:
            self.turn(_TICK_S)
        self._hand_on(self._assembler.flush(self.clock.now()))
        self._frames.close()

    def deliver(self, arrival: Arrival) -> None:
        """Add new arrivals from a source."""
        with self._lock:
            self._delivered += arrival.drives
        self._inbox.put((arrival, self.clock.now()))

    def turn(self, timeout: float) -> None:
        """One iteration of the decoding stage, which waits for arrivals for at most `timeout` [s]."""
        assembler = self._assembler
        for arrival, at in self._inbox.take_all(min(assembler.due(self.clock.now()), timeout, _TICK_S)):
            if arrival.drives:
                self._hand_on(assembler.flush(self.clock.now()))
            assembler.feed(arrival, at)
        self._hand_on(assembler.poll(self.clock.now()))
        self._check_states()

    def _hand_on(self, frame: LiveFrame | None) -> None:
        if frame is None:
            return
        if self._network is not None:
            frame = replace(frame, measurements=self._network.added_to(frame, refused=self._refused))
        now = self.clock.now()
        if self._stamp is None:
            self._check_roots()
        elif not frame.breaks:
            self._period = frame.stamp - self._stamp
        self._stamp = frame.stamp
        if self._lost:
            self.faults.log(f"data again after {now - (self._good or now):.1f} s")
        self._good, self._lost = now, False
        self._frames.put(frame)

    def _refused(self, error: RecordingError) -> None:
        self.faults.add_error(error, self.clock.now(), "damaged picture")

    def _check_roots(self) -> None:
        roots = {source.name: source.root_frame for source in self.sources if source.root_frame}
        if len(set(roots.values())) > 1:
            frames = ", ".join(f"{name} in {root!r}" for name, root in roots.items())
            raise VoodooError(
                f"sources: expected one root frame, found {frames}; --calibration and --frame say where they are"
            )

    def _check_states(self) -> None:
        """Report that a source stalls."""
        if not self._lost and self.lost and not self._inbox.closed:
            self._lost = True
            self.faults.add("stalled", f"nothing usable for {self.silent:.1f} s: lost", self.clock.now())


def _check_joined(sources: Sequence[Source]) -> None:
    """Reject several sources that have the same name, or whose relative poses are unknown."""
    names = [source.name for source in sources]
    if len(set(names)) < len(names):
        raise VoodooError(
            f"sources: expected different ones, found {', '.join(names)}; realsense:SERIAL tells cameras apart"
        )
    lost = [source.name for source in sources if not source.placed]
    if len(sources) > 1 and lost:
        raise VoodooError(
            f"{lost[0]}: expected a calibration that says where it is beside other sources, found none (--calibration FILE, one "
            "for each source in their order)"
        )
