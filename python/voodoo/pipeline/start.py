"""Start of a tracker: a first pose that is given or comes with a recording, or a search for a person."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, TypeAlias, get_args

import numpy as np
from pydantic import ConfigDict, Field

from voodoo._core import Estimate
from voodoo.config import Config
from voodoo.detectors.base import AnyDetector
from voodoo.errors import VoodooError, a_path
from voodoo.export.skeleton import bones
from voodoo.export.table import SUFFIXES
from voodoo.export.track import Track
from voodoo.model.body import STATURE_M, Body
from voodoo.model.joint import number_of, short, valid
from voodoo.names import OLDEST, Automatic, HumanModel
from voodoo.people import People
from voodoo.pipeline.starts import Starts
from voodoo.pipeline.starts.given import EarlierStart, GivenStart
from voodoo.pipeline.starts.legs import legs_body, serves
from voodoo.recordings.marker_files import MarkerMap
from voodoo.recordings.recording import Recording
from voodoo.recordings.truth import FirstPose
from voodoo.sensors.markers import body_with_markers
from voodoo.sensors.settings import inputs_for, inputs_in
from voodoo.stored import MOST_METADATA, read_stored
from voodoo.tracker import Tracker

_AGES = (1.0, 2.0, 4.0, 8.0, 12.0, 15.0, 18.0)
_STATURES_M = (0.75, 0.87, 1.03, 1.27, 1.50, 1.65, 1.70)
"""Median stature at these ages in years, mean of girls and boys (WHO Child Growth Standards, 2006; growth reference, 2007)."""
_HEIGHT_SIGMA, _AGE_SIGMA = 0.02, 0.05
"""Relative standard deviations of a stature that is given, with shoes and hair, and of the statures of one age."""


class Init(FirstPose):
    """First pose of the body, in the first frame or at a time: any subset of named positions that determines the pose.

    Args:
        height_m: stature [m], None if unknown.
        stamp_s: the pose belongs to the first frame at or after this time [s]; None: to the first frame.
        frame: coordinate frame of the positions; None: the root frame of the recording.
        format_version: version of the file format.
        joints: site name to (x, y, z) [m].
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    format_version: Annotated[int, Field(ge=1, le=1)] = 1

    @classmethod
    def load(cls, path: Path) -> Init:
        """Read an --init file: JSON, {"height_m": 1.76, "joints": {"l_shoulder": [x, y, z], ...}}.

        Raises:
            VoodooError: not readable, not JSON, or not of that form; names the file and the key.
        """
        content = read_stored(a_path(path, error=VoodooError), "a JSON file", most=MOST_METADATA)
        with valid(path, VoodooError, most=1):
            return cls.model_validate_json(content)

    def to_json(self) -> str:
        """JSON text that `load` reads, one joint per line."""
        entries = self.model_dump(exclude={"joints"}, exclude_none=True)
        lines = [f'  "{name}": {json.dumps(value)}' for name, value in entries.items()]
        joints = [f'    "{name}": {json.dumps(place)}' for name, place in self.joints.items()]
        lines.append('  "joints": {\n' + ",\n".join(joints) + "\n  }")
        return "{\n" + ",\n".join(lines) + "\n}"

    def in_root_frame(self, recording: Recording) -> Init:
        """The same pose in the recording's root frame.

        Raises:
            RecordingError: the recording has no transform from this frame.
        """
        if self.frame in (None, recording.root_frame):
            return self
        about = recording.info()
        pose = recording.root_from(str(self.frame), about.start_stamp if self.stamp_s is None else self.stamp_s)
        return self.model_copy(update={"frame": recording.root_frame, "joints": self.moved(pose)})

    @classmethod
    def of(cls, recording: Recording) -> Init | None:
        """The start that comes with the recording, or None.

        Raises:
            VoodooError: it is not of the form above; names the recording and the key.
        """
        if recording.start is None:
            return None
        with valid(f"{recording.name}, start", VoodooError, most=1):
            return cls.model_validate(dict(recording.start))


AUTO: Automatic = "auto"
Beginning: TypeAlias = Init | Track | Automatic
"""A first pose, an earlier result that has one, or neither."""


