"""Submits recordings to Dask and collects the results."""

from __future__ import annotations

import contextlib
import itertools
import json
import logging
import queue
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from typing import Any

from voodoo.batch.storage import Store, named
from voodoo.batch.summary import FAILED, REPORTS, Row, read_table, write_index, write_table
from voodoo.batch.task import Job, Settings, do, failed, stored_row
from voodoo.children import children
from voodoo.errors import VoodooError, reading

SUMMARY, SETTINGS, INDEX = "summary.csv", "settings.json", "index.html"
_EVERY_S, _FRACTION = 2.0, 0.05
"""Shortest time between two writes of the table of summaries [s], and largest fraction of the time spent on it, because the table
of a million recordings is large."""
_AHEAD = 4
"""Number of tasks per worker that are submitted to the scheduler: a million would fill its memory."""
_CONNECT_S, _POLL_S = 30, 0.3
_READERS = 16
"""Tables that are looked at together: each waits for the network."""


class Batch:
    """A folder of results and its recordings.

    Args:
        sources: see voodoo.batch.storage.find_sources.
        out: path or URL of the folder; results of an earlier run with the same settings are kept.
        settings: settings for all recordings.
        limit_s: longest time for a recording [s].
        report: also write a page for each recording that is tracked, and an index of them.

    Attributes:
        rows: rows of the finished and failed recordings, by name.
        jobs: remaining jobs: untracked recordings, and failed ones.
        notes: what was found damaged, and made anew.

    Raises:
        VoodooError: the folder cannot be used, or has results with other settings.
    """

    def __init__(
        self,
        sources: Sequence[str],
        out: str,
        settings: Settings,
        *,
        limit_s: float | None = None,
        report: bool = False,
    ) -> None:
        """Determine which recordings are done: those whose tables are complete."""
        self._store, self._report = Store(out), report
        self.notes: list[str] = []
        self._check_settings(settings)
        names = sorted(self._store.recordings())
        with ThreadPoolExecutor(_READERS) as readers:
            found = dict(zip(names, readers.map(lambda name: stored_row(out, name, settings), names), strict=True))
        done = {name: row for name, row in found.items() if row is not None}
        known = self._summary()
        failed = {name: row for name, row in known.items() if row.status == FAILED}
        self.rows = {**failed, **done}
        pairs = named(sources, {name: row.source for name, row in {**known, **done}.items()})
        self.jobs = [Job(name, source, out, settings, limit_s, report) for name, source in pairs if name not in done]
        self._written, self._took = -_EVERY_S, 0.0

    def _check_settings(self, settings: Settings) -> None:
        described = settings.as_dict()
        before = self._store.read(SETTINGS)
        if before is None:
            self._store.write(SETTINGS, (json.dumps(described, indent=1) + "\n").encode())
            return
        try:
            found = json.loads(before)
            different = [name for name, value in described.items() if found.get(name) != value]
        except (ValueError, AttributeError):
            self._set_aside(SETTINGS)
            self._check_settings(settings)
            return
        if different:
            words = ", ".join(f"{name} {found.get(name)!r}" for name in different)
            raise VoodooError(
                f"{self._store.url}: expected results of the same settings, found some of {words}; "
                "give another --out, or the same settings"
            )

    def _summary(self) -> dict[str, Row]:
        text = self._store.read(SUMMARY)
        try:
            return {} if text is None else read_table(text, f"{self._store.url}/{SUMMARY}")
        except VoodooError:
            self._set_aside(SUMMARY)
            return {}

    def _set_aside(self, name: str) -> None:
        self._store.rename(name, f"{name}.damaged")
        self.notes.append(f"{self._store.url}/{name} is damaged, and made anew; the old one is {name}.damaged")

    def take(self, row: Row) -> None:
        """Store the row of a recording; the table is written at intervals."""
        self.rows[row.recording] = row
        if time.monotonic() - self._written >= max(_EVERY_S, self._took / _FRACTION):
            self.save()

    def save(self) -> None:
        """Write the table of summaries."""
        began = time.monotonic()
        self._store.write(SUMMARY, write_table(self.rows.values()).encode())
        if self._report:
            page = write_index(self.rows.values(), self._store.names(REPORTS))
            self._store.write(INDEX, page.encode())
        self._written = time.monotonic()
        self._took = self._written - began


