"""How people move: the table `crates/voodoo-core/src/body/pose_statistics.rs`, from motion capture.

    python -m lab.training.pose_prior ../shared/data/mocap crates/voodoo-core/src/body/pose_statistics.rs

Joint turns are rotation vectors as the core has them (the human of `body/human.rs`; x is flexion): their mean and the inverse of
their covariance, a pose and its mirror image counted alike. Prints how well hidden joints are told by the others in clips that
were left out.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from lab.training.poses import FORE, SHANK, THIGH, UPPER, Pose, load
from lab.training.rotations import Array, frame, shortest, unit, vector

JOINTS = {
    "vl3": 3, "l_shoulder": 3, "l_elbow": 1, "r_shoulder": 3, "r_elbow": 1,
    "l_hip": 3, "l_knee": 1, "r_hip": 3, "r_knee": 1,
}  # fmt: skip
"""Joint -> number of its components; hinges have one."""
STARTS = dict(zip(JOINTS, np.cumsum([0, *JOINTS.values()]).tolist(), strict=False))
SIZE = sum(JOINTS.values())
BENT = 0.3
"""A limb bent by less (sine) does not tell how the one above it is twisted."""
LEAST_SIGMA = 0.14
"""Standard deviation added to every component, radians: bodies differ, and markers slip."""
OBSERVED_SIGMA = 0.1
"""That of a joint that shows, radians, where it is measured how well it tells others."""
HEADER = """//! How people move, in numbers: made by `python -m lab.training.pose_prior`, not to be edited.
//!
//! The data used in this project was obtained from mocap.cs.cmu.edu. The database was created with funding from NSF EIA-0196217.

