"""Inverse kinematics (IK) for a recording: known sites from its reference or a result file, silhouettes from its images."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Literal, NamedTuple, TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import VoodooError
from voodoo.export.track import Track
from voodoo.ik.chain import Chain
from voodoo.ik.image import Silhouette
from voodoo.ik.solve import Follower, Posture, solve
from voodoo.ik.values import Options
from voodoo.measurements import ByteImage, ColorImage, DepthImage, FloatArray, RecordedFrame
from voodoo.recordings.recording import Recording, Reference
from voodoo.sensors.settings import LEVEL_FRAMES
from voodoo.sensors.silhouettes.masks import Mask, surroundings
from voodoo.sensors.silhouettes.regions import RegionSilhouettes
from voodoo.sensors.silhouettes.still import StillBackground, StillScene, from_depth
from voodoo.tracker import Tracker

Pictures: TypeAlias = Literal["depth", "color", "regions", "none"]

KNOWN = ("head_center", "l_shoulder", "r_shoulder", "l_hand", "r_hand", "l_hip", "r_hip", "l_ankle", "r_ankle")
"""Sites that are known in J10, and the trunk that carries its chains."""
_STAND_INS = {"head_center": "skullbase", "l_hand": "l_wrist", "r_hand": "r_wrist"}
"""Substitutes for known sites that are missing: keypoint networks detect wrists, not hands."""
_SAME_TIME_S = 0.02
_LEARN = 41
_REACHED_M = 0.05


def known_positions(recording: Recording, result: Track | None = None) -> Reference:
    """Positions of sites from a result, or the recording's reference.

    Raises:
        VoodooError: the recording has no reference and no result was given, or the result covers another time span.
    """
    if result is not None:
        about = recording.info()
        low, high = about.start_stamp - _SAME_TIME_S, about.start_stamp + about.duration + _SAME_TIME_S
        if not ((result.stamps >= low) & (result.stamps <= high)).any():
            found = f"{result.stamps.min():.3f} to {result.stamps.max():.3f} s" if len(result) else "none"
            raise VoodooError(
                f"targets: expected stamps between {low:.3f} and {high:.3f} s as in {recording.name}, found {found}"
            )
        return Reference(result.stamps, result.joint_names, result.joints, exact=False)
    if recording.reference is None:
        raise VoodooError(
            f"{recording.name}: expected positions of known sites, found no reference in the recording; "
            "give a result of voodoo track"
        )
    return recording.reference


class Solved(NamedTuple):
    """A frame: its posture as a track of one frame, the error [m] of every other site with a known position, its time [s]."""

    track: Track
    errors: dict[str, float]
    seconds: float


def follow(
    recording: Recording,
    tracker: Tracker,
    positions: Reference,
    *,
    sites: Sequence[str] | None = None,
    pictures: Pictures = "depth",
    options: Options | None = None,
    warm: bool = True,
    rest: bool = True,
) -> Iterator[Solved]:
    """Solve the postures of all frames from the known sites and the silhouettes.

    Args:
        recording: read while solving.
        tracker: at the first pose, see voodoo.pipeline.run.start_tracker; provides body and start.
        positions: positions of the known sites.
        sites: names of the known sites. None: those of head, trunk, hands and ankles that `positions` has; wrists and
            skullbase if hands and head are missing.
        pictures: how silhouettes are segmented. "depth": surface connected to the known sites and the last posture, or in front
            of the static scene. "color": difference from the static background. "regions": colors learned from the person in
            earlier frames, near the posture solved from the known sites alone. "none": plain inverse kinematics.
        options: see voodoo.ik.Options.
        warm: start each frame from the previous posture; else solve each frame independently, from the first pose.
        rest: with `warm`: angles that sites and silhouettes leave free return to the mean of the postures so far, see
            ik.Follower.

    Returns:
        The frames, solved one by one. The status is "degraded" without a known site, or if targets are missed by more than
        5 cm, else "tracking". The residual is the root mean square of the target residuals, NaN without a known site.

    Raises:
        VoodooError: an unknown site, a site without positions, no known site at all, an unknown value, or a damaged recording.
    """
    if pictures not in ("depth", "color", "regions", "none"):
        raise VoodooError(f'pictures: expected "depth", "color", "regions" or "none", found {pictures!r}')
    chain = Chain(tracker.body)
    there = [name for name in positions.names if name in chain.site_names]
    if sites is None:
        sites = [name if name in there else _STAND_INS.get(name, name) for name in KNOWN]
    elif unknown := [name for name in sites if name not in there]:
        raise VoodooError(f"sites: expected some of {', '.join(there)}, found {', '.join(unknown)}")
    known = [name for name in sites if name in there]
    if not known:
        raise VoodooError(f"sites: expected some of {', '.join(positions.names)}, found {', '.join(sites)}")
    masks = {} if pictures in ("none", "regions") else _masks(recording, positions, known, pictures)
    regions = RegionSilhouettes(tracker.body) if pictures == "regions" else None
    options = Options() if options is None else options
    start = chain.project(tracker.estimate.world_from_limb)
    follower = Follower(chain, start=start, rest="mean" if rest else None, **vars(options))
    others = [name for name in there if name not in known]

    def solved() -> Iterator[Solved]:
        near: FloatArray | Posture = start
        last: Mapping[str, FloatArray] = {name: tracker.estimate.joints[name] for name in chain.site_names}
        first, any_images = True, False
        for recorded in recording:
            began = time.perf_counter()
            targets = positions.at(recorded.stamp, known, within=_SAME_TIME_S)
            observed = {**last, **targets} if warm else targets
            images = _silhouettes(recorded, observed, masks) if targets else []
            colors = [item for item in recorded.measurements if isinstance(item, ColorImage)] if regions else []
            if regions is not None and targets:
                # The first frame is the one whose posture is known.
                plain = tracker.estimate if first else solve(chain, targets, start=near, options=options)
                found = zip(regions.of(colors, plain.world_from_limb), colors, strict=True)
                images = [
                    Silhouette(mask, camera=lens, world_from_camera=item.root_from_sensor)
                    for (mask, lens), item in found
                ]
            if warm:
                posture = follower.step(targets, images=images)
            else:
                posture = solve(chain, targets, images=images, start=start, options=options)
            last, near = posture.joints, posture if warm else start
            first, any_images = False, any_images or posture.images > 0
            if regions is not None and targets:
                regions.learn(colors, posture.world_from_limb)
            truth = positions.at(recorded.stamp, others, within=_SAME_TIME_S)
            errors = {name: float(np.linalg.norm(posture.joints[name] - place)) for name, place in truth.items()}
            yield Solved(_track(recorded.stamp, posture), errors, time.perf_counter() - began)
        if regions is not None and not any_images:
            raise VoodooError(
                f"{recording.name}: expected color pictures, found none; --pictures says where to look, or none"
            )

    return solved()


def _track(stamp: float, posture: Posture) -> Track:
    reached = float(np.sqrt(np.mean(np.square(posture.residuals)))) if posture.residuals else np.nan
    return Track(
        stamps=np.array([stamp], dtype=np.float64),
        status=("tracking" if reached < _REACHED_M else "degraded",),
        residual=np.array([reached]),
        joint_names=tuple(posture.joints),
        joints=np.array([list(posture.joints.values())]),
        limb_names=tuple(posture.world_from_limb),
        world_from_limb=np.array([list(posture.world_from_limb.values())]),
        angle_names=posture.angle_names,
        angles=np.array([posture.angles]),
    )


_MaskOf: TypeAlias = Callable[[Any, Mapping[str, FloatArray]], Mask]
"""The mask of an image, by current and previous positions (3,) [m] of the person's sites."""


