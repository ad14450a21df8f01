"""A real planar laser on a moving robot: two standing legs follow a person whose positions were clicked by hand.

    python lab/experiments/fusion_laser.py ../shared/data/laser/general_tracking_moving_1.zip --out out/laser

The scans and the clicks (in the laser's frame) are turned into the robot's odometry frame. The legs are put on the two
clusters of returns next to one click and then only see scans. Writes table.md and paths.png.
"""

import argparse
import tempfile
import zipfile
from pathlib import Path

import matplotlib
import numpy as np
from rosbags.highlevel import AnyReader

import voodoo
from voodoo.recordings import LaserScan, open_recording

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HIP_M, HALF_WIDTH_M, LEG_M, FIRST = 0.90, 0.10, 0.85, 3
CONFIG = voodoo.Config()
# A leg hangs on the pelvis by a universal joint; the laser cuts it at the height of the shin.
LEG = """
[[limbs]]
name = "{s}_leg"
parent = "pelvis"
shape = {{ length = 0.85, a0 = 0.075, b0 = 0.075, a1 = 0.05, b1 = 0.05 }}
match_caps = [false, false]
[limbs.joint]
name = "{s}_hip"
on_parent = {{ position = [0.0, {y}, 0.0], rotation = [3.141592653589793, 0.0, 0.0] }}
"""
SITE = """
[[sites]]
name = "{s}_{name}"
limb = "{s}_leg"
position = [0.0, 0.0, {z}]
"""


def legs() -> voodoo.Body:
    text = 'name = "standing legs"\n[[limbs]]\nname = "pelvis"\nmatch_caps = [false, false]\n'
    text += "shape = { length = 0.10, a0 = 0.03, b0 = 0.03, a1 = 0.03, b1 = 0.03 }\n"
    text += "".join(LEG.format(s=s, y=y) for s, y in (("l", HALF_WIDTH_M), ("r", -HALF_WIDTH_M)))
    text += "".join(SITE.format(s=s, name=name, z=z) for s in "lr" for name, z in (("hip", 0.0), ("ankle", LEG_M)))
    return voodoo.Body.from_toml(text)


def clicks(bag: Path) -> dict[int, np.ndarray]:
    """Person -> (N, 3): stamp [s], x, y [m] in the laser's frame."""
    found: dict[int, list[tuple[float, float, float]]] = {}
    with AnyReader([bag]) as reader:
        topics = [item for item in reader.connections if item.topic == "/ground_truth_people_tracks"]
        for connection, stamp, raw in reader.messages(topics):
            person = reader.deserialize(raw, connection.msgtype)
            place = person.pose.position
            found.setdefault(int(person.id), []).append((stamp * 1e-9, place.x, place.y))
    return {person: np.array(rows) for person, rows in found.items()}


def world(scan: LaserScan) -> np.ndarray:
    return scan.points() @ scan.root_from_sensor[:3, :3].T + scan.root_from_sensor[:3, 3]


def two_clusters(points: np.ndarray, place: np.ndarray) -> list[np.ndarray] | None:
    """Middles (2,) of the two clusters of returns nearest to a place, within 45 cm of it."""
    cuts = np.flatnonzero(np.linalg.norm(np.diff(points, axis=0), axis=1) > 0.1) + 1
    middles = [part.mean(axis=0)[:2] for part in np.split(points, cuts) if len(part) >= 2]
    near = sorted(middles, key=lambda middle: float(np.linalg.norm(middle - place)))[:2]
    return near if len(near) == 2 and np.linalg.norm(near[1] - place) < 0.45 else None


