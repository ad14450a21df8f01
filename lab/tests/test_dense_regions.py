"""R07's own form, a level set in each whole picture: lab/experiments/dense_regions.py."""

import pytest

import color_scene
from lab_scripts import load_experiment


@pytest.mark.long
def test_the_dense_form_follows_as_well(tmp_path):
    dense, sparse = load_experiment("dense_regions").main(color_scene.write_color_bag(tmp_path / "scene", 3), 3)
    assert dense < 0.04 and sparse < 0.03
