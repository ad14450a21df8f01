"""`voodoo eval`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from voodoo.cli import options
from voodoo.cli.common import cores, print_interrupted, print_text, print_written, progressing, refuse_both, reporting
from voodoo.cli.signals import deferred
from voodoo.errors import NoPoseError, VoodooError

if TYPE_CHECKING:
    from voodoo.evaluation.people import PeopleScore


def eval_command(
    *,
    recordings: Annotated[
        list[Path], typer.Argument(metavar="RECORDING...", help="Recordings, or folders of recordings.")
    ],
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="Folder for tables and plots.")] = None,
    init: options.AutoOption = None,
    config: options.ConfigOption = None,
    jobs: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Number of parallel recordings; by default one per core.")
    ] = None,
    only: options.OnlyOption = None,
    model: options.ModelOption = None,
    use: options.UseOption = None,
    depth_only: Annotated[bool, typer.Option("--depth-only", help="The same as --use depth.")] = False,
    result: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv",
            help="Evaluate this result, of one person or several, in one RECORDING, instead of tracking.",
        ),
    ] = None,
    reading: options.Reading,
    as_json: options.JsonOption = False,
) -> None:
    """Track recordings with ground truth or a reference skeleton, and evaluate the result.

    Prints ten rows over all sequences. --out writes all measures: sequences.csv (a row per recording), frames/NAME.csv (a row
    per frame), summary.csv, summary.md, errors.png and calibration.png. Ends with exit code 1 if a recording could not be
    tracked to its end. Ctrl-C keeps the recordings that are done and ends with exit code 130.

    A recording with truth_people.csv beside it is tracked with --people any and evaluated for MOTA, IDF1, identity switches,
    false bodies and joints. With --result a .csv of any program is evaluated: stamp_s, person, status, residual_m, then
    NAME_x, NAME_y, NAME_z, also beside a truth.csv of one person. people.csv and people.md are written to --out.

    Several persons, and the plots of --out, need pip install 'voodoo-tracker[eval]'.

    Examples

    voodoo eval rendered/ --only '*_cmu' --out report

    voodoo eval utd-mhad/ --jobs 4 --out report

    voodoo eval rendered/ --init auto

    voodoo eval two_walk/ --result theirs.csv
    """
    from voodoo.cli.running import config_of, kinds_of
    from voodoo.evaluation.evaluate import evaluate_all
    from voodoo.evaluation.people import PeopleScore
    from voodoo.evaluation.people_evaluate import evaluate_result, has_people
    from voodoo.evaluation.report import brief, new_figure, write_reports
    from voodoo.evaluation.score import Score
    from voodoo.evaluation.search import find_recordings
    from voodoo.evaluation.summary import summarize
    from voodoo.whole import check_outputs, check_place

    only_depth = depth_only or None
    refuse_both("--depth-only", only_depth, **{"--use": use})
    tracking = {"--init": init, "--config": config, "--model": model, "--use": use, "--depth-only": only_depth}
    refuse_both("--result", result, **tracking)
    with reporting(as_json) as report:
        words = reading.words()
        settings = config_of(config)
        paths = find_recordings(recordings, only=only or ())
        if out is not None:
            check_outputs([out], paths)
            check_place(out, kind="folder")
        if result is not None:
            if len(paths) != 1:
                raise typer.BadParameter(f"--result is the result of one recording, found {len(paths)}")
            _show_people([evaluate_result(paths[0], result, options=words)], out, report=report)
            return
        if out is not None and not all(map(has_people, paths)):
            new_figure(1.0, 1.0)  # a missing library is reported before the work
        how: dict[str, Any] = {"config": settings, "options": words, "model": model}
        kinds = ("depth",) if depth_only else kinds_of(use)
        done = evaluate_all(paths, **how, use=kinds, init=init, jobs=jobs or cores())
        finished, interrupted = [], False
        try:
            for item in progressing(done, "evaluating", len(paths)):
                finished.append(item)
        except KeyboardInterrupt:
            interrupted = True
        finished.sort(key=lambda item: item[0])
        scores = [score for _, score, _ in finished if isinstance(score, Score)]
        several = [score for _, score, _ in finished if isinstance(score, PeopleScore)]
        with deferred():
            if several:
                _show_people(several, out, report=report)
            if report is not None:
                report |= {"summaries": summarize(scores), "recordings": scores}
            elif scores:
                print_text(brief(scores))
                if out is None:
                    typer.echo("--out DIR writes all measures, a row for every recording, and one for every frame")
            if out is not None and scores:
                tables = [table for _, score, table in finished if isinstance(score, Score)]
                print_written(write_reports(out, scores, tables, picture=not interrupted), aside=as_json)
        print_interrupted(interrupted, f"{len(finished)} of {len(paths)} recordings are done")
        failures = [score.failure for _, score, _ in finished if score.failure]
        if failures:
            raise VoodooError(f"{len(failures)} of {len(finished)} recordings failed, the first: {failures[0]}")
        if finished and all(score.nobody for _, score, _ in finished):
            raise NoPoseError(f"nobody was found in {', '.join(score.name for _, score, _ in finished[:3])}")


def _show_people(scores: Sequence[PeopleScore], out: Path | None, *, report: dict[str, Any] | None) -> None:
    """Print and write the table of several persons."""
    from voodoo.evaluation.people_evaluate import DERIVED, people_markdown, write_people

    if report is not None:
        report["people"] = [{**vars(score), **{name: getattr(score, name) for name in DERIVED}} for score in scores]
    else:
        typer.echo(people_markdown(scores))
    if out is not None:
        print_written(write_people(out, scores), aside=report is not None)
