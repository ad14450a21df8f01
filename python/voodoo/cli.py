"""The command line. Every command is a few calls of the package; nothing is computed here."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Annotated, Any, TypeVar

import numpy as np
import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

import voodoo
from voodoo.errors import VoodooError
from voodoo.export.files import check_target
from voodoo.export.files import save as export
from voodoo.inputs import join, keypoint_folders, loader_options
from voodoo.keypoint_layouts import LAYOUTS
from voodoo.overlay import Overlay, contact_sheet
from voodoo.overlay_inputs import Picture
from voodoo.picture_writer import PictureWriter, save_picture
from voodoo.recordings import LOADERS, Recording, open_recording, sample_path
from voodoo.recordings.marker_files import MarkerMap
from voodoo.results import Track
from voodoo.running import HumanModel, Init, start_tracker, track
from voodoo.sensors.front_end import INPUTS, FrontEndSettings
from voodoo.view import Viewer

T = TypeVar("T")

app = typer.Typer(
    name="voodoo",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

_RecordingArgument = Annotated[
    Path, typer.Argument(metavar="RECORDING", help="ROS bag, UTD-MHAD *_depth.mat, Pose2Sim or PNG folder, .trc, .c3d.")
]
_LoaderOption = Annotated[
    str | None, typer.Option("--loader", metavar="NAME", help=f"Instead of a guess: {', '.join(LOADERS)}.")
]
_ConfigOption = Annotated[
    Path | None, typer.Option("--config", metavar="FILE", help="Settings as TOML; `voodoo config` prints all of them.")
]
_BodyOption = Annotated[
    Path | None, typer.Option("--body", metavar="FILE", help="What to track, as TOML; `voodoo body` prints the human.")
]
_HeightOption = Annotated[
    float | None,
    typer.Option("--height", metavar="M", min=0.3, max=3.0, help="Stature of the default human in metres."),
]
_ModelOption = Annotated[
    HumanModel,
    typer.Option("--model", help="The default human: of eighteen limbs (full), or of the papers' ten."),
]
_FrameOption = Annotated[
    str | None,
    typer.Option("--frame", metavar="NAME", help="Root frame of the result, instead of the recording's own."),
]
_UseOption = Annotated[
    str | None,
    typer.Option("--use", metavar="KIND,...", help=f"Inputs to use, by default all there are: {', '.join(INPUTS)}."),
]


def main() -> None:
    """Entry point of the `voodoo` command."""
    app()


def _show_version(wanted: bool) -> None:
    if wanted:
        try:
            typer.echo(f"voodoo {version('voodoo')}")
        except PackageNotFoundError:
            typer.echo("voodoo (not installed)")
        raise typer.Exit


@app.callback()
def voodoo_command(
    show_version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Follow a person's pose through depth, laser and point cloud recordings, on a plain CPU.

    Try [bold]voodoo demo[/bold] first; then [bold]voodoo info RECORDING[/bold] and
    [bold]voodoo track RECORDING --out pose.csv --overlay look.mp4[/bold].
    """


