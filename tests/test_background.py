"""Silhouettes of something that moves before a noisy wall."""

import cv2
import numpy as np
import pytest

from voodoo import MeasurementError
from voodoo.sensors.silhouettes.color import Silhouettes


def wall(seed):
    chance = np.random.default_rng(seed)
    base = np.tile(np.linspace(60, 180, 160, dtype=np.float32)[None, :, None], (120, 1, 3))
    return np.clip(base + chance.normal(0, 3, base.shape), 0, 255).astype(np.uint8)


def test_a_person_is_cut_out_and_the_wall_is_not():
    silhouettes = Silhouettes(seconds=2.0)
    for seed in range(40):
        empty = silhouettes.apply(wall(seed))
    assert empty.sum() == 0
    for step in range(10):
        image = wall(100 + step)
        truth = np.zeros((120, 160), np.uint8)
        cv2.ellipse(truth, (50 + 3 * step, 60), (12, 35), 0, 0, 360, 1, -1)
        image[truth > 0] = (40, 30, 200)
        found = silhouettes.apply(image, learn=False)
    truth = truth.astype(bool)
    assert (found & truth).sum() / (found | truth).sum() > 0.9


def test_what_stays_becomes_background_only_while_learning():
    image = wall(0)
    image[40:80, 60:90] = (40, 30, 200)
    for learn, remains in ((True, False), (False, True)):
        silhouettes = Silhouettes(seconds=1.0)
        for seed in range(40):
            silhouettes.apply(wall(seed))
        for _ in range(120):
            found = silhouettes.apply(image, learn=learn)
        assert bool(found[60, 75]) == remains


def test_sizes_are_checked():
    silhouettes = Silhouettes()
    silhouettes.apply(wall(0))
    with pytest.raises(MeasurementError, match="as before"):
        silhouettes.apply(wall(0)[:50])
    with pytest.raises(MeasurementError, match="uint8"):
        silhouettes.apply(wall(0).astype(float))
    with pytest.raises(MeasurementError, match="> 0"):
        Silhouettes(seconds=0.0)
