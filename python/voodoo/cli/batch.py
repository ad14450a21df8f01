"""`voodoo batch`."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import typer

from voodoo.cli import options
from voodoo.cli.common import cores, print_interrupted, print_message, progressing, reporting
from voodoo.cli.signals import deferred


def batch_command(
    *,
    recordings: Annotated[
        list[str], typer.Argument(metavar="RECORDING...", help="Recordings, folders of recordings, or URLs of either.")
    ],
    out: Annotated[str, typer.Option(metavar="DIR", help="Folder or URL for results; existing results are kept.")],
    workers: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Processes on this machine; by default one for each core.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="A running Dask scheduler, tcp://HOST:PORT.")
    ] = None,
    init: options.AutoOption = None,
    only: options.OnlyOption = None,
    time_limit: Annotated[
        float | None, typer.Option(metavar="S", min=0.001, help="A recording that takes longer has failed.")
    ] = None,
    config: options.ConfigOption = None,
    model: options.ModelOption = None,
    use: options.UseOption = None,
    people: options.PeopleOption = "1",
    reading: options.Reading,
    strict: options.StrictOption = False,
    pages: Annotated[
        bool,
        typer.Option(
            "--pages", help="Also write a page for each recording that is tracked, and index.html with links."
        ),
    ] = False,
    as_json: options.JsonOption = False,
) -> None:
    """Track many recordings, on this machine or on a cluster, one task each.

    Writes DIR/frames/recording=NAME/, a Parquet data set with a row for every frame and person, and DIR/summary.csv, a row for
    every recording: recording, frames, seconds, status (done, failed), error, and more. It needs
    pip install 'voodoo-tracker[batch]'.

    --pages writes DIR/reports/NAME.html, the page of voodoo report, for each recording that is tracked now, and DIR/index.html.

    Run it again to resume: finished recordings are skipped, failed ones are repeated. The row of a failed recording has the
    reason, and the command ends with exit code 1. The task of a worker that dies is repeated once.

    RECORDING and DIR may be URLs of fsspec (s3://, gs://, sftp://, with the library of the protocol). Everyone who can connect
    to a Dask scheduler can run any code on its workers, so it must be on a trusted network.

    Examples

    voodoo batch recordings/ --out results --workers 8

    voodoo batch s3://lab/walks/ --out s3://lab/results --scheduler tcp://10.0.0.5:8786
    """
    from voodoo._core import __version__
    from voodoo.batch.run import Batch, check_installed, run
    from voodoo.batch.storage import find_sources, is_local, local_path
    from voodoo.batch.summary import DONE, FAILED
    from voodoo.batch.task import Settings
    from voodoo.cli.running import config_of, kinds_of, limit_of
    from voodoo.errors import NoPoseError, VoodooError
    from voodoo.whole import check_outputs, check_place

    with reporting(as_json) as reported:
        settings = Settings(
            use=kinds_of(use),
            init=init,
            model=model,
            loader=reading.loader,
            options=replace(reading, loader=None).words(),
            people=limit_of(people),
            strict=strict,
            config=config_of(config).model_dump(exclude_defaults=True),
            version=__version__,
        )
        sources = find_sources(recordings, only=only or ())
        if is_local(out):
            check_outputs([local_path(out)], map(local_path, filter(is_local, sources)))
            check_place(local_path(out), kind="folder")
        check_installed()
        place = out if "://" in out else str(local_path(out).absolute())
        batch = Batch(sources, place, settings, limit_s=time_limit, report=pages)
        for note in batch.notes:
            print_message(note)
        batch.save()  # also of tables that it did not have
        before = len(sources) - len(batch.jobs)
        interrupted = False
        if batch.jobs:
            with deferred() as stop:
                rows = run(batch.jobs, workers=workers or cores(), scheduler=scheduler, stop=stop)
                try:
                    for row in progressing(rows, "tracking", len(batch.jobs)):
                        batch.take(row)
                        if row.doubts:
                            print_message(f"{row.recording}: {row.doubts}")
                        if row.status == FAILED:
                            print_message(f"{row.recording}: {row.error}")
                        elif not row.persons:
                            print_message(f"{row.recording}: nobody was found in {row.frames} frames")
                finally:
                    batch.save()
                interrupted = stop.is_set()
        ours = [batch.rows[job.name] for job in batch.jobs if job.name in batch.rows]
        done = sum(row.status == DONE for row in ours)
        message = f"{done} of {len(batch.jobs)} recordings done, {before} before; wrote {out}"
        if reported is not None:
            reported |= {"out": out, "recordings": list(batch.rows.values())}
        print_interrupted(interrupted, message)
        if reported is None:
            typer.echo(message)
        broken = [row for row in ours if row.status == FAILED]
        if broken:
            raise VoodooError(f"{len(broken)} recordings failed, the first: {broken[0].recording}: {broken[0].error}")
        if batch.rows and not any(row.persons for row in batch.rows.values()):
            raise NoPoseError(f"nobody was found in any of {len(batch.rows)} recordings")
