"""The table of lab/experiments/color_cameras.py."""

import color_scene as scene
from lab_scripts import load_experiment


def test_the_experiment_reports_how_many_cameras_it_takes(tmp_path, capsys):
    films = scene.write_videos(tmp_path / "walk", 10)
    means = load_experiment("color_cameras").main(films)
    assert list(means)[:2] == ["all", "without videos/cam0.avi"] and max(means.values()) < 0.04
    assert capsys.readouterr().out.count(" cm ") == 5
