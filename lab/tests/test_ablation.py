"""Ablation on the first frames of the bundled recording."""

import csv
from itertools import islice

import pytest

import voodoo
from lab_scripts import load_experiment
from voodoo.evaluation import evaluate as evaluate_module
from voodoo.recordings import open_recording, sample_path

module = load_experiment("ablation")
UNCHANGED, Variant = module.UNCHANGED, module.Variant
ablate, table, variants, write_tables = module.ablate, module.table, module.variants, module.write_tables
FEW = 4


class Beginning:
    """The first frames of a recording."""

    def __init__(self, recording):
        self._recording = recording

    def __getattr__(self, name):
        return getattr(self._recording, name)

    def __len__(self):
        return FEW

    def __iter__(self):
        return islice(iter(self._recording), FEW)


@pytest.fixture
def short(monkeypatch):
    monkeypatch.setattr(
        evaluate_module, "open_recording", lambda path, loader=None: Beginning(open_recording(path, loader=loader))
    )


def test_every_variant_differs_in_one_entry():
    base = voodoo.Config(hypotheses=True, max_steps=3)
    start, *others = variants(base)
    assert start == Variant(UNCHANGED, base)
    for variant in others:
        differing = {key for key, value in variant.config.values().items() if value != base.values()[key]}
        assert differing == {variant.name.split(" = ")[0]}
    names = [variant.name for variant in others]
    switches = {key for key, value in base.values().items() if isinstance(value, bool)}
    assert {name.split(" = ")[0] for name in names} == switches | {
        "solver",
        "tangential_weight",
        "prediction",
        "motion_scale",
        "still_prior_gain",
    }
    assert "hypotheses = false" in names and 'solver = "limbwise"' in names and "prediction = 0.0" in names
    still = [variant.name for variant in variants(voodoo.Config(prediction=0.0))]
    assert not any(name.startswith("prediction") for name in still)


def test_rows_are_the_evaluations_of_the_variants(short, tmp_path):
    config = voodoo.Config(max_steps=2)
    done = list(ablate([sample_path()], config=config, use=("depth",)))
    assert [item.name for item in done] == [variant.name for variant in variants(config)]
    for item, variant in zip(done, variants(config), strict=True):
        (score,) = item.scores
        assert score.frames == FEW and not item.failures
        if item.name in (UNCHANGED, "fit_girths = false"):
            alone, _ = evaluate_module.evaluate(sample_path(), config=variant.config, use=("depth",))
            assert score.error_m == alone.error_m
    errors = {item.name: item.scores[0].error_m for item in done}
    assert errors[UNCHANGED] != errors["fit_girths = false"]
    text = table(done)
    assert text.count("\n| ") == len(done) + 1
    gain = 100.0 * (errors["fit_girths = false"] - errors[UNCHANGED])
    row = next(line for line in text.splitlines() if line.startswith("| fit_girths = false"))
    assert f"({gain:+.2f})" in row
    markdown, rows = write_tables(tmp_path / "report", done)
    assert markdown.read_text() == text
    with rows.open(newline="") as file:
        written = list(csv.DictReader(file))
    assert [row["configuration"] for row in written] == [item.name for item in done]
    assert float(written[0]["error_m"]) == pytest.approx(errors[UNCHANGED], abs=1e-6)


def test_a_recording_that_fails_is_counted_and_ends_the_script_with_an_error(short, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(module, "variants", lambda config: variants(config)[:2])
    broken = tmp_path / "broken_depth.mat"
    broken.write_bytes(b"nothing")
    monkeypatch.setattr("sys.argv", ["ablation", str(sample_path()), str(broken), "--out", str(tmp_path / "report")])
    with pytest.raises(SystemExit, match="2 recordings failed"):
        module.main()
    printed = capsys.readouterr().out
    assert f"| {UNCHANGED} |" in printed and "against" in printed.lower()
    assert {path.name for path in (tmp_path / "report").iterdir()} == {"ablation.md", "ablation.csv"}
