"""Arguments and options of several commands."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from voodoo.names import INPUTS, TOPIC_KINDS, HumanModel
from voodoo.recordings.keypoint_layouts import LAYOUTS
from voodoo.recordings.loaders import LOADERS

TOPICS = (*TOPIC_KINDS, "camera_info")
"""Kinds for which a topic can be chosen."""

RecordingArgument = Annotated[
    Path,
    typer.Argument(
        metavar="RECORDING",
        help="ROS bag, Azure Kinect .mkv, UTD-MHAD *_depth.mat, folder of videos, Pose2Sim or PNGs, .trc.",
    ),
]
LoaderOption = Annotated[
    str | None,
    typer.Option("--loader", metavar="NAME", help=f"Loader instead of the detected one: {', '.join(LOADERS)}."),
]
ConfigOption = Annotated[
    Path | None, typer.Option("--config", metavar="FILE", help="Settings as TOML; `voodoo config` prints all of them.")
]
BodyOption = Annotated[
    Path | None, typer.Option("--body", metavar="FILE", help="Body to track, as TOML; `voodoo body` prints the human.")
]
HeightOption = Annotated[
    float | None,
    typer.Option("--height", metavar="M", min=0.3, max=3.0, help="Stature of the default human in meters."),
]
InitOption = Annotated[
    str | None,
    typer.Option(
        "--init",
        metavar="FILE|auto",
        help="First pose as JSON, or an earlier result (.csv, .npz); auto: search for a person, even if there is a start beside "
        "the recording. By default the recording's start; auto if it has none.",
    ),
]
DetectorOption = Annotated[
    Path | None,
    typer.Option(
        "--detector",
        metavar="FILE.onnx",
        help="A network that detects persons in depth images, instead of the shipped one (pip install 'voodoo-tracker[onnx]').",
    ),
]
ExcludeOption = Annotated[
    list[str] | None,
    typer.Option(
        "--exclude",
        metavar="X0,Y0,Z0,X1,Y1,Z1",
        help="A box in the root frame, two corners in meters, in which no person is searched for or tracked; repeatable.",
    ),
]
ModelOption = Annotated[
    HumanModel | None,
    typer.Option(
        "--model",
        help="The human: measured (eighteen limbs; default), full (the same, centered on their joints), or papers (ten limbs).",
    ),
]
PeopleOption = Annotated[
    str,
    typer.Option(
        "--people",
        metavar="any|N",
        help="Number of persons: 1 (default), the most visible person; any, or at most N, each with a persistent id.",
    ),
]
FrameOption = Annotated[
    str | None,
    typer.Option("--frame", metavar="NAME", help="Root frame of the result, instead of the recording's own."),
]
TopicOption = Annotated[
    list[str] | None,
    typer.Option(
        "--topic",
        metavar="KIND=NAME",
        help=f"Topic of a bag with several of a kind: {', '.join(TOPICS)}; repeatable; several depth cameras are used together.",
    ),
]
StrictOption = Annotated[
    bool,
    typer.Option(
        "--strict", help="Reject a damaged recording; by default unusable measurements are left out and counted."
    ),
]
BackgroundOption = Annotated[
    Path | None,
    typer.Option(
        "--background",
        metavar="DIR",
        help="Images of the empty scene, CAMERA_0.png, ..., for color; by default background/ beside the recording.",
    ),
]
NUMBERS = ("rate", "meters_per_unit", "tf_max_age", "unpacked_gb")
"""Options of loaders that are numbers."""

LoaderNumberOption = Annotated[
    list[str] | None,
    typer.Option(
        "--option",
        metavar="NAME=NUMBER",
        help="Of the loader: rate (Pose2Sim, 60 images/s; numbered images, 30), meters_per_unit "
        "(depth of bags; calibrations of Pose2Sim and videos), "
        "tf_max_age (bags, 0.5 s), unpacked_gb (bags, 2); repeatable.",
    ),
]
LayoutOption = Annotated[
    str | None,
    typer.Option(
        "--layout",
        metavar="NAME",
        help=f"Layout of all keypoints: {', '.join(LAYOUTS)}; by default told by their number and the shape of the persons.",
    ),
]
KeypointsOption = Annotated[
    list[str] | None,
    typer.Option(
        "--keypoints",
        metavar="NETWORK|SENSOR=DIR",
        help="A network to run on color images: mediapipe[:FILE.task], rtmpose[:MODE or :DETECTOR.onnx,POSE.onnx], or "
        "MODULE:FUNCTION of yours; or OpenPose JSON files, one for each image of SENSOR; repeatable.",
    ),
]
UseOption = Annotated[
    str | None,
    typer.Option(
        "--use",
        metavar="KIND,...",
        help=f"Inputs to use: {', '.join(INPUTS)}. By default all; color only if no other input determines the pose.",
    ),
]
DepthRangeOption = Annotated[
    str | None,
    typer.Option(
        "--depth-range",
        metavar="NEAR,FAR",
        help="Remove depth outside these limits in meters, and flying pixels at edges.",
    ),
]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON on stdout, and nothing else there.")]
ViewOption = Annotated[
    bool, typer.Option("--view", help="Show every step in Rerun (pip install 'voodoo-tracker[view]').")
]
UprightOption = Annotated[
    bool,
    typer.Option(
        "--upright",
        help="Put every result on the floor that is seen, else under the feet: z up, x forward, z = 0 on it.",
    ),
]
RESULTS = (
    "Result: .csv, .npz, .bvh, .trc, .c3d, .mot, .sto, .glb, .mcap, .foxglove.mcap, a folder (ROS 2 bag), or - for CSV on "
    "stdout; repeatable"
)
OutOption = Annotated[list[Path] | None, typer.Option("--out", metavar="FILE", help=f"{RESULTS}.")]
OutOrNameOption = Annotated[
    list[Path] | None, typer.Option("--out", metavar="FILE", help=f"{RESULTS}; by default NAME.csv.")
]
