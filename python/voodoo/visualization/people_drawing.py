"""Draws several persons into an image, each with a separate color and number."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np

from voodoo.drawing.ink import PAPER, FloatArray, Picture, person_color
from voodoo.model.body import Body
from voodoo.model.projection import View
from voodoo.people import PeopleEstimate, Person
from voodoo.visualization.body_drawing import draw_body

_ABOVE_M = 0.2
"""Height of the number above the head [m]."""


def draw_people(picture: Picture, estimate: PeopleEstimate, bodies: Mapping[int, Body], view: View) -> None:
    """Draw all persons with a pose, the farthest first.

    Args:
        picture: image to draw into.
        estimate: the persons.
        bodies: their bodies, with current sizes.
        view: projection into the image.
    """
    posed = [person for person in estimate if person.estimate.joints]
    away = {person.id: float(view.project(_middle(person)[None])[1][0]) for person in posed}
    for person in sorted(posed, key=lambda one: -away[one.id]):
        draw_body(picture, bodies[person.id], person.estimate, view, color=person_color(person.id))
    for person in posed:
        _number(picture, person, view)


def _middle(person: Person) -> FloatArray:
    return np.asarray(np.mean(list(person.estimate.joints.values()), axis=0))


def _number(picture: Picture, person: Person, view: View) -> None:
    """Draw the number above the head."""
    places = np.array(list(person.estimate.joints.values()), dtype=np.float64)
    pixels = view.project(places)[0]
    pixels = pixels[np.isfinite(pixels).all(axis=1) & (np.abs(pixels) < 1e5).all(axis=1)]
    if not len(pixels):
        return
    size = picture.shape[0] / 500.0
    words = str(person.id)
    (width, height), _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_DUPLEX, size, 2)
    high = pixels[pixels[:, 1].argmin()]
    tall = float(np.ptp(pixels[:, 1]) / max(float(np.ptp(places[:, 2])), 0.1))
    x = int(np.clip(high[0] - width / 2, 0, picture.shape[1] - width))
    y = int(np.clip(high[1] - _ABOVE_M * tall, height + 2, picture.shape[0] - 2))
    cv2.putText(picture, words, (x, y), cv2.FONT_HERSHEY_DUPLEX, size, PAPER, 6, cv2.LINE_AA)
    cv2.putText(picture, words, (x, y), cv2.FONT_HERSHEY_DUPLEX, size, person_color(person.id), 2, cv2.LINE_AA)