def _silhouettes(
    recorded: RecordedFrame, sites: Mapping[str, FloatArray], masks: Mapping[str, _MaskOf]
) -> list[Silhouette]:
    """Silhouettes of all images whose scene is known."""
    return [
        Silhouette(masks[item.sensor](item, sites), camera=item.camera, world_from_camera=item.root_from_sensor)
        for item in recorded.measurements
        if isinstance(item, DepthImage | ColorImage) and item.sensor in masks
    ]


def _masks(recording: Recording, positions: Reference, known: Sequence[str], pictures: Pictures) -> dict[str, _MaskOf]:
    """Of each camera what tells the person from its scene, which is learned from images spread over the recording; cameras are
    assumed to be static."""
    chosen = set(np.linspace(0, len(recording) - 1, _LEARN).round().astype(int).tolist())
    depths: dict[str, list[DepthImage]] = {}
    colors: dict[str, list[tuple[ByteImage, npt.NDArray[np.bool_]]]] = {}
    for index, recorded in enumerate(recording):
        if index not in chosen:
            continue
        for item in recorded.measurements:
            if pictures == "depth" and isinstance(item, DepthImage):
                depths.setdefault(item.sensor, []).append(item)
            elif pictures == "color" and isinstance(item, ColorImage):
                there = surroundings(
                    positions.at(recorded.stamp, known, within=_SAME_TIME_S), item.camera, item.root_from_sensor
                )
                colors.setdefault(item.sensor, []).append((item.image, there))
    if not depths and not colors:
        raise VoodooError(
            f"{recording.name}: expected {pictures} pictures, found none; --pictures says where to look, or none"
        )
    level = recording.root_frame in LEVEL_FRAMES
    masks: dict[str, _MaskOf] = {
        name: partial(from_depth, scene=StillScene(images), level=level) for name, images in depths.items()
    }
    for name, pairs in colors.items():
        background = StillBackground([image for image, _ in pairs], occupied=[there for _, there in pairs])
        masks[name] = partial(_before, background)
    return masks


def _before(background: StillBackground, item: ColorImage, _: Mapping[str, FloatArray]) -> Mask:
    return background.mask(item.image)
