//! Changes of the body between frames that keep the track (K06 IV: "changes in the model itself").

use super::BodyTracker;
use crate::body::Joint;
use crate::error::{BodyError, TrackError};
use crate::math::Vec3;
use crate::observation::picture::ColorPixels;
use crate::shape::TaperedEllipticCylinder;

impl BodyTracker {
    /// Scales the whole body about its root.
    pub fn scale(&mut self, factor: f64) -> Result<(), BodyError> {
        self.model.edit(|body| body.scaled(factor))?;
        self.edited();
        Ok(())
    }

    /// Changes the dimensions of one limb.
    pub fn set_shape(&mut self, limb: &str, shape: TaperedEllipticCylinder) -> Result<(), BodyError> {
        self.model.edit(|body| body.with_shape(limb, shape))?;
        self.edited();
        Ok(())
    }

    /// Adds a limb, for example a held box. It starts with its joint closed and in the rest pose.
    pub fn add_limb(
        &mut self,
        name: &str,
        parent: &str,
        shape: TaperedEllipticCylinder,
        joint: Joint,
        sites: Vec<(String, Vec3)>,
    ) -> Result<(), BodyError> {
        self.model.edit(|body| body.with_limb(name, parent, shape, joint.clone(), sites.clone()))?;
        if self.is_started()
            && let Some((parent, joint)) = self.model.body.limbs().last().and_then(|limb| limb.parent.as_ref())
        {
            self.motion.poses.push(self.motion.poses[*parent] * joint.parent_from_limb_at_rest());
        }
        self.edited();
        Ok(())
    }

    /// Removes a limb with all its descendants.
    pub fn remove_limb(&mut self, name: &str) -> Result<(), BodyError> {
        let (_, kept) = self.model.body.without_limb(name)?;
        self.model.edit(|body| body.without_limb(name).map(|(body, _)| body))?;
        if self.is_started() {
            self.motion.poses = kept.iter().map(|index| self.motion.poses[*index]).collect();
        }
        self.edited();
        Ok(())
    }

    /// Stores color pictures of the empty scene for a color camera, each with its height and width. An empty slice removes them.
    pub fn set_background(&mut self, camera: u16, pictures: &[(ColorPixels, [usize; 2])]) -> Result<(), TrackError> {
        self.fit.regions.set_background(camera, pictures)
    }

    /// Updates the tracker after a change of the body, and closes the joints from the root outwards; orientations are kept.
    fn edited(&mut self) {
        self.jump();
        let Self { model, motion, fit, hypotheses, relocalizer, sizes, assessor, estimate, .. } = self;
        hypotheses.restart();
        relocalizer.detector.bind(&model.body);
        if motion.poses.is_empty() {
            return;
        }
        model.body.close_joints(&mut motion.poses);
        relocalizer.set_tracked(&motion.poses);
        fit.clear();
        sizes.edited(model);
        assessor.restart(estimate.status);
        self.report(self.motion.stamp.unwrap_or(f64::NAN), 0, None);
    }
}
