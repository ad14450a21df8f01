"""Draws bodies into an image: shaded limbs, joints and sites; several persons each with a separate color and number."""

from __future__ import annotations

from collections.abc import Mapping

import cv2
import numpy as np

from voodoo._core import Estimate, TaperedEllipticCylinder
from voodoo.drawing.ink import INK, PAPER, SUBPIXEL, Color, Picture, drawable, fixed, person_color, point, side_color
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.model.projection import View, limb_mesh, limb_silhouette, transform
from voodoo.people import PeopleEstimate, Person

_OPACITY = 0.62
_NORMAL_M = 1e-3
_DEVIATIONS = 2.0
"""Semi-axes of the ellipses in standard deviations."""
_STEP_M = 1e-4
_ABOVE_M = 0.2
"""Height of the number above the head [m]."""


def draw_body(picture: Picture, body: Body, estimate: Estimate, view: View, *, color: Color | None = None) -> None:
    """Draw limbs as shaded, semitransparent solids with silhouettes, the farthest first, then joints and sites with their
    ellipses of two standard deviations.

    Nothing is drawn while no person is tracked.

    Args:
        picture: image to draw into.
        body: body with its current sizes.
        estimate: the pose.
        view: projection into the image.
        color: color of all parts; None: by side, see `side_color`.
    """
    if not estimate.joints:
        return
    limbs = []
    for limb in body.limbs:
        root_from_limb = np.asarray(estimate.world_from_limb[limb.name], dtype=np.float64)
        contour = limb_silhouette(limb.shape, root_from_limb, view)
        if contour is not None:
            center = transform(root_from_limb, np.array([[0.0, 0.0, limb.shape.length / 2.0]]))
            limbs.append((float(view.project(center)[1][0]), limb, root_from_limb, contour))
    layer, covered = picture.copy(), np.zeros(picture.shape[:2], dtype=np.uint8)
    for _, limb, root_from_limb, contour in sorted(limbs, key=lambda item: -item[0]):
        _draw_solid(layer, limb.shape, root_from_limb, view, color or side_color(limb.name))
        border = fixed(contour)
        cv2.polylines(layer, [border], True, PAPER, 1, cv2.LINE_AA, SUBPIXEL)
        cv2.fillConvexPoly(covered, border, 255, cv2.LINE_8, SUBPIXEL)
    inside = covered > 0
    mixed = cv2.addWeighted(layer, _OPACITY, picture, 1.0 - _OPACITY, 0.0)
    picture[inside] = mixed[inside]
    for _, limb, _, contour in limbs:
        cv2.polylines(picture, [fixed(contour)], True, color or side_color(limb.name), 1, cv2.LINE_AA, SUBPIXEL)
    _draw_spread(picture, estimate, view, color)
    _draw_sites(picture, estimate, view, color)


def draw_people(picture: Picture, estimate: PeopleEstimate, bodies: Mapping[int, Body], view: View) -> None:
    """Draw all persons with a pose, the farthest first.

    Args:
        picture: image to draw into.
        estimate: the persons.
        bodies: their bodies, with current sizes.
        view: projection into the image.
    """
    posed = [person for person in estimate if person.estimate.joints]
    middles = {person.id: np.mean(list(person.estimate.joints.values()), axis=0) for person in posed}
    away = {number: float(view.project(middle[None])[1][0]) for number, middle in middles.items()}
    for person in sorted(posed, key=lambda one: -away[one.id]):
        draw_body(picture, bodies[person.id], person.estimate, view, color=person_color(person.id))
    for person in posed:
        _number(picture, person, view)


def _number(picture: Picture, person: Person, view: View) -> None:
    """Draw the number above the head."""
    places = np.array(list(person.estimate.joints.values()), dtype=np.float64)
    pixels = view.project(places)[0]
    pixels = pixels[drawable(pixels)]
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


def _draw_solid(
    layer: Picture, shape: TaperedEllipticCylinder, root_from_limb: FloatArray, view: View, color: Color
) -> None:
    """Fill the triangles of a limb that face the viewer; the brightness grows with the cosine of the angle to the view."""
    vertices, triangles, normals = limb_mesh(shape)
    places = transform(root_from_limb, vertices.astype(np.float64))
    pixels, depths = view.project(places)
    # The light is at the viewer: the cosine is the decrease of the depth for a small step along the normal.
    towards = (depths - view.project(places + _NORMAL_M * normals @ root_from_limb[:3, :3].T)[1]) / _NORMAL_M
    lights = (0.35 + 0.65 * np.clip(towards, 0.0, 1.0))[triangles].mean(axis=1)
    a, b, c = pixels[triangles].transpose(1, 2, 0)
    facing = (b[0] - a[0]) * (c[1] - a[1]) < (b[1] - a[1]) * (c[0] - a[0])  # the others are behind the limb
    for facet, light in zip(fixed(pixels[triangles[facing]]), lights[facing].tolist(), strict=True):
        cv2.fillConvexPoly(layer, facet, tuple(light * channel for channel in color), cv2.LINE_8, SUBPIXEL)


def _draw_spread(picture: Picture, estimate: Estimate, view: View, color: Color | None) -> None:
    """Draw the uncertainty of every joint and site as an ellipse of two standard deviations, if it is known."""
    covariances = estimate.joint_covariances
    if len(covariances) != len(estimate.joints) or not np.isfinite(covariances).all():
        return
    places = np.array(list(estimate.joints.values()), dtype=np.float64)
    pixels, depths = view.project(places)
    # Jacobian of the pixel by the position.
    moved = np.stack([view.project(places + _STEP_M * axis)[0] for axis in np.eye(3)], axis=2)
    jacobians = (moved - pixels[:, :, None]) / _STEP_M
    layer = picture.copy()
    visible = (depths > 0.0) & np.isfinite(jacobians).all(axis=(1, 2)) & drawable(pixels)
    for index, name in enumerate(estimate.joints):
        if visible[index]:
            spread = jacobians[index] @ covariances[index] @ jacobians[index].T
            variances, axes = np.linalg.eigh(spread)
            radii = _DEVIATIONS * np.sqrt(np.maximum(variances[::-1], 0.0))
            angle = float(np.degrees(np.arctan2(axes[1, 1], axes[0, 1])))
            if radii[0] < max(picture.shape[:2]):
                size = (max(1, round(radii[0] * 2**SUBPIXEL)), max(1, round(radii[1] * 2**SUBPIXEL)))
                contour = (point(pixels[index]), size, angle, 0.0, 360.0)
                cv2.ellipse(layer, *contour, color or side_color(name), 1, cv2.LINE_AA, SUBPIXEL)
    picture[:] = cv2.addWeighted(layer, 0.7, picture, 0.3, 0.0)


def _draw_sites(picture: Picture, estimate: Estimate, view: View, color: Color | None) -> None:
    """Draw every joint and site as a dot with a dark rim."""
    pixels, _ = view.project(np.array(list(estimate.joints.values()), dtype=np.float64))
    radius = max(3, round(picture.shape[0] / 160))
    for name, pixel in zip(estimate.joints, pixels, strict=True):
        if drawable(pixel):
            center = point(pixel)
            cv2.circle(picture, center, (radius + 2) << SUBPIXEL, PAPER, -1, cv2.LINE_AA, SUBPIXEL)
            cv2.circle(picture, center, (radius + 1) << SUBPIXEL, color or side_color(name), -1, cv2.LINE_AA, SUBPIXEL)
            cv2.circle(picture, center, (radius - 1) << SUBPIXEL, INK, -1, cv2.LINE_AA, SUBPIXEL)
