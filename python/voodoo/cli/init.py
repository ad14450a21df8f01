"""`voodoo init`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from voodoo.cli import options
from voodoo.errors import NoPoseError, VoodooError


def init_command(
    *,
    recording: options.RecordingArgument,
    at: Annotated[
        float | None,
        typer.Option(
            metavar="S",
            help="Search from this time on: seconds after the first frame, or a stamp. By default from the first frame.",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="File to write; by default stdout.")] = None,
    human: options.Human,
    config: options.ConfigOption = None,
    use: options.UseOption = None,
    exclude: options.ExcludeOption = None,
    reading: options.Reading,
) -> None:
    """Find the first pose and write it as JSON for --init of voodoo track.

    It is the pose in the first frame at or after S in which a person is found: joints in meters in the recording's root frame,
    its name, the stature, and the stamp. A start, truth or reference beside the recording is not read. If the pose is wrong, edit
    the file before giving it to voodoo track. Exit code 3 if no person is found.

    Examples

    voodoo init walk_bag/

    voodoo init walk_bag/ --at 2.5 --out start.json
    """
    from dataclasses import replace

    from voodoo.cli.running import boxes_of, config_of, kinds_of, opened
    from voodoo.pipeline.run import first_pose
    from voodoo.pipeline.start import AUTO, pose_as_init, start_tracker
    from voodoo.recordings.left_out import LeftOut
    from voodoo.sensors.settings import FrontEndSettings
    from voodoo.whole import write_whole

    kinds, boxes = kinds_of(use), boxes_of(exclude)
    left_out = LeftOut()
    source = opened(recording, reading, bare=True, left_out=left_out)
    about = source.info()
    after = about.start_stamp
    if at is not None:
        after = at if at > about.duration else about.start_stamp + at
        if not about.start_stamp <= after <= about.start_stamp + about.duration:
            raise VoodooError(
                f"--at: expected 0 to {about.duration:.3f} s, or a stamp from {about.start_stamp:.3f} s on, found {at}"
            )
    tracker = start_tracker(source, init=AUTO, **human.start(), config=config_of(config), use=kinds)
    settings = replace(FrontEndSettings.of(source, use=kinds), exclude=boxes)
    estimate = first_pose(source, tracker, settings=settings, after=after, left_out=left_out)
    if estimate is None:
        raise NoPoseError(f"{source.name}: expected somebody from {after:.3f} s on, found nobody")
    text = pose_as_init(estimate, tracker.body, frame=source.root_frame).to_json()
    if out is None:
        typer.echo(text)
    else:
        write_whole(out, text + "\n")
        typer.echo(f"{source.name}: pose at {estimate.stamp:.3f} s; wrote {out}")
