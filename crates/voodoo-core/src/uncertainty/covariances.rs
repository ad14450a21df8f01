//! Covariances of sites, limbs and joints of a frame.

use nalgebra::Matrix6;

use crate::body::Body;
use crate::math::{Mat3, Vec3, reset};

/// Covariances of a frame's pose. World frame, meters, radians; NaN before the first frame.
///
/// [`Estimate`](crate::Estimate) has an example.
#[derive(Clone, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Covariances {
    /// Covariance of the position of every site.
    pub sites: Vec<Mat3>,
    /// Covariance of the pose of every limb frame: its position, then its rotation about world axes through its origin.
    pub limbs: Vec<[[f64; 6]; 6]>,
    /// Covariance of the rotation of every limb's joint to its parent, about world axes; for the root, of its own rotation.
    pub turns: Vec<Mat3>,
    /// Standard deviation of every limb's length and of its mean radius, meters; NaN where they are not refined.
    pub lengths: Vec<f64>,
    /// See `lengths`.
    pub girths: Vec<f64>,
}

impl Covariances {
    /// Sets all covariances of this body to NaN.
    pub(crate) fn forget(&mut self, body: &Body) {
        reset(&mut self.sites, body.sites().len(), Mat3::NAN);
        reset(&mut self.limbs, body.limbs().len(), [[f64::NAN; 6]; 6]);
        reset(&mut self.turns, body.limbs().len(), Mat3::NAN);
        reset(&mut self.lengths, body.limbs().len(), f64::NAN);
        reset(&mut self.girths, body.limbs().len(), f64::NAN);
    }

    /// Sets those of a limb from the covariance of its rotation and translation, and the deviation of joints from their positions
    /// in it.
    pub(super) fn set_limb(&mut self, limb: usize, covariance: &Matrix6<f64>, site_sigma: f64) {
        let place = |index: usize| (index + 3) % 6;
        let mut own = std::array::from_fn(|i| std::array::from_fn(|j| covariance[(place(i), place(j))]));
        (0..3).for_each(|axis| own[axis][axis] += site_sigma * site_sigma);
        self.limbs[limb] = own;
    }

    /// Sets that of the rotation of a limb's joint from the covariance of the rotations about its axes.
    pub(super) fn set_turn(&mut self, limb: usize, joint: &Matrix6<f64>, [x, y, z]: [Vec3; 3]) {
        let axes = Mat3::from_cols(x, y, z);
        let turns = Mat3::from_cols_array_2d(&[0, 1, 2].map(|j| [0, 1, 2].map(|i| joint[(i, j)])));
        self.turns[limb] = symmetric(axes * turns * axes.transpose());
    }

    /// Sets that of a site at `lever` from the origin of its limb's frame, world axes.
    pub(super) fn set_site(&mut self, site: usize, limb: usize, lever: Vec3) {
        let own = &self.limbs[limb];
        let block = |row: usize, column: usize| {
            Mat3::from_cols_array_2d(&[0, 1, 2].map(|j| [0, 1, 2].map(|i| own[row + i][column + j])))
        };
        // A rotation moves the site by `turn x lever`.
        let turned = Mat3::from_cols(Vec3::X.cross(lever), Vec3::Y.cross(lever), Vec3::Z.cross(lever));
        let mixed = turned * block(3, 0);
        let covariance = block(0, 0) + mixed + mixed.transpose() + turned * block(3, 3) * turned.transpose();
        self.sites[site] = symmetric(covariance);
    }
}

fn symmetric(matrix: Mat3) -> Mat3 {
    0.5 * (matrix + matrix.transpose())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Quat;

    #[test]
    fn a_site_moves_as_its_limb_shifts_and_turns() {
        let lever = Vec3::new(0.1, -0.3, 0.2);
        let limb = Matrix6::from_fn(|i, j| ((i * 5 + j * 3) % 7) as f64 - 3.0);
        let limb = limb * limb.transpose() * 1e-4;
        let (sites, limbs) = (vec![Mat3::NAN], vec![[[f64::NAN; 6]; 6]]);
        let mut covariances = Covariances { sites, limbs, ..Covariances::default() };
        covariances.set_limb(0, &limb, 0.02);
        covariances.set_site(0, 0, lever);
        // Finite differences of the site's position for small rotations and translations of the limb.
        let h = 1e-6;
        let column = |index: usize| match index {
            0..3 => (Quat::from_axis_angle(Vec3::AXES[index], h) * lever - lever) / h,
            _ => Vec3::AXES[index - 3],
        };
        for i in 0..3 {
            for j in 0..3 {
                let mut expected = if i == j { 0.02 * 0.02 } else { 0.0 };
                for a in 0..6 {
                    for b in 0..6 {
                        expected += column(a)[i] * limb[(a, b)] * column(b)[j];
                    }
                }
                assert!((covariances.sites[0].col(j)[i] - expected).abs() < 1e-7, "{i}, {j}");
            }
        }
        // Position first, as in a message.
        assert!((covariances.limbs[0][0][4] - limb[(3, 1)]).abs() < 1e-15);
    }
}
