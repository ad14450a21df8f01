"""The figures of the pages are those of lab/figures/runs.json."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from lab.figures import PAGES, load, measure, rendered, updated
from lab.figures.pages import BLOCK, HERE, ROOT, VALUE

MACHINES, RUNS = load()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_a_page_shows_the_figures_of_the_runs(page: Path):
    text = page.read_text(encoding="utf-8")
    assert BLOCK.search(text), f"{page} has no block of figures"
    assert updated(text, MACHINES, RUNS) == text, "change runs.json, then run: python -m lab.figures"


def test_a_number_that_a_hand_has_changed_is_found():
    text = PAGES[0].read_text(encoding="utf-8")
    displayed = f"{RUNS['rendered'].values['mean_cm']} cm mean joint error"
    assert displayed in text
    assert updated(text.replace(displayed, "1.1 cm mean joint error"), MACHINES, RUNS) == text


def test_every_block_is_displayed_and_every_run_is_used():
    blocks = {path.stem for path in (HERE / "blocks").glob("*.md")} | {"runs"}
    displayed = {name for page in PAGES for name, _ in BLOCK.findall(page.read_text(encoding="utf-8"))}
    assert displayed == blocks
    used = {run for path in (HERE / "blocks").glob("*.md") for run, *_ in VALUE.findall(path.read_text("utf-8"))}
    assert used == set(RUNS)


def test_numbers_keep_their_digits(monkeypatch, tmp_path):
    (tmp_path / "blocks").mkdir()
    (tmp_path / "blocks" / "some.md").write_text("{rendered.mean_cm}; {rendered.mean_cm:.2f}; {rendered.lost}\n")
    monkeypatch.setattr("lab.figures.pages.HERE", tmp_path)
    values = RUNS["rendered"].values
    assert rendered("some", MACHINES, RUNS) == f"{values['mean_cm']}; {values['mean_cm']:.2f}; {values['lost']}\n"
    (tmp_path / "blocks" / "some.md").write_text("{rendered.nothing}")
    with pytest.raises(KeyError, match="nothing"):
        rendered("some", MACHINES, RUNS)


def test_commits_and_scripts_of_the_runs_are_there():
    for run in RUNS.values():
        for path in re.findall(r"(?:lab|benches|examples|scripts)/[\w/.]+", run.command):
            assert (ROOT / path).exists(), f"{run.id}: {path}"
    git = ["git", "-C", str(ROOT)]
    if (
        subprocess.run([*git, "rev-parse", "--is-shallow-repository"], capture_output=True, text=True).stdout.strip()
        != "false"
    ):
        pytest.skip("no history")
    for run in RUNS.values():
        displayed = subprocess.run([*git, "show", "-s", "--format=%as", run.commit], capture_output=True, text=True)
        assert displayed.stdout.strip() == run.date, f"{run.id}: {run.commit} {displayed.stderr}"


def test_values_are_read_from_what_the_commands_print():
    assert set(measure.READ) <= set(RUNS)
    printed = {
        "disturbed": "mean 2.02 cm; 1 of 64 runs end with a joint lost\n76 limbs off by 10 cm: 97.4 % not called measured\n"
        "9000 limbs nearer: 4.0 % not called measured\n",
        "wrong-start-kinect": "| all | 0.1 | 97 % | 99 % | 2 | 192 | 98 % | 3 |\n",
        "missing-noise": "missing: mean 3.0 mm\nnoise: mean 2.0 mm, 99 % 21 mm, greatest 918 mm, within 5 mm 94.4%, poses in the "
        "mean 92.5%; from the truth 20.7 mm, 20.8 mm as it is\n",
    }
    expected = {
        "disturbed": {"mean_cm": 2.02, "lost": 1, "runs": 64, "recall": 97.4, "false_alarm": 4.0},
        "wrong-start-kinect": {"right": 99, "never": 2, "cases": 192},
        "missing-noise": {
            "mean_mm": 2.0, "p99_mm": 21, "most_mm": 918, "within_5mm": 94.4, "poses": 92.5, "truth_mm": 20.7
        },
    }  # fmt: skip
    for name, text in printed.items():
        read = measure.READ[name]
        assert read(measure.Output(text)) == expected[name]
        with pytest.raises(ValueError, match="expected"):
            read(measure.Output(""))


def test_what_an_evaluation_does_not_know_is_left_out():
    summary = {"kind": "exact truth", "error_m": "0.0184", "class_0": "0.0", "sequences": "8", "first_pose_error_m": ""}
    found = measure.evaluated(measure.Output("", summary))
    assert found == {"mean_cm": 1.8, "lost": 0, "sequences": 8, "recordings": 8}
    assert isinstance(found["lost"], int)


def test_false_bodies_are_counted_not_those_a_minute():
    head = "| recording | MOTA | IDF1 | id switches | false bodies a minute | joint error, cm |\n|---|---|---|---|---|---|\n"
    rows = [{"false_bodies": "0"}, {"false_bodies": "3"}]
    output = measure.Output(head + "| all | 1.000 | 0.990 | 1 | 4.5 | 2.5 |\n", {}, rows)
    expected = {"mota": 1.0, "idf1": 0.99, "switches": 1, "mean_cm": 2.5, "false_bodies": 3}
    assert measure.people(output) == expected and isinstance(measure.people(output)["false_bodies"], int)


@pytest.mark.parametrize("failed", ["nobody found", "first pose in frame 0, nan cm off"])
def test_a_start_that_fails_is_no_best_or_worst_one(failed):
    good = "dev_01: first pose in frame 0, 3.1 cm off\ndev_02: first pose in frame 2, 4.0 cm off\n"
    assert measure.first_poses(measure.Output(good)) == {"least_cm": 3.1, "most_cm": 4.0}
    with pytest.raises(ValueError, match="expected a first pose in every line"):
        measure.first_poses(measure.Output(f"{good}dev_03: {failed}\n"))


def test_a_tree_with_changes_is_not_measured(tmp_path):
    git = ["git", "-C", str(tmp_path), "-c", "user.name=a", "-c", "user.email=a@example.org"]
    (tmp_path / "lab" / "figures").mkdir(parents=True)
    for name in ("code.py", "lab/figures/runs.json"):
        (tmp_path / name).write_text("1")
    for words in (["init", "-q"], ["add", "."], ["commit", "-q", "-m", "all"]):
        subprocess.run([*git, *words], check=True)
    (tmp_path / "lab" / "figures" / "runs.json").write_text("2")
    (tmp_path / "untracked").write_text("2")
    commit, date = measure.state(tmp_path)
    assert len(commit) == 8 and re.fullmatch(r"\d{4}-\d\d-\d\d", date)
    (tmp_path / "code.py").write_text("2")
    with pytest.raises(SystemExit, match=r"expected a tree without changes, found:\n M code\.py"):
        measure.state(tmp_path)


def test_what_is_edited_during_the_runs_stays_and_the_machine_is_written(monkeypatch, tmp_path):
    path = tmp_path / "runs.json"
    run = {
        "id": "start-keypoints-depth",
        "command": "c",
        "commit": "",
        "date": "",
        "machine": "old",
        "values": {"least_cm": 0.0},
    }
    path.write_text(json.dumps({"machines": {"old": "", "new": ""}, "runs": [run]}))

    def measured(command, data):
        path.write_text(path.read_text().replace('"old": ""', '"old": "edited"'))
        return measure.Output("first pose in frame 0, 3.1 cm off")

    monkeypatch.setattr(measure, "HERE", tmp_path)
    monkeypatch.setattr(measure, "measured", measured)
    monkeypatch.setattr(measure, "state", lambda root: ("12345678", "2026-12-01"))
    monkeypatch.setattr(sys, "argv", ["measure", "start-keypoints-depth", "--machine", "new"])
    assert measure.main() == 0
    written = json.loads(path.read_text())
    assert written["machines"]["old"] == "edited"
    assert written["runs"] == [
        run | {"commit": "12345678", "date": "2026-12-01", "machine": "new", "values": {"least_cm": 3.1}}
    ]
    monkeypatch.setattr(sys, "argv", ["measure", "--machine", "none"])
    with pytest.raises(SystemExit):
        measure.main()
