"""Ablation: repeats the evaluation of recordings once for every single change of the configuration.

    python lab/experiments/ablation.py ../shared/data/rendered --only '*_cmu' --use depth --out target/ablation

Runs once as configured, and once for each switch inverted, each other solver, and each term of a certain strength switched
off. Prints a row each; --out gets ablation.md and ablation.csv.
"""

from __future__ import annotations

import argparse
import csv
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from voodoo.config import Config
from voodoo.evaluation.evaluate import evaluate_all
from voodoo.evaluation.score import Score
from voodoo.evaluation.search import find_recordings
from voodoo.evaluation.summary import Summary, summarize

UNCHANGED = "as configured"
# Values that switch a term off: point-to-plane alone, no prediction, motion so free that its penalty has no effect.
_OFF = (("tangential_weight", 0.0), ("prediction", 0.0), ("motion_scale", 100.0), ("still_prior_gain", 0.0))
_MEASURES = (
    ("error_m", "error", 100.0, "cm", 2),
    ("within_10cm", "within 10 cm", 100.0, "%", 1),
    ("depth_within_5cm", "depth within 5 cm", 100.0, "%", 1),
    ("silhouette_iou", "IoU", 1.0, "", 3),
    ("jitter_m", "second difference", 1000.0, "mm", 1),
    ("step_s", "time of a frame", 1000.0, "ms", 2),
)


@dataclass(frozen=True)
class Variant:
    """One configuration of an ablation.

    Args:
        name: "as configured", or the one change, e.g. "depth_contour = false".
        config: all of it.
    """

    name: str
    config: Config


@dataclass(frozen=True)
class Ablation:
    """Results of one configuration.

    Args:
        name: of the variant.
        scores: one a recording, in the order of the paths.
    """

    name: str
    scores: tuple[Score, ...]

    @property
    def failures(self) -> tuple[Score, ...]:
        """Those recordings that were not tracked to their end."""
        return tuple(score for score in self.scores if score.failure)


def variants(base: Config) -> list[Variant]:
    """`base` itself, then every change of one entry: each switch inverted, each other solver, and each term of _OFF."""
    values: dict[str, Any] = dict(base.values())
    changes: list[tuple[str, bool | str | float]] = [
        (key, not value) for key, value in values.items() if isinstance(value, bool)
    ]
    changes += [("solver", word) for word in Config.words("solver") if word != values["solver"]]
    changes += [(key, off) for key, off in _OFF if values[key] != off]
    changed = [Variant(f"{key} = {_toml(value)}", Config(**{**values, key: value})) for key, value in changes]
    return [Variant(UNCHANGED, base), *changed]


def ablate(
    paths: Sequence[Path],
    *,
    config: Config | None = None,
    use: Sequence[str] | None = None,
    jobs: int = 1,
) -> Iterator[Ablation]:
    """Evaluate `paths` with every variant of `config`, one after another; each is yielded when it is done.

    A recording that fails is one of the ablation's `failures`; the rest goes on.
    """
    for variant in variants(Config() if config is None else config):
        done = evaluate_all(paths, config=variant.config, use=use, jobs=jobs)
        yield Ablation(variant.name, tuple(score for _, score, _ in sorted(done, key=lambda item: item[0])))


def table(ablations: Sequence[Ablation]) -> str:
    """A row for every configuration, as Markdown; in parentheses the difference of the error to the first row."""
    text: list[str] = []
    for kind, rows in _by_kind(ablations).items():
        text += [f"## Against {kind}: {rows[0][1].sequences} sequences\n"]
        text += ["| configuration | class average | " + " | ".join(words for _, words, *_ in _MEASURES) + " | failed |"]
        text += ["|---|" + "---|" * (len(_MEASURES) + 2)]
        start = rows[0][1].means["error_m"]
        for ablation, summary in rows:
            cells = [_number(summary.class_average, 1.0, "", 2)]
            cells += [_number(summary.means[key], *form) for key, _, *form in _MEASURES]  # type: ignore[arg-type]
            if ablation.name != UNCHANGED and math.isfinite(summary.means["error_m"] - start):
                cells[1] += f" ({100.0 * (summary.means['error_m'] - start):+.2f})"
            text.append("| " + " | ".join([ablation.name, *cells, str(len(ablation.failures))]) + " |")
        text.append("")
    return "\n".join(text)


def write_tables(folder: Path, ablations: Sequence[Ablation]) -> list[Path]:
    """Write ablation.md and ablation.csv (a row for every configuration and recording); returns both.

    Raises:
        OSError: a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    text, rows = folder / "ablation.md", folder / "ablation.csv"
    text.write_text(table(ablations), encoding="utf-8")
    with rows.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["configuration", "recording", "failure", "tracking_class", *(key for key, *_ in _MEASURES)])
        for ablation in ablations:
            for score in ablation.scores:
                values = [getattr(score, key) for key, *_ in _MEASURES]
                cells = [f"{value:.6f}" if math.isfinite(value) else "" for value in values]
                class_ = "" if score.tracking_class is None else score.tracking_class
                writer.writerow([ablation.name, score.name, score.failure, class_, *cells])
    return [text, rows]


def _by_kind(ablations: Sequence[Ablation]) -> dict[str, list[tuple[Ablation, Summary]]]:
    """Rows of one kind of reference; recordings of different kinds are not averaged."""
    kinds: dict[str, list[tuple[Ablation, Summary]]] = {}
    for ablation in ablations:
        for summary in summarize(ablation.scores):
            kinds.setdefault(summary.kind, []).append((ablation, summary))
    return kinds


def _number(value: float, factor: float, unit: str, digits: int) -> str:
    return f"{factor * value:.{digits}f} {unit}".strip() if math.isfinite(value) else "-"


def _toml(value: float | bool | str) -> str:
    return f'"{value}"' if isinstance(value, str) else str(value).lower()


def main() -> None:
    """Evaluate the recordings with every variant."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recordings", nargs="+", type=Path, help="recordings, or folders of recordings")
    parser.add_argument("--only", nargs="*", default=(), help="patterns of names")
    parser.add_argument("--config", type=Path, help="configuration that is changed; the defaults without it")
    parser.add_argument("--use", nargs="*", help="kinds of inputs; all without it")
    parser.add_argument("--jobs", type=int, default=1, help="recordings at the same time (default 1)")
    parser.add_argument("--out", type=Path, help="folder for ablation.md and ablation.csv")
    options = parser.parse_args()
    config = None if options.config is None else Config.load(options.config)
    paths = find_recordings(options.recordings, only=options.only)
    ablations = list(ablate(paths, config=config, use=options.use, jobs=options.jobs))
    print(table(ablations))
    if options.out is not None:
        write_tables(options.out, ablations)
    failed = [score for item in ablations for score in item.failures]
    if failed:
        sys.exit(f"{len(failed)} recordings failed, the first: {failed[0].failure}")


if __name__ == "__main__":
    main()