@app.command("track")
def track_command(
    recording: _RecordingArgument,
    init: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="First pose as JSON; not needed when the recording brings one."),
    ] = None,
    body: _BodyOption = None,
    height: _HeightOption = None,
    model: _ModelOption = "full",
    config: _ConfigOption = None,
    out: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="Result: .csv, .npz, .bvh, .trc, .mcap, or a folder (ROS 2 bag); repeatable; by default NAME.csv.",
        ),
    ] = None,
    overlay: Annotated[
        Path | None, typer.Option(metavar="DIR|FILE.mp4", help="Draw the model over every frame: PNG files or a film.")
    ] = None,
    view: Annotated[
        bool, typer.Option("--view", help="Show every step in Rerun (pip install voodoo\\[view]).")
    ] = False,
    save: Annotated[
        Path | None, typer.Option(metavar="FILE.rrd", help="Write what --view shows to a file, to open elsewhere.")
    ] = None,
    use: _UseOption = None,
    with_: Annotated[
        list[Path] | None,
        typer.Option("--with", metavar="PATH", help="Another recording or .trc/.c3d of this scene; repeatable."),
    ] = None,
    offset: Annotated[float, typer.Option(metavar="S", help="Seconds to add to the stamps of --with.")] = 0.0,
    keypoints: Annotated[
        list[str] | None,
        typer.Option(metavar="SENSOR=DIR", help="OpenPose JSON files, one for each image of SENSOR; repeatable."),
    ] = None,
    layout: Annotated[str, typer.Option(metavar="NAME", help=f"Of all keypoints: {', '.join(LAYOUTS)}.")] = "body25b",
    marker_map: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="TOML: which sites the markers of .trc and .c3d files stand for."),
    ] = None,
    frame: _FrameOption = None,
    loader: _LoaderOption = None,
) -> None:
    """Track the body through a recording and write one row a frame.

    All inputs the recording has are used: depth images, point clouds, laser scans, skin in colour images, 2-D
    keypoints, markers. RECORDING may also be a Pose2Sim folder or a .trc or .c3d file.

    The .csv has stamp_s, status, residual_m, then NAME_x, NAME_y, NAME_z in metres for every joint and site, in the
    recording's root frame (base_link if it has one), and NAME_rad for every joint angle. The .npz adds the pose of
    every limb.

    --init gives the pose in the first frame, by any subset of names that fixes it:
    [cyan]{"height_m": 1.76, "joints": {"l_shoulder": \\[3.1, -0.3, 1.4], "r_shoulder": \\[3.2, 0.1, 1.4], ...}}[/cyan]

    [bold]Examples[/bold]

    voodoo track walk_bag/ --init start.json --out walk.csv

    voodoo track a1_s1_t1_depth.mat --height 1.80 --out pose.npz --out pose.bvh --overlay look.mp4

    voodoo track walk_bag/ --keypoints /camera/color/image_raw=openpose/ --with markers.trc --save walk.rrd
    """
    with _clear_errors():
        if body is not None and height is not None:
            raise typer.BadParameter("give --body or --height, not both")
        if view and save is not None:
            raise typer.BadParameter("give --view or --save, not both")
        kinds = _kinds(use)
        markers = None if marker_map is None else MarkerMap.load(marker_map)
        source = join(
            _open(recording, loader, frame, **loader_options(recording, loader, markers=markers, layout=layout)),
            keypoints=keypoint_folders(keypoints or ()),
            layout=layout,
            others=with_ or (),
            offset=offset,
            markers=markers,
        )
        targets = out or [Path(f"{source.name}.csv")]
        for target in targets:
            check_target(target)
        tracker = start_tracker(
            source,
            init=None if init is None else Init.load(init),
            body=None if body is None else voodoo.Body.load(body),
            height=height,
            model=model,
            config=_config(config),
            markers=markers,
        )
        with _viewer(view, save, source.name) as viewer:
            settings = FrontEndSettings.of(source, use=kinds)
            result, _, _ = _run(source, tracker, overlay, settings=settings, viewer=viewer)
        for target in targets:
            export(result, target, body=tracker.body, root_frame=source.root_frame)
        written = [str(path) for path in (*targets, overlay, save) if path is not None]
        typer.echo(f"{len(result)} frames, {_states(result)}; wrote {' and '.join(written)}")


@app.command("demo")
def demo_command(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for result and pictures.")] = Path("voodoo-demo"),
) -> None:
    """Run the main job on the bundled recording, a person who bends, scoops and reaches up.

    Writes pose.csv, overlay.mp4 and sheet.png and compares the pose with the recording's exact truth.
    """
    from voodoo.evaluate import compare

    with _clear_errors():
        source = open_recording(sample_path())
        tracker = start_tracker(source)
        out.mkdir(parents=True, exist_ok=True)
        result, seconds, sheet = _run(source, tracker, out / "overlay.mp4", sheet=6)
        result.save(out / "pose.csv")
        save_picture(out / "sheet.png", contact_sheet(sheet, columns=3))
        errors = compare(source, result)
        typer.echo(f"{source.name}: {len(result)} frames, {_states(result)}")
        typer.echo(
            f"time of a frame   {1e3 * np.mean(seconds):.2f} ms (mean), {1e3 * np.median(seconds):.2f} ms (median)"
        )
        typer.echo(f"mean joint error  {100 * np.nanmean(errors):.1f} cm against exact truth, twelve joints")
        typer.echo(f"wrote             {out / 'pose.csv'}, {out / 'overlay.mp4'}, {out / 'sheet.png'}")


