"""Where a tracker starts: the first pose of a recording, or one that is given."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, ValidationError

from voodoo.config import Config
from voodoo.errors import VoodooError
from voodoo.model.body import Body
from voodoo.names import HumanModel
from voodoo.recordings.marker_files import MarkerMap
from voodoo.recordings.recording import Recording
from voodoo.sensors.markers import body_with_markers
from voodoo.tracker import Tracker

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


def start_tracker(
    recording: Recording,
    *,
    init: Init | None = None,
    body: Body | None = None,
    height: float | None = None,
    model: HumanModel = "full",
    config: Config | None = None,
    markers: MarkerMap | None = None,
) -> Tracker:
    """A tracker that stands in the first pose of the recording.

    Args:
        recording: gives the start when `init` is None.
        init: first pose, and stature unless `height` is given.
        body: what to track; None means the default human.
        height: stature of the default human [m]; not together with `body`.
        model: how finely that human is divided, see `Body.human`.
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
        body = Body.human(model=model) if height is None else Body.human(height=height, model=model)
    if markers is not None and markers.limbs:
        body = body_with_markers(body, markers.worn())
    for marker, site in () if markers is None else markers.sites.items():
        if site not in body.site_names:
            raise VoodooError(
                f"marker {marker}: expected one of the sites {', '.join(body.site_names)}, found {site!r}"
            )
    tracker = Tracker(body, config=config if config is not None else Config())
    tracker.reset(joints=dict(init.joints), fit_sizes=True)
    return tracker


def _first_problem(error: ValidationError) -> str:
    """The first complaint of pydantic as "key: what was expected, found what"."""
    problem = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in problem["loc"])
    found = "" if problem["type"] in ("missing", "json_invalid") else f", found {problem['input']!r:.80}"
    return f"{key}: {problem['msg']}{found}" if key else f"{problem['msg']}{found}"