def run(
    jobs: Sequence[Job], *, workers: int, scheduler: str | None = None, stop: threading.Event | None = None
) -> Iterator[Row]:
    """Run the jobs, one task each; yields their rows in the order of completion.

    A task whose worker dies is repeated once by another worker; if that dies, too, the task has failed. Results are fetched from
    the workers immediately, so that a dead worker loses only its current task.

    Args:
        jobs: the jobs to run.
        workers: number of processes on this machine; ignored with a scheduler.
        scheduler: address of a running Dask scheduler.
        stop: when set, no more tasks start, and running ones are canceled.

    Raises:
        VoodooError: Dask is not installed, the scheduler does not answer, or it has no worker.
    """
    check_installed()
    import distributed

    with _client(distributed, workers, scheduler) as client:
        threads = sum(client.nthreads().values()) or workers
        waiting = iter(jobs)
        running: dict[Any, Job] = {}
        finished: queue.SimpleQueue[Any] = queue.SimpleQueue()
        prefix = f"voodoo-{time.time_ns():x}"

        def submit(some: Iterable[Job]) -> None:
            for job in some:
                task = client.submit(do, job, key=f"{prefix}-{job.name}", pure=False)
                running[task] = job
                task.add_done_callback(finished.put)

        submit(itertools.islice(waiting, _AHEAD * threads))
        while running and not (stop is not None and stop.is_set()):
            with contextlib.suppress(queue.Empty):
                task = finished.get(timeout=_POLL_S)
                job = running.pop(task)
                yield _row(task, job)
                task.release()
                submit(itertools.islice(waiting, 1))
        client.cancel(list(running))


def _row(task: Any, job: Job) -> Row:  # noqa: ANN401 - Dask has no types
    try:
        found = task.result()
    except Exception as error:  # an error of the scheduler: a task itself never raises
        if type(error).__name__ == "KilledWorker":
            limit = "" if job.limit_s is None else f" (its time limit is {job.limit_s:g} s)"
            return failed(job, f"the worker died, and another one that was given it again{limit}")
        return failed(job, f"{type(error).__name__}: {' '.join(str(error).split())}")
    return found if isinstance(found, Row) else failed(job, f"expected a row, found {type(found).__name__}")


@contextmanager
def _client(distributed: Any, workers: int, scheduler: str | None) -> Iterator[Any]:  # noqa: ANN401 - Dask has no types
    import dask

    with ExitStack() as stack:
        if scheduler is None:
            # A worker has only its current task, and a task is tried twice. Pages for browsers would be open to other users.
            options: dict[str, Any] = {
                "distributed.scheduler.allowed-failures": 1,
                "distributed.scheduler.worker-saturation": 1.0,
                "distributed.scheduler.http.routes": [],
                "distributed.worker.http.routes": [],
            }
            stack.enter_context(dask.config.set(options))
            stack.enter_context(children())  # until the end, because workers that die are started again
            scratch = stack.enter_context(
                tempfile.TemporaryDirectory(prefix="voodoo-dask-", ignore_cleanup_errors=True)
            )
            # Other users of this machine could run code on its workers otherwise.
            keys = distributed.Security.temporary()
            with reading("batch", f"{workers} processes that start", error=VoodooError):
                place: Any = stack.enter_context(
                    distributed.LocalCluster(
                        n_workers=workers,
                        threads_per_worker=1,
                        processes=True,
                        host="127.0.0.1",
                        dashboard_address=None,
                        security=keys,
                        local_directory=scratch,
                        silence_logs=logging.CRITICAL,
                    )
                )
        else:
            place = scheduler
        try:
            client = stack.enter_context(distributed.Client(place, timeout=_CONNECT_S))
        except (OSError, TimeoutError, ValueError) as error:
            raise VoodooError(f"--scheduler: expected a Dask scheduler at {scheduler}, found: {error}") from error
        try:
            client.wait_for_workers(1, timeout=_CONNECT_S)
        except TimeoutError as error:
            raise VoodooError(f"--scheduler: expected a worker at {scheduler}, found none in {_CONNECT_S} s") from error
        yield client


def check_installed() -> None:
    """Raise an error if packages of the extra are missing, before anything is written.

    Raises:
        VoodooError: names them.
    """
    missing = [name for name in ("cryptography", "distributed", "fsspec", "pyarrow") if find_spec(name) is None]
    if missing:
        raise VoodooError(
            f"many recordings: expected Dask and what its extra brings, found no {', '.join(missing)}; "
            "pip install 'voodoo-tracker[batch]'"
        )
