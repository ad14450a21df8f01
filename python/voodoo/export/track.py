"""The result of a whole recording, and its files: one row per frame in .csv, arrays in .npz."""

from __future__ import annotations

import csv
import zipfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate
from voodoo.errors import VoodooError, a_path, naming, reading
from voodoo.export.collected import angle_sigmas_of, angles_of_estimates, covariances_of
from voodoo.export.people_rows import PeopleRows, cells, header_of, is_people_file, read_cells, read_rows
from voodoo.export.result_file import check_suffix
from voodoo.model.body import Body
from voodoo.names import SEARCHING
from voodoo.unpacking import stored_arrays
from voodoo.whole import appearing_whole

FloatArray: TypeAlias = npt.NDArray[np.float64]
Arrays: TypeAlias = Mapping[str, npt.NDArray[Any]]

_ARRAYS = ("stamps", "status", "residual", "joint_names", "joints", "limb_names", "world_from_limb")
FORMAT_VERSION = 2
"""Version of the .npz format. It is increased if earlier readers would misread a file, not for additional arrays."""
BODIES, BODY_OF = "bodies", "body_of"
"""Arrays of a part that are not those of a result: texts of bodies, and the persons whose they are."""
_FIRST = ("stamp_s", "status", "residual_m")
"""The first columns of .csv."""
_STATUS = "_status"
"""Suffix of the name of a limb's column in .csv."""
_SIGMA = "_sigma_m"
"""Suffix of the name of a joint's column in .csv."""
_UNKNOWN = ("angle_sigma", "covariance", "root_covariance")
"""Arrays that may be unknown in frames with a pose."""
_WORDS = ("status", "joint_names", "limb_names", "angle_names")
BY_FRAME = ("stamps", "residual", "joints", "world_from_limb", "angles", *_UNKNOWN)


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
        frames, joints, limbs = len(self.stamps), len(self.joint_names), len(self.limb_names)
        missing = {"covariance": (0, 3, 3), "angle_sigma": (0,), "root_covariance": (6, 6), "angles": (0,)}
        for name, size in missing.items():
            if not (self.angle_names if name == "angles" else getattr(self, name).size):
                object.__setattr__(self, name, np.full((frames, *size), np.nan))
        if len(self.status) != frames:
            raise VoodooError(f"status: expected {frames} entries, found {len(self.status)}")
        for limb, words in self.limb_status.items():
            if len(words) != frames:
                raise VoodooError(f"limb_status[{limb}]: expected {frames} entries, found {len(words)}")
        expected = {
            "angles": (frames, len(self.angle_names)),
            "stamps": (frames,),
            "residual": (frames,),
            "joints": (frames, joints, 3),
            "world_from_limb": (frames, limbs, 4, 4),
            "covariance": (frames, joints if self.covariance.size else 0, 3, 3),
            "root_covariance": (frames, 6, 6),
            "angle_sigma": (frames, len(self.angle_names) if self.angle_sigma.size else 0),
        }
        for name, shape in expected.items():
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
        searching = ~self.found.reshape(-1, *[1] * (array.ndim - 1))
        finite = np.isfinite(array)
        if name == "stamps":
            right = finite
        elif name == "residual":
            # A lost or extrapolated frame may have no measurements to compute a residual from.
            right = finite | np.array([status in ("lost", "degraded") for status in self.status], dtype=bool)
            right = np.where(searching, np.isnan(array), right)
        else:
            right = np.where(searching, np.isnan(array), finite)
        if not right.all():
            where = tuple(int(index) for index in np.argwhere(~right)[0])
            what = (
                "NaN while searching" if self.status[where[0]] == SEARCHING and name != "stamps" else "finite numbers"
            )
            raise VoodooError(f"{name}: expected {what}, found {array[where]} in frame {where[0]}")

    @property
    def found(self) -> npt.NDArray[np.bool_]:
        """Which frames (F,) have a pose: all but the searching ones."""
        return np.array([status != SEARCHING for status in self.status], dtype=bool)

    @property
    def joint_sigma(self) -> FloatArray:
        """Root mean square (F, J) of the standard deviations of each joint's x, y and z [m]; (F, 0) without covariances."""
        return np.asarray(np.sqrt(np.trace(self.covariance, axis1=2, axis2=3) / 3.0))

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
        for index, estimate in enumerate(estimates):
            if str(estimate.status) != SEARCHING:
                if estimate.joint_names != joint_names or estimate.limb_names != limb_names:
                    raise VoodooError(f"estimate {index}: expected the joints and limbs of the first one, found others")
                joints[index], poses[index] = estimate.joint_positions, estimate.limb_poses
        angle_names, angles = angles_of_estimates(estimates, body)
        covariance, root_covariance = covariances_of(estimates, joint_names, limb_names)
        support = [estimate.limb_status for estimate in estimates]
        return cls(
            covariance=covariance,
            root_covariance=root_covariance,
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
        sure = self.covariance.size > 0
        save_result(path, lambda part: write_csv(part, [self], sure=sure), lambda: arrays_of(self))

    @classmethod
    def load(cls, path: str | Path) -> Track:
        """Read a file that save() wrote, or the only person of a result of several persons.

        Raises:
            VoodooError: another suffix, damage, a file of another kind, or several persons.
        """
        path = a_path(path, error=VoodooError)
        check_suffix(path)
        if is_people_file(path):
            return _only_person(path)
        with reading(path, "a result of voodoo track"), naming(path, VoodooError):
            if path.suffix == ".csv":
                rows, others = read_cells(path, _FIRST, more=True)
                limbs = {name.removesuffix(_STATUS): words for name, words in others.items() if name.endswith(_STATUS)}
                return replace(track_of_rows(rows, 1), limb_status=limbs)
            with stored_arrays(path, "a result of voodoo track") as content:
                return track_of(content)


def save_result(path: str | Path, write: Callable[[Path], None], arrays: Callable[[], Arrays]) -> None:
    """Write a result as .csv, by `write`, or as .npz of its arrays; the file appears only when it is complete.

    Raises:
        VoodooError: another suffix.
        OSError: the file cannot be written.
    """
    path = Path(path)
    check_suffix(path)
    with appearing_whole(path) as part:
        if path.suffix == ".csv":
            write(part)
        else:
            write_arrays(part, lambda: iter([arrays()]))


def write_csv(path: Path, parts: Iterable[Track], *, sure: bool) -> None:
    """Write consecutive parts of a track as rows; `sure`: one of them has covariances."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        for number, part in enumerate(parts):
            if not number:
                limbs = [f"{limb}{_STATUS}" for limb in part.limb_status]
                sigmas_of = [f"{name}{_SIGMA}" for name in part.joint_names if sure]
                writer.writerow(header_of(_FIRST, part.joint_names, part.angle_names) + limbs + sigmas_of)
            words = zip(*part.limb_status.values(), strict=True) if limbs else [()] * len(part)
            sigmas = np.full((len(part), len(sigmas_of)), np.nan)
            if part.covariance.size:
                sigmas = part.joint_sigma
            for stamp, status, residual, joints, angles, support, sigma in zip(
                part.stamps, part.status, part.residual, part.joints, part.angles, words, sigmas, strict=True
            ):
                # repr keeps stamps in epoch seconds exact; six digits of a meter are enough for the rest.
                row = [repr(float(stamp)), status, *cells((residual, *joints.ravel(), *angles))]
                writer.writerow([*row, *support, *cells(sigma)])


def write_arrays(path: Path, parts: Callable[[], Iterator[Arrays]], fixed: Arrays | None = None) -> None:
    """Write the arrays of consecutive parts of a result as one .npz; a part is in memory at a time.

    Args:
        path: the file.
        parts: returns their arrays, from the first part on.
        fixed: arrays that are not those of the first part that has them, or that no part has.
    """
    kinds: dict[str, tuple[int, tuple[int, ...], np.dtype[Any]]] = {}
    rest: dict[str, npt.NDArray[Any]] = {}
    for part in parts():
        for name in part:
            if name in (BODIES, BODY_OF):
                continue
            array = part[name]
            if name.rpartition("/")[2] in (*BY_FRAME, "status", "limb_status"):
                count, row, kind = kinds.get(name, (0, array.shape[1:], array.dtype))
                # Without covariances there are no columns.
                kinds[name] = count + len(array), max(row, array.shape[1:]), np.result_type(kind, array.dtype)
            else:
                rest.setdefault(name, array)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, array in {**rest, **(fixed or {})}.items():
            with file.open(f"{name}.npy", "w", force_zip64=True) as out:
                np.lib.format.write_array(out, array, allow_pickle=False)
        for name, (count, row, kind) in kinds.items():
            about = {"descr": np.lib.format.dtype_to_descr(kind), "fortran_order": False, "shape": (count, *row)}
            with file.open(f"{name}.npy", "w", force_zip64=True) as out:
                np.lib.format.write_array_header_1_0(out, about)
                for part in parts():
                    if name in part:
                        array = part[name]
                        filled = array if array.shape[1:] == row else np.full((len(array), *row), np.nan)
                        out.write(filled.astype(kind).tobytes())


def arrays_of(track: Track) -> dict[str, npt.NDArray[Any]]:
    """All data of a track as arrays of numbers and words, for .npz."""
    limbs = np.array(list(track.limb_status.values()), dtype=np.str_)
    return {name: np.array(getattr(track, name), dtype=np.str_) for name in _WORDS} | {
        **{name: getattr(track, name) for name in BY_FRAME},
        "format_version": np.array(FORMAT_VERSION),
        "limb_status_names": np.array(list(track.limb_status), dtype=np.str_),
        "limb_status": limbs.reshape(len(track.limb_status), len(track)).T,
        "left_out_reasons": np.array(list(track.left_out), dtype=np.str_),
        "left_out_counts": np.array(list(track.left_out.values()), dtype=np.int64),
    }


def track_of(content: Mapping[str, npt.NDArray[Any]]) -> Track:
    """The track of such arrays.

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
    words = {name: tuple(map(str, content[name])) for name in _WORDS if name in content}
    arrays = {name: content[name] for name in BY_FRAME if name in content}
    return Track(**words, **arrays, **_optional_fields(content))  # type: ignore[arg-type]


def track_of_rows(rows: PeopleRows, person: int) -> Track:
    """The rows of one person."""
    own = np.flatnonzero(rows.persons == person)
    return Track(
        stamps=rows.stamps[own],
        status=tuple(rows.status[index] for index in own),
        residual=rows.residual[own],
        joint_names=rows.joint_names,
        joints=rows.joints[own],
        limb_names=(),
        world_from_limb=np.empty((len(own), 0, 4, 4)),
        angle_names=rows.angle_names,
        angles=rows.angles[own],
    )


def tracks_of(content: Mapping[str, npt.NDArray[Any]]) -> dict[int, Track]:
    """The tracks of an .npz of several people, by person."""
    tracks = {}
    for one in content["persons"].tolist():
        prefix = f"person_{one}/"
        own = {name.removeprefix(prefix): content[name] for name in content if name.startswith(prefix)}
        tracks[int(one)] = track_of(own)
    return tracks


def read_persons(path: Path) -> tuple[FloatArray, dict[int, Track]]:
    """The stamps in a result of several people, and the tracks by person; see `PeopleTrack.load`."""
    if path.suffix == ".csv":
        rows = read_rows(path)
        return np.unique(rows.stamps), {one: track_of_rows(rows, one) for one in np.unique(rows.persons).tolist()}
    with stored_arrays(path, "a result of voodoo track --people") as content:
        if "persons" not in content:
            raise VoodooError(f"{path}: expected a result of several people, found one of another kind")
        return content["stamps"], tracks_of(content)


def _only_person(path: Path) -> Track:
    """The track in a result of several people that holds one."""
    _, tracks = read_persons(path)
    if len(tracks) != 1:
        found = ", ".join(str(one) for one in tracks) or "nobody"
        raise VoodooError(f"{path}: expected the result of one person, found persons {found}")
    return next(iter(tracks.values()))


def _optional_fields(content: Mapping[str, npt.NDArray[Any]]) -> dict[str, Any]:
    """Status of the limbs, and left-out measurements, if the file has them; the first version does not."""
    if "limb_status" not in content or "left_out_counts" not in content:
        return {}
    words = content["limb_status"].T.tolist()
    limbs, reasons = content["limb_status_names"].tolist(), content["left_out_reasons"].tolist()
    counts = content["left_out_counts"].tolist()
    return {
        "limb_status": {str(limb): tuple(map(str, row)) for limb, row in zip(limbs, words, strict=True)},
        "left_out": {str(reason): int(count) for reason, count in zip(reasons, counts, strict=True)},
    }