def follow(
    scans: list[LaserScan], truth: np.ndarray, numbers: list[int], config: voodoo.Config
) -> tuple[np.ndarray, list[voodoo.Estimate]] | None:
    """Middle of the two legs at the laser's height (N, 2) for each click from FIRST on, and the estimates of all steps; None
    without two legs to start on."""
    start, height = numbers[FIRST], float(scans[0].root_from_sensor[2, 3])
    middles = two_clusters(world(scans[start]), truth[FIRST])
    if middles is None:
        return None
    way = truth[FIRST + 1] - truth[FIRST]
    left = np.array([-way[1], way[0]]) / max(float(np.linalg.norm(way)), 1e-9)
    middles.sort(key=lambda middle: -float(middle @ left))
    joints = {}
    for side, sign, middle in (("l", 1.0, middles[0]), ("r", -1.0, middles[1])):
        hip = np.array([*(np.mean(middles, axis=0) + sign * HALF_WIDTH_M * left), HIP_M])
        shin = np.array([*middle, height])
        joints[f"{side}_hip"] = hip
        joints[f"{side}_ankle"] = hip + (shin - hip) / np.linalg.norm(shin - hip) * LEG_M
    tracker = voodoo.Tracker(legs(), config=config)
    tracker.reset(joints=joints, fit_sizes=False)
    found, estimates = [], []
    for number in range(start, numbers[-1] + 1):
        frame = voodoo.Frame(stamp=scans[number].stamp)
        frame.add_points(world(scans[number]), source="laser")
        estimate = tracker.step(frame)
        estimates.append(estimate)
        cuts = []
        for side in "lr":
            pose = estimate.world_from_limb[f"{side}_leg"]
            cuts.append(pose[:3, 3] + pose[:3, 2] * (height - pose[2, 3]) / pose[2, 2])
        found.append(np.mean(cuts, axis=0)[:2])
    return np.array([found[number - start] for number in numbers[FIRST:]]), estimates


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path, help="the .zip")
    parser.add_argument("--out", type=Path, default=Path("out/laser"))
    parser.add_argument("--config", type=Path, help="TOML of the tracker; default: CONFIG in this file")
    options = parser.parse_args()
    config = CONFIG if options.config is None else voodoo.Config.load(options.config)
    with tempfile.TemporaryDirectory() as folder:
        zipfile.ZipFile(options.recording).extractall(folder)
        bag = next(Path(folder).rglob("*.bag"))
        people = clicks(bag)
        scans = [item for recorded in open_recording(bag, root_frame="odom") for item in recorded.measurements]
    stamps = np.array([scan.stamp for scan in scans])
    lines = [
        "Distance from the middle of the two legs to the clicked position (cm), person by person.",
        "",
        "| person | clicks | seconds | person moved / m | robot moved / m | mean | last | within 25 cm | lost | matched |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    paths = {}
    for person, rows in people.items():
        if len(rows) < 15:
            continue
        numbers = [int(np.abs(stamps - stamp).argmin()) for stamp in rows[:, 0]]
        poses = [scans[number].root_from_sensor for number in numbers]
        truth = np.array([(p @ [x, y, 0.0, 1.0])[:2] for p, (_, x, y) in zip(poses, rows, strict=True)])
        followed = follow(scans, truth, numbers, config)
        head = f"| {person} | {len(rows)} | {rows[-1, 0] - rows[FIRST, 0]:.1f} "
        if followed is None:
            lines.append(head + "| | | no two legs at the start | | | | |")
            continue
        found, estimates = followed
        ways = [
            float(np.linalg.norm(places[-1] - places[0]))
            for places in (truth[FIRST:], np.array([pose[:2, 3] for pose in poses[FIRST:]]))
        ]
        statuses = [estimate.status for estimate in estimates]
        returns = np.array([estimate.sources["laser"][:2] for estimate in estimates])
        error = 100.0 * np.linalg.norm(found - truth[FIRST:], axis=1)
        lines.append(
            head
            + f"| {ways[0]:.1f} | {ways[1]:.1f} | {error.mean():.0f} | {error[-1]:.0f} | {(error < 25).mean():.0%} "
            + f"| {statuses.count('lost') / len(statuses):.0%} | {returns[:, 1].sum() / returns[:, 0].sum():.0%} |"
        )
        paths[person] = (truth[FIRST:], found, world(scans[numbers[-1]]))
    table = "\n".join(lines) + "\n"
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "table.md").write_text(table, encoding="utf-8")
    print(table)
    figure, axes = plt.subplots(1, max(len(paths), 1), figsize=(4.2 * max(len(paths), 1), 4.2), squeeze=False)
    for axis, (person, (truth, found, points)) in zip(axes[0], paths.items(), strict=False):
        axis.plot(points[:, 0], points[:, 1], ".", color="0.7", markersize=3, label="last scan")
        axis.plot(*truth.T, "o-", markersize=4, label="clicked")
        axis.plot(*found.T, "x-", markersize=5, label="legs")
        low, high = truth.min(axis=0) - 1.0, truth.max(axis=0) + 1.0
        axis.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), title=f"person {person}", xlabel="odom x / m")
        axis.set_aspect("equal")
    axes[0, 0].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(options.out / "paths.png", dpi=100)


if __name__ == "__main__":
    main()
