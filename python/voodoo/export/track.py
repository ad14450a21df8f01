"""The result of a whole recording for one person, and its files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate
from voodoo.errors import VoodooError
from voodoo.export.table import BY_FRAME, Arrays, joint_sigma, opened_result, save_result
from voodoo.ik.angles import angle_names as angle_names_of
from voodoo.ik.angles import angles_of
from voodoo.ik.chain import Chain
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.names import SEARCHING


def angles_of_estimates(estimates: Sequence[Estimate], body: Body | None) -> tuple[tuple[str, ...], FloatArray]:
    """Names of the joint angles, and the angles (F, A) [rad], NaN while searching; none without a body."""
    if body is None:
        return (), np.empty((len(estimates), 0))
    chain, names = Chain(body), angle_names_of(body)
    unknown = np.full(len(names), np.nan)
    rows = [unknown if str(each.status) == SEARCHING else angles_of(chain, each) for each in estimates]
    return names, np.array(rows, dtype=np.float64)


def angle_sigmas_of(estimates: Sequence[Estimate], names: Sequence[str]) -> FloatArray:
    """Standard deviations (F, A) [rad] of the angles, of a joint with three angles the root mean square of all three; NaN where
    unknown, and (F, 0) if unknown in all frames."""
    joints = [name.rpartition("_")[0] for name in names]
    free = np.array([joints.count(joint) for joint in joints], dtype=np.float64)
    found = np.full((len(estimates), len(names)), np.nan)
    for index, estimate in enumerate(estimates):
        known = getattr(estimate, "angle_covariance", {})
        variances = {joint: float(known[joint].trace()) for joint in {*joints} & known.keys()}
        found[index] = [variances.get(joint, np.nan) for joint in joints]
    return np.sqrt(found / free) if np.isfinite(found).any() else np.empty((len(estimates), 0))


_ARRAYS = ("stamps", "status", "residual", "joint_names", "joints", "limb_names", "world_from_limb")
FORMAT_VERSION = 3
"""Version of the .npz format. It is increased if earlier readers would misread a file, not for additional arrays."""
_UNKNOWN = ("angle_sigma", "covariance", "root_covariance")
"""Arrays that may be unknown in frames with a pose."""
_WORDS = ("status", "joint_names", "limb_names", "angle_names")


@dataclass(frozen=True, eq=False, repr=False)
class Track:
    """Estimates of F frames: J joints and sites, L limbs.

    Args:
        stamps: (F,) [s].
        status: F of "tracking", "degraded", "lost" or "searching".
        residual: (F,) root mean square distance of the measurements to the model [m]; NaN in a lost or
            degraded frame without measurements (an empty cell in .csv).
        joint_names: J names of joints and sites.
        joints: (F, J, 3) [m] in the recording's root frame.
        limb_names: L names; () when the track was read from a .csv, which has no limb poses.
        world_from_limb: (F, L, 4, 4) poses of the limb frames in the root frame.
        angle_names: A names of joint angles, see voodoo.ik.angles; () when none were asked for.
        angles: (F, A) [rad].
        limb_status: limb -> F of "measured", "inferred" and so on, see Estimate.limb_status, "" while searching; {} when not
            known.
        left_out: unusable measurements of the recording: reason -> number. Not in .csv.
        covariance: (F, J, 3, 3) [m^2] of the joints, NaN where unknown; (F, 0, 3, 3) when there is none. In .csv a column
            NAME_sigma_m each: the root mean square of the standard deviations of x, y and z; they are not read again.
        root_covariance: (F, 6, 6) of the pose of the first limb: x, y, z [m], then rotations about the axes of the root frame
            [rad]; NaN where unknown. Not in .csv.
        angle_sigma: (F, A) standard deviations of the joint angles [rad]; of a joint with three angles the root mean square of
            all three; NaN where unknown, (F, 0) when there is none. Not in .csv.

    Positions, poses, angles and residual of a searching frame are NaN: there is no body (empty cells in .csv).
    """

    stamps: FloatArray
    status: tuple[str, ...]
    residual: FloatArray
    joint_names: tuple[str, ...]
    joints: FloatArray
    limb_names: tuple[str, ...]
    world_from_limb: FloatArray
    angle_names: tuple[str, ...] = ()
    angles: FloatArray = field(default_factory=lambda: np.empty((0, 0)))
    limb_status: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    left_out: Mapping[str, int] = field(default_factory=dict)
    covariance: FloatArray = field(default_factory=lambda: np.empty((0, 0, 3, 3)))
    root_covariance: FloatArray = field(default_factory=lambda: np.empty((0, 6, 6)))
    angle_sigma: FloatArray = field(default_factory=lambda: np.empty((0, 0)))

    def __post_init__(self) -> None:
        """Check that the arrays are consistent, and that all frames with a pose status have a pose."""
        frames, joints, angles = len(self.stamps), len(self.joint_names), len(self.angle_names)
        limb_words = {f"limb_status[{limb}]": words for limb, words in self.limb_status.items()}
        for name, words in {"status": self.status, **limb_words}.items():
            if len(words) != frames:
                raise VoodooError(f"{name}: expected {frames} entries, found {len(words)}")
        rows: dict[str, tuple[int, ...]] = {
            "angles": (angles,),
            "stamps": (),
            "residual": (),
            "joints": (joints, 3),
            "world_from_limb": (len(self.limb_names), 4, 4),
            "covariance": (joints if self.covariance.size else 0, 3, 3),
            "root_covariance": (6, 6),
            "angle_sigma": (angles if self.angle_sigma.size else 0,),
        }
        for name, row in rows.items():
            shape = frames, *row
            if (name in _UNKNOWN and not getattr(self, name).size) or (name == "angles" and not angles):
                object.__setattr__(self, name, np.full(shape, np.nan))
            array = getattr(self, name)
            if not isinstance(array, np.ndarray) or array.dtype.kind not in "fiu":
                found = array.dtype if isinstance(array, np.ndarray) else type(array).__name__
                raise VoodooError(f"{name}: expected an array of numbers, found {found}")
            if array.shape != shape:
                raise VoodooError(f"{name}: expected shape {shape}, found {array.shape}")
            self._check_numbers(name, array)

    def _check_numbers(self, name: str, array: FloatArray) -> None:
        """Reject poses that are NaN, and poses in searching frames."""
        if name in _UNKNOWN:
            return
        right = np.isfinite(array)
        if name == "residual":
            # A lost or extrapolated frame may have no measurements to compute a residual from.
            right |= np.isin(self.status, ("lost", "degraded"))
        if name != "stamps":
            right = np.where(self.found.reshape(-1, *[1] * (array.ndim - 1)), right, np.isnan(array))
        if not right.all():
            where = tuple(int(index) for index in np.argwhere(~right)[0])
            away = self.status[where[0]] == SEARCHING and name != "stamps"
            what = "NaN while searching" if away else "finite numbers"
            raise VoodooError(f"{name}: expected {what}, found {array[where]} in frame {where[0]}")

    @property
    def found(self) -> npt.NDArray[np.bool_]:
        """Which frames (F,) have a pose: all but the searching ones."""
        return np.array([status != SEARCHING for status in self.status], dtype=bool)

    @property
    def joint_sigma(self) -> FloatArray:
        """Root mean square (F, J) of the standard deviations of each joint's x, y and z [m]; (F, 0) without covariances."""
        return joint_sigma(self.covariance)

    def of_frames(self, chosen: npt.NDArray[np.bool_] | npt.NDArray[np.intp]) -> Track:
        """The track of some frames: a mask (F,), or their numbers."""
        numbers = np.arange(len(self))[chosen]
        return replace(
            self,
            status=tuple(self.status[number] for number in numbers),
            limb_status={limb: tuple(words[number] for number in numbers) for limb, words in self.limb_status.items()},
            **{name: getattr(self, name)[numbers] for name in BY_FRAME},
        )

    def __len__(self) -> int:
        """Number of frames."""
        return len(self.stamps)

    def __repr__(self) -> str:
        """One line with the counts."""
        return f"Track({len(self)} frames, {len(self.joint_names)} joints and sites, {len(self.limb_names)} limbs)"

    @classmethod
    def of(
        cls, estimates: Sequence[Estimate], *, body: Body | None = None, left_out: Mapping[str, int] | None = None
    ) -> Track:
        """Collect estimates of one body; the body is required for joint angles, and for names if nobody was found.

        Args:
            estimates: one a frame.
            body: theirs.
            left_out: see the class.

        Raises:
            VoodooError: no estimate, one that is not finite, or one of another body.
        """
        if not estimates:
            raise VoodooError("estimates: expected at least one frame, found none")
        posed = [estimate for estimate in estimates if str(estimate.status) != SEARCHING]
        joint_names: tuple[str, ...] = posed[0].joint_names if posed else () if body is None else body.site_names
        limb_names: tuple[str, ...] = posed[0].limb_names if posed else () if body is None else body.limb_names
        joints = np.full((len(estimates), len(joint_names), 3), np.nan)
        poses = np.full((len(estimates), len(limb_names), 4, 4), np.nan)
        covariance = np.full((len(estimates), len(joint_names), 3, 3), np.nan)
        for index, estimate in enumerate(estimates):
            if str(estimate.status) != SEARCHING:
                if estimate.joint_names != joint_names or estimate.limb_names != limb_names:
                    raise VoodooError(f"estimate {index}: expected the joints and limbs of the first one, found others")
                joints[index], poses[index] = estimate.joint_positions, estimate.limb_poses
            if len(estimate.joint_covariances) == len(joint_names):
                covariance[index] = estimate.joint_covariances
        angle_names, angles = angles_of_estimates(estimates, body)
        support = [estimate.limb_status for estimate in estimates]
        return cls(
            covariance=covariance if np.isfinite(covariance).any() else np.empty((len(estimates), 0, 3, 3)),
            root_covariance=np.array([estimate.root_covariance for estimate in estimates]),
            angle_sigma=angle_sigmas_of(estimates, angle_names),
            angle_names=angle_names,
            angles=angles,
            stamps=np.array([estimate.stamp for estimate in estimates], dtype=np.float64),
            status=tuple(str(estimate.status) for estimate in estimates),
            residual=np.array([estimate.residual for estimate in estimates], dtype=np.float64),
            joint_names=joint_names,
            joints=joints,
            limb_names=limb_names,
            world_from_limb=poses,
            limb_status={limb: tuple(str(words[limb]) if words else "" for words in support) for limb in limb_names},
            left_out=dict(left_out or {}),
        )

    @classmethod
    def joined(cls, tracks: Sequence[Track]) -> Track:
        """Concatenate consecutive tracks of the same body.

        Raises:
            VoodooError: no tracks.
        """
        if not tracks:
            raise VoodooError("tracks: expected at least one, found none")
        arrays: dict[str, Any] = {}
        for name in BY_FRAME:
            parts = [getattr(track, name) for track in tracks]
            shape = max((part.shape[1:] for part in parts), key=lambda one: one[0] if one else 0)
            # Without covariances there are no columns.
            parts = [part if part.shape[1:] == shape else np.full((len(part), *shape), np.nan) for part in parts]
            arrays[name] = np.concatenate(parts)
        limbs = tracks[0].limb_status
        words = {limb: tuple(word for track in tracks for word in track.limb_status[limb]) for limb in limbs}
        status = tuple(word for track in tracks for word in track.status)
        return replace(tracks[0], status=status, limb_status=words, **arrays)

    def save(self, path: str | Path) -> None:
        """Write .csv (positions to 1 um) or .npz (everything, exact); the file appears only when it is complete.

        Raises:
            VoodooError: another suffix.
            OSError: the file cannot be written.
        """
        save_result(path, lambda: iter([arrays_of(self)]))

    @classmethod
    def load(cls, path: str | Path) -> Track:
        """Read a file that save() wrote, or the only person of a result of several persons.

        Raises:
            VoodooError: another suffix, damage, a file of another kind, or several persons.
        """
        with opened_result(path) as content:
            tracks = tracks_of(content)
            if len(tracks) != 1:
                found = f"persons {', '.join(map(str, tracks))}; PeopleTrack.load reads them" if tracks else "nobody"
                raise VoodooError(f"expected the result of one person, found {found}")
            return next(iter(tracks.values()))


