//! Changes of the body between frames that keep the track (K06 IV: "changes in the model itself").

use super::Tracker;
use crate::body::{Body, Joint};
use crate::error::BodyError;
use crate::math::Vec3;
use crate::shape::TaperedEllipticCylinder;
use crate::tracker::estimate::LimbStatus;

impl Tracker {
    /// Scales the whole body about its root.
    pub fn scale(&mut self, factor: f64) -> Result<(), BodyError> {
        let (body, given) = (self.body.scaled(factor)?, self.given.scaled(factor)?);
        self.adopt(body, given);
        Ok(())
    }

    /// Changes the dimensions of one limb.
    pub fn set_shape(&mut self, limb: &str, shape: TaperedEllipticCylinder) -> Result<(), BodyError> {
        let (body, given) = (self.body.with_shape(limb, shape)?, self.given.with_shape(limb, shape)?);
        self.adopt(body, given);
        Ok(())
    }

    /// Adds a limb (a held box); it starts with its joint closed and at rest.
    pub fn add_limb(
        &mut self,
        name: &str,
        parent: &str,
        shape: TaperedEllipticCylinder,
        joint: Joint,
        sites: Vec<(String, Vec3)>,
    ) -> Result<(), BodyError> {
        let given = self.given.with_limb(name, parent, shape, joint.clone(), sites.clone())?;
        let body = self.body.with_limb(name, parent, shape, joint, sites)?;
        if self.started
            && let Some((parent, joint)) = body.limbs().last().and_then(|limb| limb.parent.as_ref())
        {
            self.poses.push(self.poses[*parent] * joint.parent_from_limb_at_rest());
        }
        self.adopt(body, given);
        Ok(())
    }

    /// Removes a limb with all that hangs on it.
    pub fn remove_limb(&mut self, name: &str) -> Result<(), BodyError> {
        let (given, _) = self.given.without_limb(name)?;
        let (body, kept) = self.body.without_limb(name)?;
        if self.started {
            self.poses = kept.iter().map(|index| self.poses[*index]).collect();
        }
        self.adopt(body, given);
        Ok(())
    }

    /// Takes a changed body and closes its joints from the root outwards, orientations kept.
    fn adopt(&mut self, body: Body, given: Body) {
        self.body = body;
        self.given = given;
        // The motion starts anew: the poses before belong to another body.
        self.previous.clear();
        self.interval = None;
        self.prepare_hypotheses();
        if !self.started {
            return;
        }
        for (index, limb) in self.body.limbs().iter().enumerate() {
            if let Some((parent, joint)) = &limb.parent {
                let centre = self.poses[*parent] * joint.parent_from_joint.translation;
                self.poses[index].translation = centre - self.poses[index].rotation * joint.limb_from_joint.translation;
            }
        }
        self.girths.clear();
        self.correspondences.limbs.clear();
        self.correspondences.sites.clear();
        self.correspondences.contour.clear();
        if !self.pairs.is_empty() {
            self.follow_lengths();
        }
        self.prepare_search();
        self.judgement.clear();
        self.estimate.limb_status.clear();
        self.estimate.limb_status.resize(self.poses.len(), LimbStatus::Inferred);
        let status = self.estimate.status;
        self.report(self.stamp.unwrap_or(f64::NAN), 0);
        self.estimate.status = status;
    }
}
