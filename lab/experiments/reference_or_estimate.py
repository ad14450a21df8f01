"""Which of two explains the depth: the limbs of the estimate that are off by 10 cm, or the reference that says so.

    python lab/experiments/reference_or_estimate.py ../shared/data/utd-mhad/Depth/a7_s*_depth.mat

A reference skeleton is itself wrong at times. For every elbow, wrist, knee and ankle farther than 10 cm from it (at the best
lag) the limb is put between the joints of the estimate and between those of the reference, and the depth image is asked at 25
places on each: seen there and explained by no other arm, leg or trunk, less seen past, weighted with the distance from the upper
joint, as the tracker does itself. With exact truth as reference the estimate should hardly ever win.

Bones of a reference skeleton change their length: `--bones 0.1` leaves out arms and legs of which one of the reference's bones is
more than a tenth longer or shorter than in the start that the tracker was given, `--consistent` what contradicts itself, as
`voodoo eval` does. `--whole` asks both limbs of an arm or leg, `--offsets` takes each joint's constant offset off.
"""

import argparse
import itertools
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import voodoo
from voodoo.evaluation import metrics
from voodoo.evaluation.evaluate import select_by
from voodoo.evaluation.score import LIMIT_EXACT_M
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import DepthImage
from voodoo.sensors.settings import FrontEndSettings
from voodoo.synthetic.render import render_depth

CHAINS = {"arm": ("shoulder", "elbow", "wrist"), "leg": ("hip", "knee", "ankle")}
LIMBS = {"arm": ("upperarm", "forearm", "hand"), "leg": ("thigh", "calf", "foot")}
ALONG, ACROSS = (0.1, 0.3, 0.5, 0.7, 0.9), (-0.7, -0.35, 0.0, 0.35, 0.7)
NEAR_M, PAST_M, BEFORE_M = 0.04, 0.08, 0.01
CLEARLY = 0.1
"""A difference of shares that is more than chance."""
GROUPS = ("the estimate", "neither", "the reference")


@dataclass(frozen=True)
class Judged:
    """What counts as off, and who explains it.

    Args:
        bones: most that the reference's bones may have changed since the start, as a share.
        consistent: without joints of the reference whose bone is far off its median.
        whole: an arm or leg is asked as a whole.
        offsets: without each joint's constant offset from the reference.
    """

    bones: float = np.inf
    consistent: bool = False
    whole: bool = False
    offsets: bool = False


def net(ends, shape, depth, others, camera, cut_out):
    """What speaks for a limb between two points (camera frame, meters), less what speaks against it; at most 1."""
    axis = ends[1] - ends[0]
    along = axis / np.linalg.norm(axis)
    total = 0.0
    for t in ALONG:
        center = ends[0] + t * axis
        radius = (1.0 - t) * (shape.a0 + shape.b0) / 2 + t * (shape.a1 + shape.b1) / 2
        ahead = -center + (center @ along) * along
        if np.linalg.norm(ahead) < 1e-6:
            continue
        ahead /= np.linalg.norm(ahead)
        for s in ACROSS:
            place = center + radius * (ahead * np.sqrt(1.0 - s * s) + np.cross(along, ahead) * s)
            column, row = np.rint(camera.project(place[None])[0]).astype(int)
            if not (0 <= column < camera.width and 0 <= row < camera.height):
                continue
            observed, other = depth[row, column], others[row, column]
            if (other > 0.0 and other < place[2] - BEFORE_M) or (observed <= 0.0 and not cut_out):
                continue
            if observed <= 0.0 or observed > place[2] + PAST_M:
                total -= t
            elif abs(observed - place[2]) < NEAR_M and not (other > 0.0 and abs(other - observed) < NEAR_M):
                total += t
    return total / (sum(ALONG) * len(ACROSS))


def joints_of(recording, steps):
    """Estimated and reference joints (F, 12, 3), the latter moved by the best lag where they are no exact truth."""
    stamps = np.array([step.estimate.stamp for step, _ in steps])
    estimated = np.array([[step.estimate.joints[name] for name in metrics.JOINTS] for step, _ in steps])
    known = recording.reference
    columns = [known.names.index(name) for name in metrics.JOINTS]
    period = float(np.median(np.diff(known.stamps)))
    reference = metrics.match_reference(stamps, known.stamps, known.positions[:, columns], tolerance=period / 2)
    lag = 0 if known.exact else metrics.best_lag(estimated, reference)
    moved = np.full_like(reference, np.nan)
    source = np.arange(len(steps)) - lag
    inside = (source >= 0) & (source < len(steps))
    moved[inside] = reference[source[inside]]
    return estimated, moved


def bones(joints):
    """Lengths (2) [m] of the bones between three joints (3, 3)."""
    return np.linalg.norm(np.diff(joints, axis=0), axis=1)