def arrays_of(
    rows: Track, persons: npt.NDArray[np.int64] | None = None, frame_stamps: FloatArray | None = None
) -> dict[str, npt.NDArray[Any]]:
    """All data of a result as arrays of numbers and words.

    Args:
        rows: of one person, or of several.
        persons: (R,) person of each row; None: 1.
        frame_stamps: (F,) [s] of all frames; None: a row is a frame.
    """
    limbs = np.array(list(rows.limb_status.values()), dtype=np.str_)
    return {name: np.array(getattr(rows, name), dtype=np.str_) for name in _WORDS} | {
        **{name: getattr(rows, name) for name in BY_FRAME},
        "person": np.ones(len(rows), dtype=np.int64) if persons is None else persons,
        "frame_stamps": rows.stamps if frame_stamps is None else frame_stamps,
        "format_version": np.array(FORMAT_VERSION),
        "limb_status_names": np.array(list(rows.limb_status), dtype=np.str_),
        "limb_status": limbs.reshape(len(rows.limb_status), len(rows)).T,
        **left_out_arrays(rows.left_out),
    }


def left_out_arrays(left_out: Mapping[str, int]) -> dict[str, npt.NDArray[Any]]:
    """The arrays of unusable measurements: reason -> number."""
    return {
        "left_out_reasons": np.array(list(left_out), dtype=np.str_),
        "left_out_counts": np.array(list(left_out.values()), dtype=np.int64),
    }


