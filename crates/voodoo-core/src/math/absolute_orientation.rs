//! Weighted absolute orientation from accumulated moments (Horn 1987; K06 eq. 1, K07 eq. 1-5).

use nalgebra::{Matrix4, SymmetricEigen};

use crate::math::{Pose, Quat, Vec3};

/// Weighted moments of point pairs `(x, p)`, which are sufficient for absolute orientation. A repeated pair is added once, with a
/// multiple of its weight.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Moments {
    /// Sum of the weights.
    pub weight: f64,
    /// Weighted sum of the model points.
    pub x: Vec3,
    /// Weighted sum of the measured points.
    pub p: Vec3,
    /// Weighted sum of `p x^T`, column by column.
    pub px: [Vec3; 3],
}

impl Moments {
    /// Adds one pair.
    pub(crate) fn add(&mut self, weight: f64, x: Vec3, p: Vec3) {
        self.weight += weight;
        self.x += weight * x;
        self.p += weight * p;
        (0..3).for_each(|axis| self.px[axis] += (weight * x[axis]) * p);
    }

    /// The rigid motion `p_from_x` with the least weighted sum of squared distances, `None` without weight.
    ///
    /// `stay` (meters) is the lever of a weak prior for zero rotation. Directions of rotation that the pairs leave free (one
    /// point, points on a line) are not rotated at all. The others are reduced by less than `1e-6` of their value when the points
    /// spread farther than `stay`.
    pub(crate) fn absolute_orientation(&self, stay: f64) -> Option<Pose> {
        if self.weight.is_nan() || self.weight <= 0.0 {
            return None;
        }
        let (mean_x, mean_p) = (self.x / self.weight, self.p / self.weight);
        // Cross-covariance sum w (x - mx)(p - mp)^T, transposed to S[row x][column p] as Horn writes it.
        let centered = [0, 1, 2].map(|axis| self.px[axis] - mean_x[axis] * self.p);
        let stay = 1e-6 * self.weight * stay * stay;
        let s = |x: usize, p: usize| centered[x][p] + if x == p { stay } else { 0.0 };
        // Horn's symmetric matrix N; the eigenvector of its largest eigenvalue is the quaternion (w, x, y, z).
        let [x, y, z] = [0, 1, 2].map(|axis| s(axis, axis));
        let [yz, zx, xy] = [(1, 2), (2, 0), (0, 1)].map(|(a, b)| s(a, b) + s(b, a));
        let [rx, ry, rz] = [(1, 2), (2, 0), (0, 1)].map(|(a, b)| s(a, b) - s(b, a));
        let n = Matrix4::from([
            [x + y + z, rx, ry, rz],
            [rx, x - y - z, xy, zx],
            [ry, xy, y - x - z, yz],
            [rz, zx, yz, z - x - y],
        ]);
        let eigen = SymmetricEigen::new(n);
        let q = eigen.eigenvectors.column(eigen.eigenvalues.imax());
        let rotation = Quat::from_xyzw(q[1], q[2], q[3], q[0]).normalize();
        let pose = Pose::from_parts(mean_p - rotation * mean_x, rotation);
        pose.is_finite().then_some(pose)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn vector(range: f64) -> impl Strategy<Value = Vec3> {
        [-range..range, -range..range, -range..range].prop_map(Vec3::from_array)
    }

    proptest! {
        #[test]
        fn recovers_a_motion(axis in vector(3.0), shift in vector(5.0), points in proptest::collection::vec(vector(1.0), 4..20)) {
            let truth = Pose::new(shift, axis);
            let mut moments = Moments::default();
            for (index, point) in points.iter().enumerate() {
                moments.add(1.0 + index as f64, *point, truth * *point);
            }
            let found = moments.absolute_orientation(0.0).unwrap();
            for point in points {
                prop_assert!((found * point - truth * point).length() < 1e-6);
            }
        }

        #[test]
        fn one_point_only_shifts(x in vector(1.0), p in vector(1.0)) {
            let mut moments = Moments::default();
            moments.add(3.0, x, p);
            let found = moments.absolute_orientation(0.1).unwrap();
            prop_assert!(found.rotation.angle_between(Quat::IDENTITY) < 1e-6);
            prop_assert!((found * x - p).length() < 1e-9);
        }

        #[test]
        fn a_line_is_turned_the_shortest_way(direction in vector(1.0), axis in vector(1.0)) {
            prop_assume!(direction.length() > 0.1 && axis.length() > 0.1);
            let direction = direction.normalize();
            // A rotation about an axis perpendicular to the line is the shortest one that maps it.
            let square = direction.any_orthonormal_vector();
            let turn = Quat::from_axis_angle(square, axis.length().min(1.2));
            let mut moments = Moments::default();
            for t in [-1.0, 0.2, 1.0] {
                moments.add(1.0, direction * t, turn * (direction * t));
            }
            let found = moments.absolute_orientation(0.1).unwrap();
            prop_assert!(found.rotation.angle_between(turn) < 1e-4);
        }
    }

    #[test]
    fn nothing_gives_nothing() {
        assert_eq!(Moments::default().absolute_orientation(0.1), None);
    }
}
