"""Arguments and options of several commands."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, is_dataclass
from functools import wraps
from pathlib import Path
from typing import Annotated, Any, get_type_hints

import typer

from voodoo.cli.common import refuse_both
from voodoo.errors import VoodooError
from voodoo.names import INPUTS, OLDEST, TOPIC_KINDS, Automatic, HumanModel
from voodoo.recordings.keypoint_layouts import LAYOUTS
from voodoo.recordings.loaders import LOADERS, NUMBERS

TOPICS = (*TOPIC_KINDS, "camera_info")
"""Kinds for which a topic can be chosen."""

RecordingArgument = Annotated[
    Path,
    typer.Argument(
        metavar="RECORDING",
        help="ROS bag, Azure Kinect .mkv, UTD-MHAD *_depth.mat, folder of videos, Pose2Sim or PNGs, .trc.",
    ),
]
ConfigOption = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Settings as TOML; `voodoo config` prints all of them.")
]


def _stature(height: float | None) -> float | None:
    """Checked by the body, which names the unit."""
    if height is not None:
        from voodoo.model.body import Body

        try:
            Body.human(height)
        except VoodooError as error:
            raise typer.BadParameter(str(error)) from None
    return height


HeightOption = Annotated[
    float | None,
    typer.Option(metavar="M", callback=_stature, help="Stature of the person in meters, 0.3 to 3."),
]
AgeOption = Annotated[
    float | None,
    typer.Option(metavar="YEARS", min=1.0, max=OLDEST, help="Age of the person, where the stature is not known."),
]
InitOption = Annotated[
    str | None,
    typer.Option(
        metavar="FILE|auto",
        help="First pose as JSON, or an earlier result (.csv, .npz); auto: search for a person, even if there is a start beside "
        "the recording. By default the recording's start, except live; else auto.",
    ),
]
AutoOption = Annotated[
    Automatic | None,
    typer.Option(metavar="auto", help="auto: search for the person instead of using the recordings' starts."),
]
OnlyOption = Annotated[
    list[str] | None, typer.Option(metavar="GLOB", help="Only recordings whose name matches, e.g. 'a0?_s1_*'.")
]
ExcludeOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="X0,Y0,Z0,X1,Y1,Z1",
        help="A box in the root frame, two corners in meters, in which no person is searched for or tracked; repeatable.",
    ),
]
ModelOption = Annotated[
    HumanModel | None,
    typer.Option(
        help="The human: measured (eighteen limbs; default), full (the same, centered on their joints), or papers (ten limbs)."
    ),
]
PeopleOption = Annotated[
    str,
    typer.Option(
        metavar="any|N",
        help="Number of persons: 1 (default), the most visible person; any, or at most N, each with a persistent id.",
    ),
]
StrictOption = Annotated[
    bool,
    typer.Option(
        "--strict", help="Reject a damaged recording; by default unusable measurements are left out and counted."
    ),
]
KeypointsOption = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NETWORK|SENSOR=DIR",
        help="A network to run on color images: mediapipe[:FILE.task], rtmpose[:MODE or :DETECTOR.onnx,POSE.onnx], or "
        "MODULE:FUNCTION of yours; or OpenPose JSON files, one for each image of SENSOR; repeatable.",
    ),
]
UseOption = Annotated[
    str | None,
    typer.Option(
        metavar="KIND,...",
        help=f"Inputs to use: {', '.join(INPUTS)}. By default all; color only if no other input determines the pose.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON on stdout, and nothing else there.")]
ViewOption = Annotated[
    bool, typer.Option("--view", help="Show every step in Rerun (pip install 'voodoo-tracker[view]').")
]
RESULTS = (
    "Result: .csv, .npz, .bvh, .trc, .c3d, .mot, .sto, .glb, .mcap, .foxglove.mcap, a folder (ROS 2 bag), or - for CSV on "
    "stdout; repeatable"
)
OutOrNameOption = Annotated[list[Path] | None, typer.Option(metavar="FILE", help=f"{RESULTS}; by default NAME.csv.")]


def topics_of(words: Sequence[str] | None) -> dict[str, str | list[str]]:
    """Options of the loader from words like "depth=/front/depth/image".

    Raises:
        VoodooError: another form or kind, or several calibrations.
    """
    names: dict[str, list[str]] = {}
    for word in words or ():
        kind, _, name = word.partition("=")
        if kind not in TOPICS or not name:
            raise VoodooError(f"topic: expected KIND=NAME with one of {', '.join(TOPICS)}, found {word!r}")
        names.setdefault(kind, []).append(name)
    if len(names.get("camera_info", ())) > 1:
        raise VoodooError(f"topic: expected one camera_info, found {', '.join(names['camera_info'])}")
    return {f"{kind}_topic": found if len(found) > 1 else found[0] for kind, found in names.items()}


def numbers_of(words: Sequence[str] | None) -> dict[str, float]:
    """Options of the loader from words like "rate=30".

    Raises:
        VoodooError: another form or name.
    """
    numbers: dict[str, float] = {}
    for word in words or ():
        name, _, value = word.partition("=")
        try:
            numbers[name] = float(value if name in NUMBERS else "")
        except ValueError:
            known = ", ".join(NUMBERS)
            raise VoodooError(f"option: expected NAME=NUMBER with one of {known}, found {word!r}") from None
    return numbers


def grouped(command: Callable[..., None]) -> Callable[..., None]:
    """A command for Typer: a parameter that is a dataclass of options becomes an option for each of its fields."""
    hints = get_type_hints(command, include_extras=True)
    groups: dict[str, Any] = {name: kind for name, kind in hints.items() if is_dataclass(kind)}
    parameters = []
    for name, own in inspect.signature(command).parameters.items():
        parts = get_type_hints(groups[name], include_extras=True) if name in groups else hints
        items = fields(groups[name]) if name in groups else [own]
        parameters += [own.replace(name=one.name, default=one.default, annotation=parts[one.name]) for one in items]

    @wraps(command)
    def run(**values: Any) -> None:  # noqa: ANN401 - of the options
        for name, kind in groups.items():
            values[name] = kind(**{field.name: values.pop(field.name) for field in fields(kind)})
        command(**values)

    vars(run)["__signature__"] = inspect.Signature(parameters)
    return run


@dataclass(frozen=True)
class Reading:
    """How a recording is read."""

    topic: Annotated[
        list[str] | None,
        typer.Option(
            metavar="KIND=NAME",
            help=f"Topic of a bag with several of a kind: {', '.join(TOPICS)}; repeatable; several depth cameras are used "
            "together.",
        ),
    ] = None
    frame: Annotated[
        str | None, typer.Option(metavar="NAME", help="Root frame of the result, instead of the recording's own.")
    ] = None
    loader: Annotated[
        str | None, typer.Option(metavar="NAME", help=f"Loader instead of the detected one: {', '.join(LOADERS)}.")
    ] = None
    option: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=NUMBER",
            help="Of the loader: rate (Pose2Sim, 60 images/s; numbered images, 30), meters_per_unit "
            "(depth of bags; calibrations of Pose2Sim and videos), "
            "tf_max_age (bags, 0.5 s), unpacked_gb (bags, 2), seconds_per_unit (stamps of images); repeatable.",
        ),
    ] = None
    layout: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help=f"Layout of all keypoints: {', '.join(LAYOUTS)}; by default told by their number and the shape of the persons.",
        ),
    ] = None

    def words(self) -> dict[str, Any]:
        """Options of `open_recording`, without those that are not given.

        Raises:
            VoodooError: see `topics_of` and `numbers_of`.
        """
        given = {"loader": self.loader, "root_frame": self.frame, "layout": self.layout}
        named = {name: word for name, word in given.items() if word is not None}
        return topics_of(self.topic) | numbers_of(self.option) | named


@dataclass(frozen=True)
class Human:
    """Whom to track."""

    body: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Body to track, as TOML; `voodoo body` prints the human.")
    ] = None
    height: HeightOption = None
    age: AgeOption = None
    model: ModelOption = None

    def start(self) -> dict[str, Any]:
        """Options of `start_tracker`.

        Raises:
            typer.BadParameter: a body and the size, age or model of a human; or both size and age.
            VoodooError: a file that is wrong.
        """
        from voodoo.model.body import Body

        refuse_both("--body", self.body, **{"--height": self.height, "--age": self.age, "--model": self.model})
        refuse_both("--height", self.height, **{"--age": self.age})
        body = None if self.body is None else Body.load(self.body)
        return {"body": body, "height": self.height, "age": self.age, "model": self.model}


@dataclass(frozen=True)
class Tracking(Human):
    """Whom to track, and how."""

    init: InitOption = None
    config: ConfigOption = None
    detector: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.onnx",
            help="A network that detects persons in depth images, instead of the shipped one "
            "(pip install 'voodoo-tracker[onnx]').",
        ),
    ] = None
    people: PeopleOption = "1"
    use: UseOption = None
    depth_range: Annotated[
        str | None,
        typer.Option(
            metavar="NEAR,FAR", help="Remove depth outside these limits in meters, and flying pixels at edges."
        ),
    ] = None
    exclude: ExcludeOption = None


@dataclass(frozen=True)
class Outputs:
    """Where the poses of a live session go."""

    out: Annotated[list[Path] | None, typer.Option(metavar="FILE", help=f"{RESULTS}.")] = None
    record: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.mcap",
            help="Write inputs and results to a file for voodoo track; it contains images of people.",
        ),
    ] = None
    report: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Write rate, latency, drops and faults at the end.")
    ] = None
    to: Annotated[
        list[str] | None,
        typer.Option(
            metavar="ADDRESS",
            help="Send poses to vmc://HOST[:PORT] or ros2://, or serve them at ws://[HOST][:PORT] or "
            "foxglove://[HOST][:PORT]; repeatable (pip install 'voodoo-tracker[stream,foxglove]').",
        ),
    ] = None
    publish: Annotated[
        bool | None,
        typer.Option(
            "--publish/--no-publish",
            help="Publish transforms, joint states and markers on ROS 2; by default if a source is ros2.",
        ),
    ] = None
    view: ViewOption = False
    serve: Annotated[
        str | None,
        typer.Option(
            metavar="[HOST:]PORT", help="Show it in a browser with Rerun's web viewer; on 127.0.0.1 by default."
        ),
    ] = None