def rows_of(content: Arrays) -> Track:
    """All rows of such arrays, of one person or several.

    Raises:
        VoodooError: one is missing, or they do not belong together.
    """
    missing = [name for name in _ARRAYS if name not in content]
    if missing:
        raise VoodooError(f"expected the arrays {', '.join(_ARRAYS)}, found no {', '.join(missing)}")
    version = int(content["format_version"]) if "format_version" in content else 1
    if version > FORMAT_VERSION:
        raise VoodooError(
            f"format_version: expected {FORMAT_VERSION} at most, found {version}: a later voodoo wrote it"
        )
    fields: dict[str, Any] = {name: tuple(map(str, content[name])) for name in _WORDS if name in content}
    fields |= {name: content[name] for name in BY_FRAME if name in content}
    if "limb_status" in content:  # the first version does not have it
        limbs, words = map(str, content["limb_status_names"]), content["limb_status"].T.tolist()
        fields["limb_status"] = {limb: tuple(map(str, row)) for limb, row in zip(limbs, words, strict=True)}
    if "left_out_counts" in content:
        reasons, counts = map(str, content["left_out_reasons"]), content["left_out_counts"].tolist()
        fields["left_out"] = dict(zip(reasons, counts, strict=True))
    return Track(**fields)


def tracks_of(content: Arrays) -> dict[int, Track]:
    """The tracks in such arrays, by person.

    Raises:
        VoodooError: see `rows_of`.
    """
    rows = rows_of(content)
    persons = content["person"] if "person" in content else np.ones(len(rows), dtype=np.int64)
    return {int(one): rows.of_frames(persons == one) for one in np.unique(persons)}