"""


def columns(joint: str) -> slice:
    """Where the components of a joint are."""
    return slice(STARTS[joint], STARTS[joint] + JOINTS[joint])


def turns(poses: list[Pose]) -> Array:
    """Joint turns (N, 19) in radians."""
    found = np.zeros((len(poses), SIZE))
    y, z = np.eye(3)[1:]
    for row, pose in zip(found, poses, strict=True):
        row[columns("vl3")] = in_joint(pose.pelvis.T @ pose.chest, y, z)
    for side, prefix in enumerate("lr"):
        collar = [pose.chest @ pose.clavicle[side] for pose in poses]
        found[:, STARTS[f"{prefix}_shoulder"] : STARTS[f"{prefix}_elbow"] + 1] = two_bones(
            collar, np.stack([pose.limbs[side, [UPPER, FORE]] for pose in poses]), -y
        )
        pelvis = [pose.pelvis for pose in poses]
        found[:, STARTS[f"{prefix}_hip"] : STARTS[f"{prefix}_knee"] + 1] = two_bones(
            pelvis, np.stack([pose.limbs[side, [THIGH, SHANK]] for pose in poses]), y
        )
    return found


def in_joint(turn: Array, flexion: Array, along: Array) -> Array:
    """The rotation vector of a turn in the axes of a joint."""
    return vector(turn) @ np.stack([flexion, np.cross(along, flexion), along], 1)


def two_bones(carriers: list[Array], directions: Array, hinge: Array) -> Array:
    """Turns of a ball joint and of the hinge behind it (N, 4): directions (N, 2, 3), `hinge` the axis of the bend at rest.

    Of a straight limb the twist is that of bent ones alike.
    """
    y, z = np.eye(3)[1:]
    local = np.stack([pair @ carrier for pair, carrier in zip(directions, carriers, strict=True)])
    upper, lower = local[:, 0], local[:, 1]
    axis = np.cross(upper, lower)
    sine = np.linalg.norm(axis, axis=1)
    bend = np.arctan2(sine, (upper * lower).sum(1))
    swings = np.stack([shortest(-z, direction) for direction in upper])
    first = swings @ hinge
    twist = np.arctan2((np.cross(first, unit(axis)) * upper).sum(1), (first * axis).sum(1))
    features = np.c_[np.ones(len(bend)), [vector(swing) for swing in swings], bend]
    bent = sine > BENT
    weights = np.linalg.lstsq(features[bent], twist[bent], rcond=None)[0]
    twist = np.where(bent, twist, features @ weights)
    second = np.cross(upper, first)
    axis = np.cos(twist)[:, None] * first + np.sin(twist)[:, None] * second
    whole = frame(upper, axis) @ frame(-z, hinge).T
    return np.c_[[in_joint(turn, -y, -z) for turn in whole], bend]


def mirrored(found: Array) -> Array:
    """The turns of mirrored poses."""
    out = np.empty_like(found)
    for joint, count in JOINTS.items():
        other = {"l": "r", "r": "l"}.get(joint[0], joint[0]) + joint[1:]
        out[:, columns(other)] = found[:, columns(joint)] * [1.0, -1.0, -1.0][:count]
    return out


def statistics(found: Array) -> tuple[Array, Array]:
    """Mean (19) and the inverse of the covariance (19, 19)."""
    both = np.concatenate([found, mirrored(found)])
    covariance: Array = np.cov(both.T) + LEAST_SIGMA**2 * np.eye(SIZE)
    return both.mean(0), np.asarray(np.linalg.inv(covariance), dtype=np.float64)


def message(found: Array, mean: Array, precision: Array, hidden: list[str]) -> Array:
    """Turns in which those of the hidden joints are what the others tell."""
    observed = np.full(SIZE, OBSERVED_SIGMA**-2)
    for joint in hidden:
        observed[columns(joint)] = 0.0
    off = np.linalg.solve(precision + np.diag(observed), ((found - mean) * observed).T).T
    return np.where(observed > 0, found, mean + off)


def written(mean: Array, precision: Array) -> str:
    """The table as Rust."""

    def numbers(values: list[float]) -> str:
        rows = [", ".join(literal(value) for value in values[at : at + 10]) for at in range(0, len(values), 10)]
        return "[\n" + "".join(f"    {row},\n" for row in rows) + "];\n"

    lower = [float(precision[i, j]) for i in range(SIZE) for j in range(i + 1)]
    return (
        f"{HEADER}/// Mean of every component, radians.\n#[rustfmt::skip]\n"
        f"pub(super) const MEAN: [f64; {SIZE}] = {numbers(mean.tolist())}\n"
        "/// Inverse of their covariance, row by row up to the diagonal, 1/rad^2.\n#[rustfmt::skip]\n"
        f"pub(super) const PRECISION: [f64; {len(lower)}] = {numbers(lower)}"
    )


def literal(value: float) -> str:
    """Four digits, never an integer, and no negative zero: which it is hangs on the processor."""
    text = f"{round(value, 5) + 0.0:.4g}"
    return text if "." in text or "e" in text else text + ".0"


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("mocap", type=Path, help="the folder with poses.npz and sequences.npz")
    parser.add_argument("table", type=Path, help="the Rust file to write")
    asked = parser.parse_args()
    mean, precision = statistics(turns(load(asked.mocap, held_out=False)))
    asked.table.write_text(written(mean, precision), encoding="utf-8")
    left_out = turns(load(asked.mocap, held_out=True))
    print("| hidden | by the mean, degrees | by the others |\n|---|---|---|")
    for hidden in (["l_shoulder", "l_elbow"], ["l_elbow"], ["l_hip", "l_knee"], ["l_knee"], ["vl3"]):
        at = np.r_[tuple(columns(joint) for joint in hidden)]
        off = left_out - message(left_out, mean, precision, hidden)
        errors = [np.degrees(np.sqrt((d[:, at] ** 2).sum(1).mean())) for d in (left_out - mean, off)]
        print(f"| {', '.join(hidden)} | {errors[0]:.0f} | {errors[1]:.0f} |")


if __name__ == "__main__":
    main()
