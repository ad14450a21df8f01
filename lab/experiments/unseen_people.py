"""The first pose, what follows from it, and the sizes: recordings with exact truth, tracked by depth alone with `--init auto`.

    python -m lab.training.unseen OUT && python lab/experiments/unseen_people.py OUT/report
    python lab/experiments/unseen_people.py D/rendered/dev_*

A row a recording:

- start: number of the first frame with a pose, from 1, of those since half of the joints are in the image (`never`: there is
  none), and the mean error there;
- mean: of the whole recording; the class counts a joint lost that is farther than 10 cm for more than 0.3 s, at the end too;
- exchanged: shoulders and hips lie nearer to the truth's opposite ones, in the first pose and ten frames after it;
- lengths, girths: mean error of upper arms, forearms, thighs and calves against the truth, of lengths and of mean radii, in the
  first pose, a second later, and at the end.

Only joints inside the image are judged: what a person does outside of it nobody knows. Then the same by what meta.json of
`lab.training.unseen` says: the camera's height, tilt and more.
"""

import argparse
import json
import multiprocessing
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import voodoo
from voodoo.evaluation import metrics
from voodoo.evaluation.evaluate import NOWHERE_M
from voodoo.evaluation.score import LIMIT_EXACT_M
from voodoo.evaluation.search import find_recordings
from voodoo.measurements import DepthImage
from voodoo.names import SEARCHING
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.sensors.settings import FrontEndSettings

IN_TIME = 5
FRAMES_PER_SECOND = 30
LATER = 10
ENOUGH = 6
"""So many of the twelve joints in the image are somebody in view."""
SECOND_S = 1.0
PAIRS = [(metrics.JOINTS.index(f"l_{joint}"), metrics.JOINTS.index(f"r_{joint}")) for joint in ("shoulder", "hip")]
BONES = {
    "upperarm": ("shoulder", "elbow"),
    "forearm": ("elbow", "wrist"),
    "thigh": ("hip", "knee"),
    "calf": ("knee", "ankle"),
}
WHEN = ("first", "after 1 s", "end")
MIDDLE = np.linspace(0.3, 0.7, 5)
"""Shares of a limb's length at which its girth is taken."""


@dataclass(frozen=True, eq=False)
class Result:
    """What one recording gave; meters.

    Args:
        name: of the recording.
        frame: number of the first frame with a pose, from 1; None: there is none.
        first, mean: mean error there and over the recording.
        tracking_class: see metrics.tracking_class.
        lost: joints that are lost at the end.
        exchanged: in the first pose, and LATER frames after it.
        lengths, girths: a bone's (BONES, left and right) signed error at WHEN, (3, 8); NaN: not known.
        about: what meta.json says.
    """

    name: str
    frame: int | None
    first: float
    mean: float
    tracking_class: int
    lost: tuple[str, ...]
    swapped: tuple[bool, bool]
    lengths: np.ndarray
    girths: np.ndarray
    about: dict[str, object] = field(default_factory=dict)


