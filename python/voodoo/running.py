"""From a recording to estimates: the one loop that the command line, the demo and the evaluation run."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

import voodoo
from voodoo.errors import VoodooError
from voodoo.markers import body_with_markers
from voodoo.recordings import RecordedFrame, Recording
from voodoo.recordings.marker_files import MarkerMap
from voodoo.sensors.front_end import FrontEnd, FrontEndSettings, paired

HumanModel = Literal["papers", "full"]
Height = Annotated[FiniteFloat, Field(gt=0.3, lt=3.0)]
Position = tuple[FiniteFloat, FiniteFloat, FiniteFloat]


class Init(BaseModel):
    """Where the body is in the first frame: any subset of named positions that fixes the pose.

    Args:
        height_m: stature [m], None if unknown.
        joints: site name to (x, y, z) [m] in the recording's root frame.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    height_m: Height | None = None
    joints: Annotated[dict[str, Position], Field(min_length=1)]

    @classmethod
    def load(cls, path: Path) -> Init:
        """Read an --init file: JSON, {"height_m": 1.76, "joints": {"l_shoulder": [x, y, z], ...}}.

        Raises:
            VoodooError: not readable, not JSON, or not of that form; names the file and the key.
        """
        try:
            content = path.read_bytes()
        except OSError as error:
            raise VoodooError(f"{path}: expected a readable JSON file, found {error.strerror or error}") from error
        try:
            return cls.model_validate_json(content)
        except ValidationError as error:
            raise VoodooError(f"{path}: {_first_problem(error)}") from error

    @classmethod
    def of(cls, recording: Recording) -> Init | None:
        """The start that comes with the recording, or None.

        Raises:
            VoodooError: it is not of the form above; names the recording and the key.
        """
        if recording.start is None:
            return None
        try:
            return cls.model_validate(dict(recording.start))
        except ValidationError as error:
            raise VoodooError(f"{recording.name}, start: {_first_problem(error)}") from error


@dataclass(frozen=True)
class TrackedFrame:
    """One frame with what the tracker made of it.

    Args:
        index: number in the recording, from 0.
        recorded: the measurements.
        estimate: the pose.
        seconds: wall-clock time from measurements in memory to the estimate [s]; pictures are decoded within it.
        front_end: what made the tracker's frame of them: its rays and skin candidates are those of this frame.
    """

    index: int
    recorded: RecordedFrame
    estimate: voodoo.Estimate
    seconds: float
    front_end: FrontEnd


def start_tracker(
    recording: Recording,
    *,
    init: Init | None = None,
    body: voodoo.Body | None = None,
    height: float | None = None,
    model: HumanModel = "full",
    config: voodoo.Config | None = None,
    markers: MarkerMap | None = None,
) -> voodoo.Tracker:
    """A tracker that stands in the first pose of the recording.

    Args:
        recording: gives the start when `init` is None.
        init: first pose, and stature unless `height` is given.
        body: what to track; None means the default human.
        height: stature of the default human [m]; not together with `body`.
        model: how finely that human is divided, see `voodoo.Body.human`.
        config: None means the defaults.
        markers: those worn on limbs become sites of the body.

    Raises:
        VoodooError: there is no first pose, it does not fix the pose of this body, both body and height are given, or a
            marker stands for a site that the body has not.
    """
    if body is not None and height is not None:
        raise VoodooError("body and height: expected at most one of them, found both")
    init = init or Init.of(recording)
    if init is None:
        raise VoodooError(
            f"{recording.name}: expected a first pose, found none in the recording; give one with --init FILE, a JSON "
            'file like {"height_m": 1.76, "joints": {"l_shoulder": [x, y, z], "r_hip": [x, y, z], ...}} '
            f"in metres in the frame {recording.root_frame!r}"
        )
    if body is None:
        height = height if height is not None else init.height_m
        body = voodoo.Body.human(model=model) if height is None else voodoo.Body.human(height=height, model=model)
    if markers is not None and markers.limbs:
        body = body_with_markers(body, markers.worn())
    for marker, site in () if markers is None else markers.sites.items():
        if site not in body.site_names:
            raise VoodooError(
                f"marker {marker}: expected one of the sites {', '.join(body.site_names)}, found {site!r}"
            )
    tracker = voodoo.Tracker(body, config=config if config is not None else voodoo.Config())
    tracker.reset(joints=dict(init.joints), fit_sizes=True)
    return tracker


def track(
    recording: Recording, tracker: voodoo.Tracker, *, settings: FrontEndSettings | None = None
) -> Iterator[TrackedFrame]:
    """Step the tracker through a recording, by the front end that every command uses.

    Between two yields `tracker` holds the model of the frame yielded last.

    Args:
        recording: read while iterating.
        tracker: already reset to the first pose, see start_tracker.
        settings: what is used and how; None means all there is, see FrontEndSettings.of.

    Raises:
        VoodooError: damage in the recording, or a frame that the tracker refuses; names the frame.
    """
    front_end = FrontEnd(tracker, settings=settings or FrontEndSettings.of(recording))
    for index, recorded in enumerate(paired(recording)):
        began = time.perf_counter()
        try:
            estimate = front_end.step(recorded)
        except VoodooError as error:
            raise VoodooError(f"{recording.name}, frame {index} (stamp {recorded.stamp:.6f} s): {error}") from error
        yield TrackedFrame(index, recorded, estimate, time.perf_counter() - began, front_end)


def _first_problem(error: ValidationError) -> str:
    """The first complaint of pydantic as "key: what was expected, found what"."""
    problem = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in problem["loc"])
    found = "" if problem["type"] in ("missing", "json_invalid") else f", found {problem['input']!r:.80}"
    return f"{key}: {problem['msg']}{found}" if key else f"{problem['msg']}{found}"
