"""Live session: tracking and publishing are separate stages, and late items are dropped."""

from __future__ import annotations

import threading
import time
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from voodoo.errors import VoodooError, reason
from voodoo.live.assembly import LiveFrame
from voodoo.live.follow import Follower, Step, Upright
from voodoo.live.latencies import Latencies
from voodoo.live.mailbox import Mailbox
from voodoo.live.stream import Live
from voodoo.measurements import FloatArray
from voodoo.pipeline.run import decodable

_RATE_S = 2.0
LATE_S = 1.0
"""A receiver that holds a pose up for this long is named."""
_BACK_S = 1.0
"""A receiver that takes every pose for this long is back."""
HANGS = "takes nothing; it gets the newest pose when it does"
_CLOSE_S = 3.0
"""How long the end waits for receivers."""


class Output(ABC):
    """A receiver of poses. It is called from a thread of its own, or one after the other from that of all who never wait.

    Attributes:
        name: name in messages.
        waiting: queue capacity in steps; when it is exceeded, the oldest is dropped and counted.
        receiver: it sends to programs that may be slow, hang or be gone: the session names that once, neither waits for it nor
            ends with it, and goes on when it takes poses again.
        waits: its `publish` may wait for somebody. Latency is measured until all who never wait have taken the pose; others
            may lag behind.
        on_reset: lets everybody be searched for again; set by the session.
        on_choice: lets only the person at a place be followed, see `Session.choose`; set by the session.
    """

    name: str
    waiting: int = 1
    receiver: bool = False
    waits: bool = True
    on_reset: Callable[[], None] | None = None
    on_choice: Callable[[str, FloatArray], None] | None = None

    @abstractmethod
    def publish(self, step: Step) -> None:
        """Receive a step.

        Raises:
            VoodooError, OSError: it failed; the session ends, except with an OSError of a receiver.
        """

    def close(self) -> None:  # noqa: B027 - most have nothing to finish
        """Finish files."""


class _Lane:
    """Outputs with a queue and a thread."""

    def __init__(
        self, outputs: Sequence[Output], on_message: Callable[[str], None], done: Callable[[Step], None] | None = None
    ) -> None:
        self.outputs = outputs
        self.box: Mailbox[Step] = Mailbox(max((output.waiting for output in outputs), default=1))
        self.error: BaseException | None = None
        self._done, self._on_message = done, on_message
        self._busy: tuple[Output, float] | None = None
        self._named: dict[Output, float] = {}
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        try:
            while not self.box.closed:
                step = self.box.take()
                if step is None:
                    continue
                for output in self.outputs:
                    self._publish(output, step)
                if self._done is not None:
                    self._done(step)
        except BaseException as error:
            self.error = error
        self._ended.wait()
        for output in self.outputs:
            try:
                output.close()
            except Exception as error:
                self.error = _together([self.error, error])

    def _publish(self, output: Output, step: Step) -> None:
        self._busy = output, time.monotonic()
        try:
            output.publish(step)
        except OSError as error:
            if not output.receiver:
                raise
            self._name(output, f"nobody receives: {error.strerror or error}")
        finally:
            self.check_late()
            self._busy = None
        if output in self._named and time.monotonic() - self._named[output] > _BACK_S:
            del self._named[output]
            self._on_message(f"{output.name}: receives again")

    def _name(self, output: Output, problem: str) -> None:
        if output not in self._named:
            self._on_message(f"{output.name}: {problem}")
        self._named[output] = time.monotonic()

    def check_late(self) -> None:
        """Name a receiver that holds a pose up."""
        output, began = self._busy or (None, 0.0)
        if output is not None and output.receiver and time.monotonic() - began > LATE_S:
            self._name(output, HANGS)

    def finish(self) -> None:
        """Process the waiting steps and close the outputs."""
        self.box.close()
        self._ended.set()
        patient = not self.outputs or not all(output.receiver for output in self.outputs)
        self._thread.join(None if patient else _CLOSE_S)
        if self._thread.is_alive():
            self._on_message(f"{', '.join(output.name for output in self.outputs)}: did not take the last pose")