def limb_nets(limb, both, body, cut):
    """What speaks for a limb (net) between each of two pairs of joints, world frame."""
    shape = body.limbs[body.limb_names.index(limb)].shape
    camera_from_root, depth, others, camera, cut_out = cut
    observed = [points @ camera_from_root[:3, :3].T + camera_from_root[:3, 3] for points in both]
    return np.array([net(ends, shape, depth, others, camera, cut_out) for ends in observed])


def judged(recording, by):
    """(winner among GROUPS, off by [m], called measured) of every limb that is off."""
    start = recording.start["joints"]
    tracker = start_tracker(recording)
    settings = FrontEndSettings.of(recording, use=("depth",))
    steps = [(step, tracker.body) for step in track(recording, tracker, settings=settings)]
    estimated, reference = joints_of(recording, steps)
    if by.consistent and not recording.reference.exact:
        reference = metrics.without_contradictions(reference)
    if by.offsets:
        reference = reference + np.nanmean(estimated - reference, axis=0)
    errors = np.linalg.norm(estimated - reference, axis=2)
    cut_out = select_by(recording) == "segmented"
    for (step, body), mine, other, error in zip(steps, estimated, reference, errors, strict=True):
        image = next(item for item in step.recorded.measurements if isinstance(item, DepthImage))
        depth = image.image * image.meters_per_unit
        camera_from_root = np.linalg.inv(image.root_from_sensor)
        for side, kind in itertools.product("lr", CHAINS):
            joints = [metrics.JOINTS.index(f"{side}_{name}") for name in CHAINS[kind]]
            limbs = [f"{side}_{name}" for name in LIMBS[kind]]
            if not (error[joints[1:]] > LIMIT_EXACT_M).any() or not np.isfinite(error[joints]).all():
                continue
            known = bones([start[metrics.JOINTS[joint]] for joint in joints])
            if (np.abs(bones(other[joints]) / known - 1.0) > by.bones).any():
                continue
            # The body without this arm or leg, which is put behind the camera.
            poses = {name: np.array(pose) for name, pose in step.estimate.world_from_limb.items()}
            for name in limbs:
                poses[name][:3, 3] -= 50.0 * image.root_from_sensor[:3, 2]
            others = render_depth(body, poses, camera=image.camera, world_from_sensor=image.root_from_sensor).depth
            cut = (camera_from_root, depth, others, image.camera, cut_out)
            nets = [
                limb_nets(limbs[which], (mine[joints[which : which + 2]], other[joints[which : which + 2]]), body, cut)
                for which in (0, 1)
            ]
            for which in (1, 2):
                if error[joints[which]] <= LIMIT_EXACT_M:
                    continue
                own, its = np.mean(nets, axis=0) if by.whole else nets[which - 1]
                better = own - its
                winner = GROUPS[0] if better > CLEARLY else GROUPS[2] if better < -CLEARLY else GROUPS[1]
                yield winner, error[joints[which]], step.estimate.limb_status[limbs[which - 1]] == "measured"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path)
    parser.add_argument(
        "--bones", type=float, default=np.inf, metavar="SHARE", help="most that the reference's bones may change"
    )
    parser.add_argument("--consistent", action="store_true", help="without what contradicts itself in the reference")
    parser.add_argument("--whole", action="store_true", help="ask an arm or leg as a whole")
    parser.add_argument("--offsets", action="store_true", help="without each joint's constant offset")
    options = parser.parse_args()
    by = Judged(options.bones, options.consistent, options.whole, options.offsets)
    found, reported = Counter(), Counter()
    for path in options.recordings:
        recording = voodoo.open_recording(path)
        if recording.reference is None:
            raise SystemExit(f"{recording.name}: expected a recording with a reference or truth, found none")
        for winner, error, measured in judged(recording, by):
            for limit in (0.10, 0.15, 0.20):
                found[winner, limit] += error > limit
                reported[winner, limit] += error > limit and not measured
    print("| off by more than | " + " | ".join(f"{name} explains the depth better" for name in GROUPS) + " | all |")
    print("|---|" + "---|" * (len(GROUPS) + 1))
    for limit in (0.10, 0.15, 0.20):
        total, all_reported = (sum(counts[name, limit] for name in GROUPS) for counts in (found, reported))
        cells = [
            f"{fraction(found[name, limit], total)}, reported {fraction(reported[name, limit], found[name, limit])}"
            for name in GROUPS
        ]
        print(
            f"| {100 * limit:.0f} cm | " + " | ".join(cells) + f" | {total}, reported {fraction(all_reported, total)} |"
        )


def fraction(part: int, whole: int) -> str:
    return f"{100 * part / whole:.0f} %" if whole else "-"


if __name__ == "__main__":
    main()
