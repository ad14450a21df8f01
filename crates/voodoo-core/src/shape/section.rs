//! Cross sections of a limb: the ellipse at a height, and the part of it that faces a camera.

use super::TaperedEllipticCylinder;
use crate::math::{Pose, Vec3};

/// The ellipse in which a plane perpendicular to the axis cuts the side, limb frame, meters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Section {
    /// Semi-axis along x.
    pub a: f64,
    /// Semi-axis along y.
    pub b: f64,
    /// Height of the plane above the proximal end.
    pub z: f64,
}

/// A section and the directions of its visible part for a camera, limb frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FacingSection {
    /// The section.
    pub section: Section,
    /// Vector from its center to the camera, meters.
    pub to_camera: Vec3,
    /// The component of `to_camera` perpendicular to the axis, meters.
    pub across: Vec3,
    /// The unit vector along `across`: the middle of the visible part lies in this direction.
    pub ahead: Vec3,
    /// The unit vector perpendicular to `ahead` and to the axis: the section's borders in the image lie approximately in this
    /// direction.
    pub side: Vec3,
}

impl TaperedEllipticCylinder {
    /// The section at the fraction `t` of the length, 0 at the proximal end and 1 at the distal one.
    #[inline]
    pub(crate) fn section(&self, t: f64) -> Section {
        Section { a: self.a0 + t * (self.a1 - self.a0), b: self.b0 + t * (self.b1 - self.b0), z: t * self.length }
    }

    /// The sections at the proximal and the distal end, exactly.
    #[inline]
    pub(crate) fn ends(&self) -> [Section; 2] {
        [Section { a: self.a0, b: self.b0, z: 0.0 }, Section { a: self.a1, b: self.b1, z: self.length }]
    }
}

impl Section {
    /// Its center, on the axis.
    #[inline]
    pub(crate) fn center(&self) -> Vec3 {
        Vec3::new(0.0, 0.0, self.z)
    }

    /// The part of it that faces a camera; `None` when the camera looks along the axis.
    #[inline]
    pub(crate) fn facing(self, camera_from_limb: &Pose) -> Option<FacingSection> {
        let to_camera = camera_from_limb.rotation.inverse() * -(*camera_from_limb * self.center());
        let across = to_camera.with_z(0.0);
        let ahead = across.try_normalize()?;
        let side = Vec3::new(-ahead.y, ahead.x, 0.0);
        Some(FacingSection { section: self, to_camera, across, ahead, side })
    }

    /// Extent of the ellipse along a unit vector perpendicular to the axis, meters: the distance of its tangent from the center.
    #[inline]
    pub(crate) fn extent(&self, direction: Vec3) -> f64 {
        let (x, y) = (self.a * direction.x, self.b * direction.y);
        (x * x + y * y).sqrt()
    }

    /// The point of the ellipse with the largest extent along a unit vector perpendicular to the axis, meters.
    #[inline]
    pub(crate) fn farthest_point(&self, direction: Vec3) -> Vec3 {
        let extent = self.extent(direction);
        Vec3::new(self.a * self.a * direction.x / extent, self.b * self.b * direction.y / extent, self.z)
    }
}

impl FacingSection {
    /// The point on the rim at the lateral position `s`, from -1 to 1, as the camera sees it: 0 is the middle, in units of the
    /// semi-axes.
    #[inline]
    pub(crate) fn point(&self, s: f64) -> Vec3 {
        let place = self.ahead * (1.0 - s * s).sqrt() + self.side * s;
        Vec3::new(self.section.a * place.x, self.section.b * place.y, self.section.z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn shapes() -> impl Strategy<Value = TaperedEllipticCylinder> {
        (0.1..0.6, 0.02..0.2, 0.02..0.2, 0.02..0.2, 0.02..0.2)
            .prop_map(|(length, a0, b0, a1, b1)| TaperedEllipticCylinder::new(length, a0, b0, a1, b1).unwrap())
    }

    fn vectors(range: f64) -> impl Strategy<Value = Vec3> {
        [-range..range, -range..range, -range..range].prop_map(Vec3::from_array)
    }

    proptest! {
        #[test]
        fn what_faces_a_camera_is_on_the_surface_and_nearer_than_the_axis(
            shape in shapes(), place in vectors(1.0), turn in vectors(2.0), t in 0.05..0.95, s in -0.9..0.9,
        ) {
            let camera_from_limb = Pose::new(place + 2.0 * Vec3::Z, turn);
            let section = shape.section(t);
            let facing = section.facing(&camera_from_limb).unwrap();
            prop_assume!(facing.across.length() > 0.5);
            let point = facing.point(s);
            prop_assert!(shape.closest_point(point).signed_distance.abs() < 1e-9);
            // The camera is at the origin of its frame, here in the limb frame.
            let camera = camera_from_limb.inverse_transform_point(Vec3::ZERO);
            prop_assert!((section.center() + facing.to_camera - camera).length() < 1e-9);
            prop_assert!((facing.point(0.0) - section.center()).dot(facing.ahead) > 0.0, "the middle faces the camera");
            prop_assert!(facing.ahead.dot(facing.side).abs() < 1e-12 && facing.side.z == 0.0);
        }

        #[test]
        fn no_point_of_the_ellipse_reaches_farther(shape in shapes(), angle in 0.0..std::f64::consts::TAU, t in 0.0..1.0) {
            let section = shape.section(t);
            let direction = Vec3::new(angle.cos(), angle.sin(), 0.0);
            // A dense search that does not use tangents.
            let rim = (0..20_000).map(|k| f64::from(k) * std::f64::consts::TAU / 20_000.0);
            let points = rim.map(|at| Vec3::new(section.a * at.cos(), section.b * at.sin(), section.z));
            let best = points.max_by(|p, q| p.dot(direction).total_cmp(&q.dot(direction))).unwrap();
            prop_assert!((best.dot(direction) - section.extent(direction)).abs() < 1e-7);
            prop_assert!((best - section.farthest_point(direction)).length() < 2e-4);
        }
    }

    #[test]
    fn a_camera_on_the_axis_sees_no_side() {
        let shape = TaperedEllipticCylinder::new(0.4, 0.1, 0.05, 0.06, 0.04).unwrap();
        let camera_from_limb = Pose::from_translation(Vec3::new(0.0, 0.0, 2.0));
        assert_eq!(shape.section(0.5).facing(&camera_from_limb), None);
    }
}
