"""`voodoo live`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from voodoo.cli import options
from voodoo.cli.common import print_message, print_text, refuse_both
from voodoo.cli.signals import INTERRUPTED
from voodoo.errors import NoPoseError, VoodooError


def live_command(
    *,
    sources: Annotated[
        list[str],
        typer.Argument(
            metavar="SOURCE...",
            help="realsense[:SERIAL], oak[:ID], orbbec[:SERIAL|:FILE.bag], ros2:TOPIC[,TOPIC...], grow:FOLDER, or a "
            "recording to play.",
        ),
    ],
    tracking: options.Tracking,
    outputs: options.Outputs,
    duration: Annotated[float | None, typer.Option(metavar="S", min=0.0, help="End after this time.")] = None,
    rate: Annotated[float, typer.Option(metavar="N", help="Speed factor for a recording.")] = 1.0,
    loop: Annotated[bool, typer.Option("--loop", help="Repeat a recording.")] = False,
    calibration: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE.toml", help="Pose of a camera (root_frame, root_from_sensor): one for each SOURCE, in order."
        ),
    ] = None,
    reading: options.Reading,
    keypoints: options.KeypointsOption = None,
) -> None:
    """Track live measurements of a source: always the newest frame; frames that arrive too fast are dropped and counted.

    Ends after --duration, with the recording, or with Ctrl-C, SIGTERM or SIGHUP; then files are completed.
    Every second a line on stderr has rate, latency, drops and the status of each person.
    Faults of the source are reported there and counted.

    voodoo live ros2: prints the topics that are published, with type and rate. A message on /voodoo/reset (std_msgs/Empty)
    forgets everybody and searches again; one on /voodoo/follow (geometry_msgs/PointStamped) chooses the person there.

    Examples

    voodoo live walk_bag/ --rate 1 --out walk.csv --report walk.json

    voodoo live realsense --out pose.csv --record take1.mcap

    voodoo live realsense --to vmc://192.168.1.20 --to ws://

    voodoo live ros2:/camera/depth/image_rect_raw --people any --report live.json
    """
    from dataclasses import replace

    from voodoo.cli.live_run import run
    from voodoo.cli.recover import recover_before
    from voodoo.cli.running import ParsedTracking
    from voodoo.export.files import STDOUT, check_target
    from voodoo.live import open as open_live
    from voodoo.live.sources.words import refuse_unused
    from voodoo.pipeline.inputs import keypoint_words

    refuse_both("--view", outputs.view or None, **{"--serve": outputs.serve})
    if list(sources) == ["ros2:"]:
        from voodoo.live.sources.ros2 import listing

        print_text("\n".join(listing() or ["nothing is published on this network"]))
        return
    for target in outputs.out or ():
        check_target(target)
    start = ParsedTracking.of(tracking)
    if outputs.publish is None:
        outputs = replace(outputs, publish=any(source.startswith("ros2:") for source in sources))
    folders, network = keypoint_words(keypoints or (), reading.layout)
    if folders:
        raise VoodooError(f"keypoints: expected a network, found a folder, for {', '.join(folders)}")
    words = replace(reading, frame=None, layout=reading.layout if network is None else None).words()
    given = {"frame": reading.frame, "rate": None if rate == 1.0 else rate, "loop": loop or None, **words}
    refuse_unused(sources, {name: value for name, value in given.items() if value is not None})
    how: dict[str, Any] = {"rate": rate, "loop": loop, "root_frame": reading.frame}
    how |= {"options": words, "calibrations": calibration or (), "network": network}
    source = open_live(*sources, on_message=print_message, eager=start.limit == 1, **how)
    recover_before([*(outputs.out or ()), *([outputs.record] if outputs.record is not None else [])])
    written, ended, with_pose = run(source, start, outputs, duration=duration)
    for path in written:
        if path != STDOUT:
            print_message(f"wrote {path}")
    if ended:
        raise typer.Exit(INTERRUPTED)
    if not with_pose:
        raise NoPoseError("not one pose was published: nothing could be used, or nobody was found")