@app.command("ik")
def ik_command(
    recording: _RecordingArgument,
    targets: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Known positions: a result of voodoo track. By default the reference's."),
    ] = None,
    sites: Annotated[
        str | None,
        typer.Option(
            metavar="NAME,...", help="The sites that are known: by default head, trunk, hands (or wrists), ankles."
        ),
    ] = None,
    pictures: Annotated[
        str, typer.Option(metavar="WORD", help="Silhouettes from: depth, color (still background), or none (plain).")
    ] = "depth",
    alone: Annotated[
        bool, typer.Option("--alone", help="Solve every frame by itself, from the first pose, not from the one before.")
    ] = False,
    init: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="First pose as JSON; not needed when the recording brings one."),
    ] = None,
    body: _BodyOption = None,
    height: _HeightOption = None,
    model: _ModelOption = "full",
    out: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="FILE",
            help="Result: .csv, .npz, .bvh, .trc, .mcap, or a folder (ROS 2 bag); repeatable; by default NAME_ik.csv.",
        ),
    ] = None,
    frame: _FrameOption = None,
    loader: _LoaderOption = None,
) -> None:
    """Find postures and joint angles from a few known sites and the person's silhouettes (inverse kinematics).

    The .csv has the columns of voodoo track, its NAME_rad led by the six of the root; the other formats are those of voodoo
    track, too. Sites that are not among the known ones are compared with the reference, if it has them.

    [bold]Examples[/bold]

    voodoo ik walk_bag/ --pictures none

    voodoo ik walk_bag/ --targets pose.npz --sites head_center,l_shoulder,r_shoulder,l_hip,r_hip,l_hand --out pose.bvh
    """
    from voodoo.ik_recording import Positions, follow

    with _clear_errors():
        if body is not None and height is not None:
            raise typer.BadParameter("give --body or --height, not both")
        source = _open(recording, loader, frame)
        written = out or [Path(f"{source.name}_ik.csv")]
        for file in written:
            check_target(file)
        positions = Positions.of(source, None if targets is None else Track.load(targets))
        tracker = start_tracker(
            source,
            init=None if init is None else Init.load(init),
            body=None if body is None else voodoo.Body.load(body),
            height=height,
            model=model,
        )
        known = None if sites is None else tuple(name.strip() for name in sites.split(","))
        how: Any = {"sites": known, "pictures": pictures, "warm": not alone}
        result, errors = follow(source, tracker, positions, **how)
        for file in written:
            export(result, file, body=tracker.body, root_frame=source.root_frame)
        for name, values in errors.items():
            if np.isfinite(values).any():
                typer.echo(f"{name:<14} {1e3 * np.nanmean(values):6.1f} mm mean error")
        typer.echo(f"{len(result)} frames, {_states(result)}; wrote {' and '.join(map(str, written))}")


@app.command("eval")
def eval_command(
    recordings: Annotated[
        list[Path], typer.Argument(metavar="RECORDING...", help="Recordings, or folders that hold some.")
    ],
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for tables and plot.")] = None,
    config: _ConfigOption = None,
    jobs: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Recordings at the same time; by default one for each core.")
    ] = None,
    only: Annotated[
        list[str] | None, typer.Option(metavar="GLOB", help="Only recordings whose name fits, e.g. 'a0?_s1_*'.")
    ] = None,
    model: _ModelOption = "full",
    use: _UseOption = None,
    depth_only: Annotated[bool, typer.Option("--depth-only", help="The same as --use depth.")] = False,
    ablation: Annotated[
        bool, typer.Option("--ablate", help="Once for every switch turned over: what each of them buys.")
    ] = False,
    loader: _LoaderOption = None,
) -> None:
    """Track recordings that bring a truth or a reference skeleton, and measure the result.

    Prints the table over all sequences. With --out also sequences.csv (a row each), frames/NAME.csv (a row a frame),
    summary.csv, summary.md and errors.png. Ends with exit code 1 if a recording could not be tracked to its end.

    With --ablate the evaluation runs once as configured and once for each single change of the configuration (every
    switch turned over, the other solvers, no prediction, no jitter penalty)
    and prints a row each; --out gets ablation.md and ablation.csv.

    [bold]Examples[/bold]

    voodoo eval rendered/ --only '*_cmu' --out report

    voodoo eval utd-mhad/ --jobs 4 --out report

    voodoo eval rendered/ --ablate --out report
    """
    from voodoo.ablate import ablate, table, variants, write_tables
    from voodoo.evaluate import evaluate_all, find_recordings
    from voodoo.report import markdown, write_reports

    with _clear_errors():
        _config(config)  # a bad file is one error here instead of one for each recording
        paths = find_recordings(recordings, only=only or ())
        jobs = jobs if jobs is not None else len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else 1
        kinds = ("depth",) if depth_only else _kinds(use)
        if ablation:
            chosen = _config(config)
            runs = ablate(paths, config=chosen, loader=loader, model=model, use=kinds, jobs=jobs)
            ablations = list(_progress(runs, "ablating", len(variants(chosen))))
            typer.echo(table(ablations))
            if out is not None:
                typer.echo("wrote " + ", ".join(str(file) for file in write_tables(out, ablations)))
            failed = [score for item in ablations for score in item.failures]
            if failed:
                raise VoodooError(f"{len(failed)} recordings failed, the first: {failed[0].failure}")
            return
        done = evaluate_all(paths, config_file=config, loader=loader, model=model, use=kinds, jobs=jobs)
        ordered = sorted(_progress(done, "evaluating", len(paths)), key=lambda item: item[0])
        scores, tables = [item[1] for item in ordered], [item[2] for item in ordered]
        typer.echo(markdown(scores))
        if out is not None:
            files = write_reports(out, scores, tables)
            typer.echo("wrote " + ", ".join(str(file) for file in files))
        failures = [score for score in scores if score.failure]
        if failures:
            raise VoodooError(f"{len(failures)} of {len(scores)} recordings failed, the first: {failures[0].failure}")