def run(path: Path, init: str, height: bool = False) -> Result:
    """Track one recording."""
    recording = voodoo.open_recording(path)
    reference = recording.reference
    if reference is None or not reference.exact:
        raise SystemExit(f"{path}: expected a recording with exact truth, found none")
    column = [reference.names.index(name) for name in metrics.JOINTS]
    file = path / "meta.json"
    about = json.loads(file.read_text()) if file.is_file() else {}
    tracker = start_tracker(
        recording,
        init="auto" if init == "auto" else None,
        height=float(about["stature_m"]) if height else None,
        use=("depth",),
    )
    stamps, places, sizes, posed = [], [], [], []
    for frame in track(recording, tracker, settings=FrontEndSettings.of(recording, use=("depth",))):
        estimate = frame.estimate
        there = estimate.status != SEARCHING
        truth = reference.positions[np.argmin(np.abs(reference.stamps - estimate.stamp))][column]
        image = next(item for item in frame.recorded.measurements if isinstance(item, DepthImage))
        stamps.append(estimate.stamp)
        posed.append(there)
        known = [estimate.joints[name] for name in metrics.JOINTS] if there else np.full((12, 3), np.nan)
        places.append([np.array(known), np.where(inside_image(image, truth)[:, None], truth, np.nan), truth])
        sizes.append((lengths_of(np.array(known)), girths_of(tracker.body) if there else np.full(8, np.nan)))
    joints, observed, truths = np.array(places).transpose(1, 0, 2, 3)
    time = np.array(stamps)
    errors = metrics.joint_errors(joints, observed)
    missed = np.array([not there for there in posed])[:, None] & np.isfinite(observed).all(axis=2)
    class_, lost = metrics.tracking_class(np.where(missed, NOWHERE_M, errors), time, limit=LIMIT_EXACT_M)
    at_end = [
        bool(row.any()) and bool(lost[np.flatnonzero(row)[-1], index])
        for index, row in enumerate(np.isfinite(observed).all(axis=2).T)
    ]
    true_lengths = np.median([lengths_of(row) for row in truths], axis=0)
    radii = about.get("radii_m", {})
    true_girths = np.array([radii.get(f"{side}_{bone}", np.nan) for bone in BONES for side in "lr"])
    found = np.flatnonzero(posed)
    came = int(np.argmax(np.isfinite(observed).all(axis=2).sum(axis=1) >= ENOUGH))
    begin = int(found[0]) if len(found) else None
    at = [0, 0, 0] if begin is None else [begin, int(np.searchsorted(time, time[begin] + SECOND_S)), int(found[-1])]
    off = [np.array([sizes[min(index, len(sizes) - 1)][which] for index in at]) for which in (0, 1)]
    later = min(at[0] + LATER, len(time) - 1)
    return Result(
        recording.name,
        None if begin is None else max(begin - came, 0) + 1,
        np.nan if begin is None else metrics.mean_or_nan(errors[begin]),
        metrics.mean_or_nan(errors),
        int(class_ or 0),
        tuple(name for name, is_lost in zip(metrics.JOINTS, at_end, strict=True) if is_lost),
        (swapped(joints[at[0]], truths[at[0]]), swapped(joints[later], truths[later])),
        off[0] - true_lengths,
        off[1] - true_girths,
        about,
    )


def inside_image(image: DepthImage, places: np.ndarray) -> np.ndarray:
    """Which places (J, 3) [m] in the root frame the image's borders contain; as a pinhole."""
    pose, camera = np.asarray(image.root_from_sensor), image.camera
    at = (places - pose[:3, 3]) @ pose[:3, :3]
    z = np.maximum(at[:, 2], 1e-6)
    u, v = camera.fx * at[:, 0] / z + camera.cx, camera.fy * at[:, 1] / z + camera.cy
    return (at[:, 2] > 0.1) & (u >= 0.0) & (u < camera.width) & (v >= 0.0) & (v < camera.height)


def lengths_of(joints: np.ndarray) -> np.ndarray:
    """Lengths (8,) [m] of BONES, left and right, of metrics.JOINTS (12, 3)."""
    at = {name: joints[index] for index, name in enumerate(metrics.JOINTS)}
    return np.array([np.linalg.norm(at[f"{side}_{a}"] - at[f"{side}_{b}"]) for a, b in BONES.values() for side in "lr"])


def girths_of(body: voodoo.Body) -> np.ndarray:
    """Mean radii (8,) [m] of the middle of BONES, left and right."""
    shapes = {limb.name: limb.shape for limb in body.limbs}
    return np.array([mean_radius(shapes[f"{side}_{bone}"]) for bone in BONES for side in "lr"])


def mean_radius(shape: voodoo.TaperedEllipticCylinder) -> float:
    """Mean distance [m] of the surface from the axis, over MIDDLE."""
    a, b = (low + MIDDLE[:, None] * (high - low) for low, high in ((shape.a0, shape.a1), (shape.b0, shape.b1)))
    angle = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    return float(np.hypot(a * np.cos(angle), b * np.sin(angle)).mean())


def swapped(joints: np.ndarray, truth: np.ndarray) -> bool:
    """Whether shoulders and hips (12, 3) lie nearer to the truth's opposite ones than to their own."""
    own = sum(np.linalg.norm(joints[[left, right]] - truth[[left, right]], axis=1).sum() for left, right in PAIRS)
    other = sum(np.linalg.norm(joints[[left, right]] - truth[[right, left]], axis=1).sum() for left, right in PAIRS)
    return bool(other < own)


def centimeters(value: float) -> str:
    """A number of a table."""
    return "-" if np.isnan(value) else f"{100.0 * value:.1f}"


