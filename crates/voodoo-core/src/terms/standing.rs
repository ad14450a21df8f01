//! Joints that have stood still are expected to go on standing: a foot on the ground does not creep while the body moves over it.
//!
//! Along a limb, points hardly hold it: what the joints above ask for slides it through the surface that is seen. A joint that
//! really moves does so by more than the well is wide, and is free.

use super::{Term, surface::geman_mcclure};
use crate::body::Body;
use crate::geometry::{Mat3, Pose, Vec3};
use crate::normal::Normal;

/// A place on a limb and where it has stood.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stand {
    /// Index of the limb.
    pub limb: usize,
    /// The place, limb frame, metres.
    pub place: Vec3,
    /// Where it has stood, working frame, metres.
    pub stood: Vec3,
    /// How sure that is, 0 to 1.
    pub weight: f64,
}

/// Distances of the places from where they stood, under the Geman-McClure kernel.
#[derive(Debug)]
pub struct Standing<'a> {
    /// The places.
    pub stands: &'a [Stand],
    /// Information of a place of weight one, 1/m^2.
    pub information: f64,
    /// Scale of the kernel, metres.
    pub scale: f64,
}

impl Term for Standing<'_> {
    fn add(&self, _body: &Body, poses: &[Pose], normal: &mut Normal) {
        for stand in self.stands {
            let x = poses[stand.limb] * stand.place;
            let r = x - stand.stood;
            let information = stand.weight * self.information;
            let (rho, kernel) = geman_mcclure(r.length(), self.scale);
            normal.cost += information * rho;
            normal.limbs[stand.limb].add_point(&(Mat3::IDENTITY * (information * kernel)), x, r);
        }
    }
}