@app.command("info")
def info_command(recording: _RecordingArgument, frame: _FrameOption = None, loader: _LoaderOption = None) -> None:
    """Say what is in a recording: sensors, topics, frames, rates, root frame and reference."""
    with _clear_errors():
        typer.echo(str(_open(recording, loader, frame).info()))


@app.command("config")
def config_command() -> None:
    """Print the default configuration as commented TOML, to change and give back with --config.

    [bold]Example[/bold]

    voodoo config > fast.toml
    """
    typer.echo(voodoo.Config().to_toml(), nl=False)


@app.command("body")
def body_command(
    file: Annotated[Path | None, typer.Argument(metavar="FILE", help="A body file to check and print.")] = None,
    height: _HeightOption = None,
    model: _ModelOption = "full",
) -> None:
    """Print a body as TOML: the default human of a stature, or a file after checking it."""
    with _clear_errors():
        if file is not None and height is not None:
            raise typer.BadParameter("give FILE or --height, not both")
        if file is not None:
            body = voodoo.Body.load(file)
        else:
            body = voodoo.Body.human(1.75 if height is None else height, model=model)
        typer.echo(body.to_toml(), nl=False)


def _open(path: Path, loader: str | None, frame: str | None, **options: Any) -> Recording:  # noqa: ANN401 - the loader checks them
    if frame is not None:
        options["root_frame"] = frame
    return open_recording(path, loader=loader, **options)


def _kinds(words: str | None) -> tuple[str, ...]:
    """The kinds of inputs in "depth,scan"; all of them for None.

    Raises:
        VoodooError: an unknown kind.
    """
    return INPUTS if words is None else FrontEndSettings(use=tuple(word.strip() for word in words.split(","))).use


def _config(path: Path | None) -> voodoo.Config:
    return voodoo.Config() if path is None else voodoo.Config.load(path)


def _run(
    source: Recording,
    tracker: voodoo.Tracker,
    overlay: Path | None,
    *,
    sheet: int = 0,
    settings: FrontEndSettings | None = None,
    viewer: Viewer | None = None,
) -> tuple[Track, list[float], list[Picture]]:
    """Track and draw: the result, the time of every frame [s] and `sheet` pictures spread over the recording."""
    estimates, seconds, pictures = [], [], []
    chosen = set(np.linspace(0, len(source) - 1, sheet).round().astype(int).tolist())
    rate = source.info().rate_hz
    drawing = Overlay(source)
    writer = None if overlay is None else PictureWriter(overlay, rate_hz=rate if np.isfinite(rate) else 30.0)
    with writer or nullcontext():
        for step in _progress(track(source, tracker, settings=settings), source.name, len(source)):
            estimates.append(step.estimate)
            seconds.append(step.seconds)
            if viewer is not None:
                viewer.log(
                    step.estimate,
                    tracker.body,
                    recorded=step.recorded,
                    front_end=step.front_end,
                    seconds=step.seconds,
                )
            if writer is not None or step.index in chosen:
                picture = drawing.draw(
                    step.recorded, tracker.body, step.estimate, index=step.index, front_end=step.front_end
                )
                if writer is not None:
                    writer.write(picture)
                if step.index in chosen:
                    pictures.append(picture)
    return Track.of(estimates, body=tracker.body), seconds, pictures


def _viewer(view: bool, save: Path | None, name: str) -> AbstractContextManager[Viewer | None]:
    """The viewer that was asked for, opened before the work so that a missing Rerun is told at once."""
    return Viewer(save=save, name=name) if view or save is not None else nullcontext()


def _states(result: Track) -> str:
    """How many frames the tracker itself called what, e.g. "88 tracking, 2 lost"."""
    return ", ".join(f"{result.status.count(word)} {word}" for word in dict.fromkeys(result.status))


def _progress(items: Iterable[T], words: str, total: int) -> Iterator[T]:
    """Show a progress bar on stderr, if a person looks at it."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not sys.stderr.isatty()) as progress:
        yield from progress.track(items, total=total, description=words)


@contextmanager
def _clear_errors() -> Iterator[None]:
    """Turn errors that have a clear message into that one line on stderr and exit code 1."""
    try:
        yield
    except VoodooError as error:
        _fail(str(error))
    except OSError as error:
        _fail(f"{error.filename}: {error.strerror}" if error.filename and error.strerror else str(error))


def _fail(message: str) -> None:
    typer.echo(f"voodoo: {' '.join(message.split())}", err=True)
    raise typer.Exit(1)