class Session:
    """Tracks persons in live measurements and publishes the poses.

    Args:
        live: live sources; the caller enters the `with` block.
        follower: makes a Follower from the first frame.
        outputs: receivers of the poses.

    Attributes:
        latency: time from measurement to published pose.
        tracking: duration of a step of the tracker.
        tracked: number of steps with a person.
        published: number of published steps.
        with_pose: number of published steps with a person.
    """

    def __init__(
        self, live: Live, follower: Callable[[LiveFrame], Follower], *, outputs: Sequence[Output] = ()
    ) -> None:
        """Start the stages."""
        self.live = live
        self.latency, self.tracking = Latencies(), Latencies()
        self.tracked = self.published = self.with_pose = self.refused = 0
        self._make, self._upright = follower, Upright(live)
        self._is_reset = threading.Event()
        self._choices: deque[tuple[str, FloatArray]] = deque(maxlen=1)
        for output in outputs:
            output.on_reset, output.on_choice = self.reset, self.choose
        self._last: Step | None = None
        self._times: deque[float] = deque(maxlen=512)
        self._began = live.clock.now()
        self._first: float | None = None
        self._error: BaseException | None = None
        log = live.faults.log
        self._swift = _Lane([output for output in outputs if not output.waits], log, self._count)
        self._lanes = [self._swift, *(_Lane([output], log) for output in outputs if output.waits)]
        self._thread = threading.Thread(target=self._track, daemon=True)
        self._thread.start()

    def _track(self) -> None:
        follower: Follower | None = None
        try:
            for frame in self.live:
                if follower is None:
                    follower = self._make(frame)
                if self._is_reset.is_set():
                    self._is_reset.clear()
                    follower.restart(back=True, gone=True)
                    self.live.faults.log("reset: everybody is looked for again")
                if self._choices:
                    self._choose(follower, frame, *self._choices.popleft())
                step = self._step(follower, frame)
                if step is not None:
                    self.tracking.add(step.seconds)
                    self.tracked += step.with_pose
                    step = replace(step, turn=self._upright.of(step))
                    for lane in self._lanes:
                        lane.box.put(step)
        except BaseException as error:
            self._error = error
            self.live.stop()

    def _choose(self, follower: Follower, frame: LiveFrame, name: str, place: FloatArray) -> None:
        try:
            here = name in ("", self.live.root_frame)
            pose = np.eye(4) if here else self.live.root_from(name, frame.stamp)
            if pose is None:
                raise VoodooError(f"expected a frame that is known, found {name!r}")
            self.live.faults.log(f"follow: {follower.choose(frame, pose[:3, :3] @ place + pose[:3, 3])}")
        except VoodooError as error:
            self.live.faults.log(f"follow: {error}")

    def _step(self, follower: Follower, frame: LiveFrame) -> Step | None:
        faults, clock = self.live.faults, self.live.clock
        try:
            return follower.step(frame)
        except VoodooError as error:
            kept, damaged = decodable(frame.measurements)
            for problem in damaged:
                faults.add_error(problem, clock.now(), "damaged picture")
            if damaged:
                return self._step(follower, replace(frame, measurements=kept))
            faults.add_error(error, clock.now(), "refused")
            self.refused += 1
            return None

    def _count(self, step: Step) -> None:
        now = self.live.clock.now()
        self.latency.add(now - step.frame.taken)
        self.published += 1
        self.with_pose += step.with_pose
        self._times.append(now)
        self._first = now if self._first is None else self._first
        self._last = step

    def reset(self) -> None:
        """Forget everybody before the next frame, and search again."""
        self._is_reset.set()

    def choose(self, frame: str, place: FloatArray) -> None:
        """Follow only the person at a place (3,) [m] in a frame ("": the root frame) from the next frame on."""
        self._choices.append((frame, place))

    # What is known

    def wait(self, seconds: float) -> bool:
        """Wait for this long [s], or until the session ends; returns whether it is still running.

        Raises:
            VoodooError, OSError: a source or an output that failed.
        """
        self._thread.join(seconds)
        for lane in self._lanes:
            lane.check_late()
        self._raise()
        return self._thread.is_alive()

    def _raise(self) -> None:
        error = _together([self._error, *(lane.error for lane in self._lanes)])
        if error is not None:
            self.live.stop()
            raise error

    def finish(self) -> None:
        """Stop, publish all pending steps, and finish files.

        Raises:
            VoodooError, OSError: a source or an output that failed.
        """
        self.live.stop()
        self._thread.join()
        for lane in self._lanes:
            lane.finish()
        self._raise()

    @property
    def dropped(self) -> int:
        """Number of frames that a newer one replaced before they were published, in any stage."""
        return self.live.dropped + self._swift.box.dropped

    def persons(self) -> dict[int, str]:
        """Status of each person present; "lost" for all if the source is lost."""
        if self._last is None:
            return {}
        lost = self.live.lost
        return {number: "lost" if lost else str(one.status) for number, one in self._last.estimates.items()}

    @property
    def rate_hz(self) -> float:
        """Published poses per second over the last two seconds."""
        now = self.live.clock.now()
        return sum(at > now - _RATE_S for at in tuple(self._times)) / min(max(now - self._began, 0.1), _RATE_S)

    def line(self) -> str:
        """Readable line with rate, latency, drops and the status of each person."""
        persons = ", ".join(f"{number} {word}" for number, word in self.persons().items()) or "nobody"
        status = self.live.status
        if status == "waiting" or not self.published:
            return "waiting for data" if status == "waiting" else f"no pose yet; {self.dropped} dropped"
        parts = [
            f"{self.rate_hz:.1f} Hz",
            f"latency {1e3 * self.latency.last:.1f} ms (median {1e3 * self.latency.percentile(50):.1f})",
            f"{self.dropped} dropped",
            persons if not self.live.lost else f"source lost for {self.live.silent:.1f} s: {persons}",
        ]
        if len(self.live.faults):
            parts.append(f"{len(self.live.faults)} faults")
        return "; ".join(parts)

    def report(self) -> dict[str, Any]:
        """Summary of the session for a JSON file."""
        span = self._times[-1] - self._first if self._first is not None else 0.0
        rate = (self.published - 1) / span if self.published > 1 and span > 0.0 else 0.0
        return {
            "rate_hz": rate,
            "latency_ms": _milliseconds(self.latency),
            "latency_from": self.latency_from,
            "tracking_ms": _milliseconds(self.tracking),
            "received": self.live.received,
            "processed": self.tracking.count,
            "tracked": self.tracked,
            "published": self.published,
            "with_pose": self.with_pose,
            "dropped": self.dropped,
            "refused": self.live.refused + self.refused,
            "faults": dict(sorted(self.live.faults.counts.items())),
            "first_faults": dict(sorted(self.live.faults.first.items())),
            "late_outputs": {output.name: lane.box.dropped for lane in self._lanes for output in lane.outputs},
            "seconds": self.live.clock.now() - self._began,
            "status": self.live.status,
            "sources": self.live.about(),
            "time": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
        }

    @property
    def latency_from(self) -> str:
        """Reference time of the latencies."""
        if any(source.get("kind") == "recording" for source in self.live.about()):
            return "when the frame was due"
        return "the stamp" if self.live.by_host_clock else "the fastest arrival: stamps are by another clock"


def _together(errors: Sequence[BaseException | None]) -> BaseException | None:
    """The only error, or one that tells all of them; None without any."""
    found = [error for error in errors if error is not None]
    expected = [error for error in found if isinstance(error, Exception)]
    if len(found) < 2 or len(expected) < len(found):
        return next((error for error in found if error not in expected), next(iter(found), None))
    return VoodooError("; ".join(map(reason, expected)))


def _milliseconds(latencies: Latencies) -> dict[str, float | None]:
    values = {"p50": latencies.percentile(50), "p99": latencies.percentile(99), "max": latencies.largest}
    return {name: None if value != value else round(1e3 * value, 3) for name, value in values.items()}
