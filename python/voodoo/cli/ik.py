"""`voodoo ik`."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated, Any

import typer

from voodoo.cli import options
from voodoo.cli.common import print_interrupted, print_message, print_result, refuse_missing, states, wrote
from voodoo.cli.signals import deferred
from voodoo.errors import NoPoseError


def ik_command(
    *,
    context: typer.Context,
    recording: options.RecordingArgument,
    targets: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Known positions: a result of voodoo track. By default the reference's."),
    ] = None,
    sites: Annotated[
        str | None,
        typer.Option(metavar="NAME,...", help="The known sites: by default head, trunk, hands (or wrists), ankles."),
    ] = None,
    pictures: Annotated[
        str, typer.Option(metavar="WORD", help="Silhouettes from: depth, color (still background), regions, or none.")
    ] = "depth",
    alone: Annotated[
        bool,
        typer.Option("--alone", help="Solve every frame independently from the first pose, not from the previous one."),
    ] = False,
    rest: Annotated[
        bool,
        typer.Option(
            "--rest/--no-rest",
            help="Regularize undetermined angles to the mean of the postures so far, or keep them (not with --alone).",
        ),
    ] = True,
    init: options.InitOption = None,
    human: options.Human,
    out: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help=f"{options.RESULTS}; by default NAME_ik.csv.",
        ),
    ] = None,
    reading: options.Reading,
) -> None:
    """Compute postures and joint angles from a few known sites and the person's silhouettes (inverse kinematics).

    The .csv has the columns of voodoo track, with the six of the root before the other NAME_rad; the other formats are those of
    voodoo track, too. Other sites are compared with the reference, if it has them. Ctrl-C writes the
    frames up to there and ends with exit code 130; after a crash, voodoo recover does.

    Examples

    voodoo ik walk_bag/ --pictures none

    voodoo ik walk_bag/ --targets pose.npz --sites head_center,l_shoulder,r_shoulder,l_hip,r_hip,l_hand --out pose.bvh
    """
    from voodoo.cli.running import opened, run, spool_of, turn_of
    from voodoo.export.files import upright_words
    from voodoo.export.track import Track
    from voodoo.people import ONE
    from voodoo.pipeline.ik import Solved, follow, known_positions
    from voodoo.pipeline.run import first_pose
    from voodoo.pipeline.start import beginning_of, start_tracker, starts_of

    beginning = beginning_of(init)
    source = opened(recording, reading)
    with spool_of(source, out, context, suffix="_ik.csv") as spool:
        positions = known_positions(source, None if targets is None else Track.load(targets))
        tracker = start_tracker(source, init=beginning, **human.start())
        if not tracker.estimate.joints and first_pose(source, tracker, starts=starts_of(beginning, source)) is None:
            raise NoPoseError(
                f"{source.name}: expected somebody to start from, found nobody; give a pose with --init FILE"
            )
        known = None if sites is None else tuple(name.strip() for name in sites.split(","))
        how: Any = {"sites": known, "pictures": pictures, "warm": not alone, "rest": rest}
        errors: Counter[str] = Counter()
        compared: Counter[str] = Counter()

        def take(step: Solved) -> None:
            errors.update(step.errors)
            compared.update(step.errors.keys())
            spool.add(step.track, {ONE: tracker.body})

        steps = follow(source, tracker, positions, **how)
        with deferred():
            done = run(source, steps, take=take)
            turn = turn_of(source, spool.sample(), spool.paths)
            written, failed = spool.write(turn=turn)
    for name, count in compared.items():
        print_result(f"{name:<14} {1e3 * errors[name] / count:6.1f} mm mean error", spool.paths)
    message = f"{spool.frames} frames, {states(spool.states)}{wrote(written)}"
    refuse_missing([*failed, *done.failures], message)
    print_interrupted(done.interrupted, f"the rest of {len(source)} frames is missing: {message}")
    print_result(message, spool.paths)
    if words := upright_words(written, turn):
        print_message(words)
