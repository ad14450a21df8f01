"""Resampling of depth images by lab/experiments/changed_depth.py."""

import numpy as np

import voodoo
from lab_scripts import load_experiment
from lenses import LENSES


def through(name):
    model, coefficients = LENSES[name]
    return voodoo.Camera(320, 240, 220.0, 1.02 * 220.0, 0.49 * 320, 0.52 * 240, coefficients, model)


def test_a_resampled_pixel_shows_what_the_recorded_one_nearest_to_its_ray_shows():
    straight, bent = through("none"), through("fisheye")
    index = load_experiment("changed_depth").sources(straight, bent)
    known = index >= 0
    rows, columns = np.divmod(index[known], straight.width)
    off = straight.rays()[rows, columns] - bent.rays()[known]
    assert np.abs(off * (straight.fx, straight.fy)).max() < 0.51
    # Pixels without a source look outside the straight camera's image.
    beyond = np.abs(straight.project(np.dstack([bent.rays(), np.ones_like(known)])[~known]) - (159.5, 119.5))
    assert 0.5 < known.mean() < 1.0 and (beyond > (159.9, 119.9)).any(axis=1).all()