def beginning_of(word: str | None) -> Beginning | None:
    """Read the value of --init: "auto", a JSON file (see Init.load), or a .csv or .npz of `voodoo track`.

    Raises:
        VoodooError: a file that is none of these; names it.
    """
    if word is None or word == AUTO:
        return word
    return Track.load(word) if Path(word).suffix in SUFFIXES else Init.load(Path(word))


def start_tracker(
    recording: Recording,
    *,
    init: Beginning | None = None,
    body: Body | None = None,
    height: float | None = None,
    age: float | None = None,
    model: HumanModel | None = None,
    config: Config | None = None,
    markers: MarkerMap | None = None,
    use: Sequence[str] | None = None,
    detector: AnyDetector = "shipped",
) -> Tracker:
    """A tracker for a recording: in its first pose, or without a pose, so that it searches for a person.

    Args:
        recording: provides the start if `init` is None and it comes with one.
        init: first pose, and stature unless `height` is given. A pose for a given time, an earlier result and "auto" leave the
            tracker without a pose; then pass `starts_of(init)` to `track`.
        body: body to track; None means the default human, or two legs if a laser is the only input to start from.
        height: stature of the default body [m], and of a detected person; not together with `body`.
        age: of the person in years, for the stature; not together with `body` or `height`.
        model: which human, see `Body.human`.
        config: None means the defaults.
        markers: markers worn on limbs, which become sites of the body.
        use: kinds of inputs that are used; None: all.
        detector: see `Tracker`.

    Raises:
        VoodooError: the first pose does not determine the pose of this body, two of body, height and age are given, a marker
            stands for a site that the body does not have, or there is neither a pose nor an input in which this body could be
            found.
    """
    init = init or Init.of(recording) or AUTO
    height, detector = _known_stature(body, height=height, age=age, detector=detector)
    if height is None and body is None and isinstance(init, Init):
        height = init.height_m
    # Without another input to start from: no person can be found in images of skin and color.
    legs = init == AUTO and used_kinds(recording, use) - {"skin", "color"} == {"scan"}
    tracker = Tracker(
        _body(body, height=height, model=model, markers=markers, legs=legs), config=config, detector=detector
    )
    if init == AUTO:
        check_findable(recording, tracker, use)
    if isinstance(init, Init) and init.stamp_s is None:
        tracker.reset(joints=dict(init.in_root_frame(recording).joints), fit_sizes=True)
    return tracker


def start_people(
    recording: Recording,
    *,
    limit: int | None = None,
    use: Sequence[str] | None = None,
    config: Config | None = None,
    detector: AnyDetector = "shipped",
    height: float | None = None,
    age: float | None = None,
    **body: Any,  # noqa: ANN401 - of start_tracker
) -> People:
    """A tracker of the persons in a recording, who are found as they come.

    Args:
        limit: largest number of persons, see `People`.
        use, config, detector: see `start_tracker`.
        height, age: of every person, see `start_tracker`.
        **body: body, model, markers: see `start_tracker`.

    Raises:
        VoodooError: see `start_tracker`.
    """
    height, detector = _known_stature(body.get("body"), height=height, age=age, detector=detector)
    people = People(_body(**body, height=height), config=config, detector=detector, limit=limit)
    check_findable(recording, people, use)
    return people


def _known_stature(
    body: Body | None, *, height: float | None, age: float | None, detector: AnyDetector
) -> tuple[float | None, AnyDetector]:
    """The stature that a height or an age gives, and the shipped detector for persons of that stature."""
    given = [name for name, value in (("body", body), ("height", height), ("age", age)) if value is not None]
    if len(given) > 1:
        raise VoodooError(f"body, height and age: expected at most one of them, found {' and '.join(given)}")
    if age is not None:
        if not _AGES[0] <= number_of("age", age, "years") <= OLDEST:
            raise VoodooError(f"age: expected {_AGES[0]:g} to {OLDEST:g} years, found {age}")
        height = float(np.interp(age, _AGES, _STATURES_M))
    if height is not None and detector == "shipped":
        from voodoo._core import Detector

        detector = Detector(stature=height, stature_sigma=_HEIGHT_SIGMA if age is None else _AGE_SIGMA)
    return height, detector


