//! A foot that stands stays where it is. The prior holds joint angles, and by itself would carry the feet along with a trunk that
//! moves over them.

use super::{Term, surface::geman_mcclure};
use crate::body::Body;
use crate::geometry::{Mat3, Pose, Vec3};
use crate::normal::Normal;

/// The far end of a leg's lower limb.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// The limb.
    pub limb: usize,
    /// Where it stands, working frame.
    pub place: Vec3,
    /// How sure it is that it stands there, 0 to 1.
    pub sure: f64,
}

impl Foot {
    /// Where it is.
    pub fn at(&self, body: &Body, poses: &[Pose]) -> Vec3 {
        poses[self.limb] * (Vec3::Z * body.limbs()[self.limb].shape.length())
    }
}

/// `r = x - place` under the Geman-McClure kernel: a foot that makes a step leaves it behind.
#[derive(Debug)]
pub struct Stance<'a> {
    /// The feet.
    pub feet: &'a [Foot],
    /// How much of each limb shows, one at most: where a foot that nobody sees stands, nobody knows.
    pub shown: &'a [f64],
    /// Standard deviation of a foot that stands, metres.
    pub sigma: f64,
    /// Scale of the kernel, metres.
    pub scale: f64,
}

impl Term for Stance<'_> {
    fn add(&self, body: &Body, poses: &[Pose], normal: &mut Normal) {
        for foot in self.feet {
            let information = foot.sure * self.shown[foot.limb] / (self.sigma * self.sigma);
            let x = foot.at(body, poses);
            let r = x - foot.place;
            let (rho, kernel) = geman_mcclure(r.length(), self.scale);
            normal.cost += information * rho;
            normal.limbs[foot.limb].add_point(&(Mat3::IDENTITY * (information * kernel)), x, r);
        }
    }
}
