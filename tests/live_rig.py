"""A live source by hand: time goes on as a test says, nothing sleeps, and every stage is called in turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import voodoo
from voodoo.live import Arrival, Follower, Live, Source
from voodoo.live.assembly import LiveFrame
from voodoo.measurements import DepthImage, RecordedFrame
from voodoo.sensors.settings import FrontEndSettings


class HandClock:
    """A clock that a test sets."""

    def __init__(self, at: float = 1_700_000_000.0) -> None:
        self.at = at

    def now(self) -> float:
        return self.at


class ByHand(Source):
    """A source whose measurements a test delivers itself."""

    name = "by hand"
    root_frame = "base_link"

    def open(self, clock, faults):
        pass

    def read(self, timeout):
        return ()

    def close(self):
        pass


class Rig:
    """Live, a follower and a clock, without threads.

    Attributes:
        messages: lines for the user.
        steps: of all frames that were tracked.
    """

    def __init__(self, follower: Follower | None = None, *, source: Source | None = None) -> None:
        self.clock, self.messages = HandClock(), []
        self.live = Live([source or ByHand()], clock=self.clock, on_message=self.messages.append)
        self.follower = follower
        self.frames: list[LiveFrame] = []
        self.steps = []

    @property
    def counts(self) -> dict[str, int]:
        return self.live.faults.counts

    def deliver(self, *arrivals: Arrival) -> None:
        """Let them arrive now, and every stage take its turn."""
        for arrival in arrivals:
            self.live.deliver(arrival)
        self.turn()

    def turn(self) -> None:
        self.live.turn(0.0)
        frame = self.live.next(0.0)
        if frame is not None:
            self.frames.append(frame)
            if self.follower is not None:
                self.steps.append(self.follower.step(frame))

    def wait(self, seconds: float, *, tick: float = 0.01) -> None:
        """Let time go by."""
        for _ in range(round(seconds / tick)):
            self.clock.at += tick
            self.turn()


def follower_of(root_frame: str = "base_link") -> Follower:
    settings = FrontEndSettings(use=("depth", "points", "scan"), ground_z=0.0 if root_frame == "base_link" else None)
    return Follower(voodoo.Tracker(voodoo.Body.human()), settings=settings)


def arrival_of(item, *, stamp: float | None = None, drives: bool = True, measure=None, **more) -> Arrival:
    """An arrival of a measurement, with another stamp if need be."""
    stamp = item.stamp if stamp is None else stamp
    moved = replace(item, stamp=stamp)
    kind = {"DepthImage": "depth", "ColorImage": "color", "LaserScan": "scan"}[type(item).__name__]
    return Arrival(item.sensor, kind, stamp, measure or (lambda: moved), drives=drives, **more)


def depth_of(recorded: RecordedFrame) -> DepthImage:
    return next(item for item in recorded.measurements if isinstance(item, DepthImage))


def wall(stamp: float, *, sensor: str = "depth", seed: int = 0) -> DepthImage:
    """A small noisy depth image of a wall."""
    camera = voodoo.Camera(32, 24, 30.0, 30.0, 15.5, 11.5)
    image = np.random.default_rng(seed or round(stamp * 1e6) % 2**32).integers(2000, 2100, (24, 32)).astype(np.uint16)
    return DepthImage(sensor, stamp, image, 0.001, camera, np.eye(4))
