"""A detector of one's own: a silhouette's extremes start the tracker, without the shipped network.

Run it from anywhere: python examples/custom_detector.py
"""

import cv2
import numpy as np

import voodoo
from voodoo.detectors import CallableDetector, DetectedPerson, DetectorImage
from voodoo.pipeline.run import track
from voodoo.recordings import open_recording, sample_path

MIDDLE = {"head_center": 0.93, "humanoid_root": 0.55}
SIDES = {"shoulder": (0.81, 0.06), "wrist": (0.47, 0.03), "ankle": (0.05, 0.03)}
"""Heights above the floor of someone who stands with hanging arms, as shares of the stature; and how far joints lie within the
outline [m]."""
JOINTS = (*MIDDLE, *(f"{side}_{joint}" for joint in SIDES for side in "lr"))


def standing_person(image: DetectorImage) -> list[DetectedPerson]:
    """Whoever stands upright and looks at the camera, as one blob of depth that is as large as a person."""
    points = image.to_world(image.points())
    # The world is the recording's, whose floor is z = 0. Walls are farther than 3.6 m.
    near = (image.depth > 0.0) & (image.depth < 3.6) & (points[..., 2] > 0.06)
    count, labels = cv2.connectedComponents(near.astype(np.uint8))
    found = []
    for label in range(1, count):
        mask = labels == label
        blob = points[mask]
        stature = float(np.percentile(blob[:, 2], 99.5))
        if len(blob) < 200 or not 1.4 < stature < 2.1:
            continue
        joints = dict(joints_of(blob, stature, image.world_from_sensor[:3, 3]))
        if len(joints) == len(JOINTS):
            found.append(DetectedPerson(joints, confidence=0.98, joint_sigma=0.08, mask=mask))
    return found


def joints_of(blob: np.ndarray, stature: float, camera: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Where the joints of a standing person are whose surface shows these points (N, 3)."""
    middle = np.median(blob, axis=0)
    away = (middle - camera) * (1.0, 1.0, 0.0)
    away /= np.linalg.norm(away)
    right = np.cross(away, (0.0, 0.0, 1.0))  # of the image, which is the person's left

    def level(fraction: float) -> np.ndarray:
        return blob[np.abs(blob[:, 2] - fraction * stature) < 0.04 * stature]

    joints = []
    for name, fraction in MIDDLE.items():
        slab = level(fraction)
        if len(slab):
            place = np.median(slab, axis=0) + 0.1 * away
            joints.append((name, np.array([*place[:2], fraction * stature])))
    for joint, (fraction, inwards) in SIDES.items():
        slab = level(fraction)
        if len(slab):
            across = (slab - middle) @ right
            depth = np.median((slab - middle) @ away) + 0.07
            for side, extreme in (("l", across.max() - inwards), ("r", across.min() + inwards)):
                place = middle + extreme * right + depth * away
                joints.append((f"{side}_{joint}", np.array([*place[:2], fraction * stature])))
    return joints


def main() -> float:
    """Track the bundled recording; returns the median error of its joints in meters."""
    recording = open_recording(sample_path())
    detector = CallableDetector(standing_person, joints=JOINTS)
    tracker = voodoo.Tracker(voodoo.Body.human(), detector=detector)
    reference, errors = recording.reference, []
    for step in track(recording, tracker):
        joints = step.estimate.joints  # empty while nobody is found
        row = int(np.argmin(np.abs(reference.stamps - step.estimate.stamp)))
        for name, truth in zip(reference.names, reference.positions[row], strict=True):
            if name in joints:
                errors.append(np.linalg.norm(joints[name] - truth))
    return float(np.median(errors))


if __name__ == "__main__":
    print(f"median joint error {100 * main():.1f} cm")