def _body(
    body: Body | None = None,
    *,
    height: float | None = None,
    model: HumanModel | None = None,
    markers: MarkerMap | None = None,
    legs: bool = False,
) -> Body:
    """The body to track; by default a human, or two legs."""
    if body is None:
        known = {} if height is None else {"height": height}
        body = legs_body(**known) if legs and model is None else Body.human(**known, model=model or "measured")
    if markers is not None and markers.limbs:
        body = body_with_markers(body, markers.worn())
    for marker, site in () if markers is None else markers.sites.items():
        if site not in body.site_names:
            raise VoodooError(
                f"marker {marker}: expected one of the sites {', '.join(body.site_names)}, found {short(site)}"
            )
    return body


def starts_of(init: Beginning | None, recording: Recording) -> Starts | None:
    """Sources of the first pose of a tracker without one, for `track`; None: all that the recording offers.

    Raises:
        RecordingError: the coordinate frame of the given pose is unknown.
    """
    if isinstance(init, Init) and init.stamp_s is not None:
        return Starts((GivenStart(init.in_root_frame(recording).joints, init.stamp_s),), by_tracker=False)
    return Starts((EarlierStart(init),), by_tracker=False) if isinstance(init, Track) else None


def pose_as_init(estimate: Estimate, body: Body, *, frame: str | None = None) -> Init:
    """The pose of a frame as a first pose, with its time and, for a person, the stature.

    Args:
        estimate: with a pose.
        body: the body with its current sizes.
        frame: the coordinate frame of the estimate, see Init.
    """
    common = Body.human(model="papers").site_names
    names = [name for name in body.site_names if name in common] or list(body.site_names)
    joints = {name: tuple(round(float(value), 4) for value in estimate.joints[name]) for name in names}
    about = {"height_m": stature(body), "stamp_s": float(estimate.stamp), "frame": frame}
    return Init.model_validate({**about, "joints": joints})


def stature(body: Body) -> float | None:
    """Stature [m] of a body with the limbs of a human; None for other bodies."""
    humans = [
        human for model in get_args(HumanModel) if (human := Body.human(model=model)).limb_names == body.limb_names
    ]
    if not humans:
        return None
    turns = body.core.at_rest()[0]  # models with the same limbs differ in these, which sizes hardly change
    human = min(humans, key=lambda one: float(np.abs(one.core.at_rest()[0] - turns).sum()))
    return round(STATURE_M * _upright(body) / _upright(human), 3)


def _upright(body: Body) -> float:
    """Height [m] at rest from the lowest ankle to the highest point."""
    heights = [place[2] for bone in bones(body) for place in (bone.head, bone.tip)]
    return float(max(heights) - min(heights))


def used_kinds(recording: Recording, use: Sequence[str] | None) -> set[str]:
    """Kinds of inputs that a recording has and that are used."""
    return inputs_in(recording) & set(use if use is not None else inputs_for(recording))


def check_findable(recording: Recording, tracker: Tracker | People, use: Sequence[str] | None) -> None:
    """Raise an error if no input of the recording can be used to find this body.

    Raises:
        VoodooError: names the inputs; persons who were added to `People` need not be found.
    """
    several = isinstance(tracker, People)
    if isinstance(tracker, People):
        if tracker.numbers:
            return
        tracker = Tracker(tracker.prototype, detector=tracker.detector)
    kinds, body = used_kinds(recording, use), tracker.body
    blind = {"points", "skin", "color"}
    if not tracker.can_search:
        blind.add("depth")
    if several or not serves(body):
        blind.add("scan")
    views = sum(sensor.kind == "keypoints" for sensor in recording.info().sensors)
    single = views == 1 and "keypoints" in kinds and "depth" not in kinds
    if single:
        blind.add("keypoints")
    if kinds and kinds <= blind:
        alone = f"by {', '.join(sorted(map(str, kinds)))} alone the body {body.name!r} is not found"
        alone += " (keypoints of one camera need depth beside them, or a second camera)" if single else ""
        if several:
            raise VoodooError(
                f"{recording.name}: {alone}; several people are found in depth images, keypoints and markers"
            )
        raise VoodooError(
            f"{recording.name}: expected a first pose, found none, and {alone}; give a pose with --init FILE, a JSON file like "
            '{"height_m": 1.76, "joints": {"l_shoulder": [x, y, z], "r_hip": [x, y, z], ...}} '
            f"in meters in the frame {recording.root_frame!r}"
        )
