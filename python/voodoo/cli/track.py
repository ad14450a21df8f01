"""`voodoo track`."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Annotated, Any

import typer

from voodoo.cli import options
from voodoo.cli.common import print_interrupted, print_message, print_result, refuse_both, refuse_missing, states, wrote
from voodoo.cli.signals import deferred
from voodoo.errors import NoPoseError, VoodooError
from voodoo.names import SEARCHING

if TYPE_CHECKING:
    from voodoo.recordings.left_out import LeftOut
    from voodoo.recordings.recording import RecordingInfo


def track_command(
    *,
    context: typer.Context,
    recording: options.RecordingArgument,
    tracking: options.Tracking,
    out: options.OutOrNameOption = None,
    upright: Annotated[
        bool,
        typer.Option(
            "--upright",
            help="Put every result on the floor that is seen, else under the feet: z up, x forward, z = 0 on it.",
        ),
    ] = False,
    overlay: Annotated[
        Path | None, typer.Option(metavar="DIR|FILE.mp4", help="Draw the model over every frame: PNG files or a video.")
    ] = None,
    draw_regions: Annotated[
        bool,
        typer.Option(
            "--draw-regions", help="Also draw the color regions of the body and the color edges in --overlay."
        ),
    ] = False,
    view: options.ViewOption = False,
    save: Annotated[Path | None, typer.Option(metavar="FILE.rrd", help="Write the data of --view to a file.")] = None,
    with_: Annotated[
        list[Path] | None,
        typer.Option("--with", metavar="PATH", help="Another recording or .trc/.c3d of this scene; repeatable."),
    ] = None,
    offset: Annotated[float, typer.Option(metavar="S", help="Seconds to add to the stamps of --with.")] = 0.0,
    keypoints: options.KeypointsOption = None,
    marker_map: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="TOML that assigns the markers of .trc and .c3d files to sites."),
    ] = None,
    reading: options.Reading,
    background: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Images of the empty scene, CAMERA_0.png, ..., for color; by default background/ beside the recording.",
        ),
    ] = None,
    strict: options.StrictOption = False,
) -> None:
    """Find a person in a recording, track them, and write one row per frame.

    All inputs of the recording are used: depth images, point clouds, laser scans, 2-D keypoints, markers; with --use
    depth,skin also skin in color images. RECORDING may also be a Pose2Sim folder or a .trc or .c3d file.

    If there are only images of calibrated cameras (a bag, or a folder with videos and Calib*.toml), the color regions of the
    body are tracked; with other inputs, --use color does so. This needs a start: --init FILE, or a file beside the images.

    The start is that of the recording, if it has one. Otherwise a person is searched for in markers, keypoints of several
    cameras, keypoints with depth, depth images, or the legs in a laser, whichever the recording has. Until a person is found,
    and when the person has left, the status is searching and the coordinates are empty.

    The .csv has stamp_s, person (1), status, residual_m, then NAME_x, NAME_y, NAME_z in meters for every site, in
    the recording's root frame (base_link if it has one), NAME_rad for every joint angle, and LIMB_status, the status of every
    limb. The .npz adds the pose of every limb. Ctrl-C writes the frames so far and ends with exit code 130; after a
    crash, voodoo recover does.

    Unusable frames (a repeated or late stamp, a blank or undecodable image) are left out and have no row. They are counted by
    reason on stderr and in the .npz. With --strict the first one ends the command without a result.

    --init FILE gives the pose in the first frame, by any subset of names that determines it, or with stamp_s in a later frame:
    {"height_m": 1.76, "joints": {"l_shoulder": [3.1, -0.3, 1.4], "r_shoulder": [3.2, 0.1, 1.4], ...}}

    --people any or N tracks several persons, found in depth, keypoints or markers; no start is read. The .csv then has a row for
    every person who is present; person is an id from 1, which is kept when a person returns.
    The .npz, .glb and bags have all persons (frames body_p1, ...); others have one file per person: NAME_1.bvh, ...

    Examples

    voodoo track walk_bag/ --people any --out all.csv --overlay all.mp4

    voodoo track walk_bag/ --out walk.csv --overlay look.mp4

    voodoo track walk_bag/ --init auto --exclude 0.2,-0.4,0,1.1,0.4,1.2

    voodoo track a1_s1_t1_depth.mat --height 1.80 --out pose.npz --out pose.bvh --overlay look.mp4

    voodoo track four_videos/ --init start.json --background empty/ --out walk.csv

    voodoo track walk_bag/ --keypoints mediapipe --out walk.csv

    voodoo track walk_bag/ --keypoints /camera/color/image_raw=openpose/ --with markers.trc --save walk.rrd
    """
    from contextlib import ExitStack
    from dataclasses import replace

    from voodoo.cli.running import ParsedTracking, opened, refuse_unused, run, spool_of, turn_of
    from voodoo.export.files import upright_words
    from voodoo.export.upright import lying_words
    from voodoo.pipeline.floor import look
    from voodoo.pipeline.inputs import join, keypoint_words, loader_options
    from voodoo.pipeline.inspection import inspect
    from voodoo.pipeline.run import TrackedFrame, track
    from voodoo.pipeline.start import AUTO, starts_of, used_kinds
    from voodoo.pipeline.start import stature as stature_of
    from voodoo.recordings.left_out import LeftOut
    from voodoo.recordings.marker_files import MarkerMap
    from voodoo.visualization.rerun_viewer import Viewer

    refuse_both("--view", view or None, **{"--save": save})
    if offset and not with_:
        raise typer.BadParameter("--offset is for the stamps of --with, give both")
    start, layout, left_out = ParsedTracking.of(tracking), reading.layout, None if strict else LeftOut()
    several, bare = start.limit != 1, start.beginning is not None
    if draw_regions and overlay is None and not several:
        raise typer.BadParameter("--draw-regions is for --overlay, give both")
    markers = None if marker_map is None else MarkerMap.load(marker_map)
    numbers, others = options.numbers_of(reading.option), with_ or ()
    about: dict[str, Any] = {"markers": markers, "layout": layout, "numbers": numbers}
    asked = loader_options(recording, reading.loader, **about, use=start.options["use"])
    if background is not None:
        asked["background"] = background
    # A number that no other recording accepts belongs to this one, whose loader may reject it.
    taken = [loader_options(path, None, **{**about, "markers": None}) for path in others]
    asked |= {name: value for name, value in numbers.items() if not any(name in each for each in taken)}
    folders, network = keypoint_words(keypoints or (), layout)
    about |= {"left_out": left_out, "bare": bare}
    first = opened(recording, replace(reading, layout=None, option=None), left_out=left_out, bare=bare, **asked)
    source = join(first, keypoints=folders, network=network, others=others, offset=offset, **about)
    seen = inspect(first, left_out=left_out)
    for words in (*source.assumed, *(f"{source.name}: {doubt}" for doubt in seen.doubts)):
        print_message(words)
    for name, given in (("draw-regions", draw_regions), ("background", background)) if several else ():
        if given:
            raise VoodooError(f"{name}: expected none with --people any or N, it is for one person")
    used = start.settings(source)
    places = ("depth", "points", "scan")
    refuse_unused(
        used_kinds(source, used.use),
        depth_range=(tracking.depth_range, ("depth",)),
        detector=(tracking.detector, ("depth",)),
        exclude=(tracking.exclude, places),
        layout=(layout, ("keypoints",)),
        marker_map=(marker_map, ("markers",)),
        draw_regions=(draw_regions, ("color",)),
        background=(background, ("color",)),
    )
    with ExitStack() as stack:
        spool = stack.enter_context(spool_of(source, out, context, upright=upright))
        viewer = stack.enter_context(Viewer(save=save, name=source.name)) if view or save is not None else None
        how: dict[str, Any] = {"overlay": overlay, "save": save, "viewer": viewer, "left_out": left_out}
        settings = replace(used, draw_regions=draw_regions)
        tracker = start.tracker(source, markers=markers)
        starts = starts_of(start.beginning, source)
        steps = track(source, tracker, settings=settings, starts=starts, left_out=left_out)
        refusals: Counter[str] = Counter()

        def take(step: TrackedFrame[Any]) -> None:
            # What follows a colon are numbers, which differ in every frame.
            refusals.update([tracker.refusal.partition(":")[0]] if tracker.refusal else [])
            spool.add(step.estimate, step.front_end.bodies)

        with deferred():
            done = run(source, steps, take=take, **how)
            sample = spool.sample()
            turn = turn_of(source, sample, spool.paths, upright=upright, left_out=left_out)
            files, failed = spool.write(turn=turn, left_out=None if left_out is None else left_out.counts)
    turned = upright_words(files, turn, every=upright)
    if several:
        count, rows = len(spool.bodies), spool.states.total()
        found = f"{count} {'person' if count == 1 else 'persons'} in {rows} rows"
    else:
        found = states(spool.states)
    message = f"{spool.frames} frames, {found}{wrote([*files, *done.written])}"
    if turned:
        print_message(turned)
    refuse_missing([*failed, *done.failures], message)
    print_interrupted(done.interrupted, f"the rest of {len(source)} frames is missing: {message}")
    size = None if several or not spool.found else stature_of(tracker.body)
    if not several:
        message = "\n".join([message, *closing_lines(spool.states, done.seconds, source.info(), stature=size)])
    print_result(message, spool.paths)
    for remark in [words for one in sample if (words := lying_words(one, source.root_frame, turn))][:1]:
        print_message(f"{source.name}: {remark}")
    height_m = tracking.height or getattr(start.beginning, "height_m", None)
    if height_m is None and start.beginning is None and source.start is not None:
        height_m = source.start.get("height_m")
    # Frames before a given start are meant to be without a pose.
    begun = spool.states - Counter({SEARCHING: 0 if start.beginning in (None, AUTO) else len(source)})
    for remark in closing_remarks(begun, stature=size, height_m=height_m) if spool.found and not several else ():
        print_message(f"{source.name}: {remark}")
    _print_left_out(source.name, left_out)
    depth = "" if seen.first.depths is None else seen.first.depths.warning
    if depth and not {"tracking", "degraded"} & spool.states.keys():
        print_message(f"{source.name}: {depth}")
    if spool.found:
        return
    for words, count in refusals.most_common(1):
        print_message(f"{source.name}: what may be a person was seen in {count} frames and not tracked: {words}")
    kinds = used_kinds(source, used.use)
    # Who is excluded, or seen by a camera that is not used, is not who is missing.
    sight = (seen.sight or look(first, left_out=left_out)) if "depth" in kinds and not used.exclude else None
    words = nobody_words(
        spool.frames,
        stature=median(sight.statures) if sight is not None and sight.statures else None,
        doubted=bool(depth or seen.doubts),
        drawn=overlay is not None or not kinds & {"depth", "color"},
    )
    raise NoPoseError(f"{source.name}: {words}")


def _print_left_out(name: str, left_out: LeftOut | None) -> None:
    """Print on stderr what was left out of a recording, and what else to know."""
    if left_out is None:
        return
    for reason, count in left_out.counts.items():
        print_message(f"{name}: left out {count} {reason} (the first: {left_out.first[reason]}); --strict refuses them")
    for note in left_out.notes:
        print_message(f"{name}: {note}")


def nobody_words(frames: int, *, stature: float | None, doubted: bool, drawn: bool) -> str:
    """What is said where nobody was found: what was seen, and what to do.

    Args:
        frames: how many were searched.
        stature: of somebody whom the detector sees, wherever the cameras are [m].
        doubted: something was said to be unlikely.
        drawn: there are pictures of what was seen, or there is nothing to draw on.
    """
    words = f"nobody was found in {frames} frames"
    if stature is not None:
        unit = "are the unit of depth and the pose of the camera right?"
        return f"{words}, though depth shows somebody {stature:.2f} m tall: {unit}"
    if doubted:
        return f"{words}; what is doubted above may be the cause"
    return words if drawn else f"{words}; --overlay look.mp4 shows what the cameras see"


STATUS_PAGE = "docs/how-to/read-the-status.md"
_USUAL_M = (0.8, 2.1)
"""Statures from a small child to a tall adult."""
_STATURE_TOLERANCE = 0.06
"""A stature that differs from what was told by a larger fraction is doubted: sizes of limbs are found to some percent."""
_LEAST_TRACKING = 0.5


def closing_lines(
    states: Counter[str], seconds: Sequence[float], about: RecordingInfo, *, stature: float | None
) -> list[str]:
    """Stature, speed, root frame, and share of the frames by status (status -> frames)."""
    time = sum(seconds)
    parts = [] if stature is None else [f"stature {stature:.2f} m"]
    parts += [f"{len(seconds) / time:.0f} frames a second"] if time > 0.0 else []
    camera = " (a camera, not level)" if about.camera_root else ""
    shares = (f"{100 * count / states.total():.0f} % {word}" for word, count in states.items())
    return [
        "; ".join([*parts, f"root frame {about.root_frame}{camera}"]),
        f"{', '.join(shares)} ({STATUS_PAGE} says what that means)",
    ]


def closing_remarks(states: Counter[str], *, stature: float | None, height_m: float | None) -> list[str]:
    """What is unlikely in poses of these statuses (status -> frames); told: the stature that was given [m]."""
    remarks = []
    low, high = _USUAL_M
    if stature is not None and height_m is not None and abs(stature - height_m) > _STATURE_TOLERANCE * height_m:
        remarks.append(
            f"the stature is {stature:.2f} m, where {height_m:.2f} m was told: is the scale of depth or calibration right?"
        )
    elif stature is not None and height_m is None and not low <= stature <= high:
        remarks.append(
            f"the stature is {stature:.2f} m, which few people have ({low} to {high} m): is the scale right?"
        )
    share = states["tracking"] / states.total()
    if share <= _LEAST_TRACKING:
        remarks.append(
            f"only {100 * share:.0f} % of the frames are tracking: look at --overlay look.mp4, and see {STATUS_PAGE}"
        )
    return remarks