def cells(results: Sequence[Result]) -> list[str]:
    """What a group of recordings gave, without its name."""
    late = sum(result.frame is None or result.frame > IN_TIME for result in results)
    in_second = sum(result.frame is not None and result.frame <= FRAMES_PER_SECOND for result in results)
    firsts, means = (np.array([getattr(result, what) for result in results]) for what in ("first", "mean"))
    turned = [sum(result.swapped[when] for result in results) for when in (0, 1)]
    lost = sum(result.tracking_class == 0 for result in results)
    classes = np.mean([result.tracking_class for result in results])
    return [
        f"{len(results)}",
        f"{late}",
        f"{100 * in_second / len(results):.0f}",
        centimeters(metrics.mean_or_nan(firsts)),
        centimeters(metrics.mean_or_nan(means)),
        f"{turned[0]}; {turned[1]}",
        f"{lost}",
        f"{classes:.2f}",
    ]


def grouped(results: Sequence[Result], what: str, of: Callable[[dict], object]) -> None:
    """Rows of the groups by something that meta.json says."""
    for value in sorted({of(result.about) for result in results}, key=str):
        group = [result for result in results if of(result.about) == value]
        print("| " + " | ".join([f"{what} {value}", *cells(group)]) + " |")


def sizes_table(results: Sequence[Result]) -> None:
    """Errors of lengths and girths by bone: mean (signed) and mean absolute, at WHEN."""
    print("\n| size | " + " | ".join(WHEN) + " |")
    print("|---|---|---|---|")
    for what in ("lengths", "girths"):
        errors = np.array([getattr(result, what) for result in results])
        for number, bone in enumerate([*BONES, "all"]):
            part = errors if bone == "all" else errors[:, :, 2 * number : 2 * number + 2]
            row = [part[:, when] for when in range(len(WHEN))]
            numbers = [
                f"{centimeters(metrics.mean_or_nan(np.abs(one)))} ({100.0 * metrics.mean_or_nan(one):+.1f})"
                for one in row
            ]
            if np.isfinite(part).any():
                print(f"| {what[:-1]}, {bone} | " + " | ".join(numbers) + " |")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path, help="recordings, or folders of them")
    parser.add_argument("--init", choices=("auto", "given"), default="auto")
    parser.add_argument(
        "--height", action="store_true", help="give the stature that meta.json says, as `--height` does"
    )
    parser.add_argument("--jobs", type=int, default=2, help="processes (default 2)")
    options = parser.parse_args()
    paths = find_recordings(options.recordings)
    if options.jobs == 1:
        results = [run(path, options.init, options.height) for path in paths]
    else:
        with ProcessPoolExecutor(options.jobs, multiprocessing.get_context("spawn")) as pool:
            results = list(pool.map(run, paths, *([value] * len(paths) for value in (options.init, options.height))))
    heads = "start: frame | error, cm | mean, cm | exchanged: first, later | lost at the end | class | lengths, cm | girths, cm"
    print(f"| recording | {heads} |")
    print("|---|---|---|---|---|---|---|---|---|")
    for result in results:
        sizes = [
            " ".join(centimeters(metrics.mean_or_nan(np.abs(row))) for row in which)
            for which in (result.lengths, result.girths)
        ]
        turned = " ".join("yes" if one else "no" for one in result.swapped)
        lost = ", ".join(result.lost) or "none"
        start = f"{result.frame or 'never'}"
        values = [
            result.name,
            start,
            centimeters(result.first),
            centimeters(result.mean),
            turned,
            lost,
            f"{result.tracking_class}",
            *sizes,
        ]
        print("| " + " | ".join(values) + " |")
    print(
        "\n| group | recordings | late | within 1 s, % | first pose, cm | mean, cm | exchanged: first; later | end lost | class |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    print("| " + " | ".join(["all", *cells(results)]) + " |")
    if all(result.about.get("camera_tilt_deg") is not None for result in results):
        grouped(
            results,
            "height",
            lambda about: (
                "under 0.8 m"
                if about["camera_height_m"] < 0.8
                else "0.8 to 1.5 m"
                if about["camera_height_m"] < 1.5
                else "above 1.5 m"
            ),
        )
        grouped(
            results,
            "tilt",
            lambda about: (
                "up"
                if about["camera_tilt_deg"] < -3
                else "to 12 degrees"
                if about["camera_tilt_deg"] < 12
                else "12 to 30 degrees"
            ),
        )
        grouped(results, "sensor", lambda about: about["sensor"].split()[0])
        grouped(results, "floor", lambda about: "known" if about["floor_known"] else "not known")
        grouped(results, "person", lambda about: about["person"])
    if any("group" in result.about for result in results):
        grouped(results, "group", lambda about: about.get("group", "adult"))
    sizes_table(results)


if __name__ == "__main__":
    main()
