//! Edits of a body between frames (K06 IV: scale, dimensions, adding and removing parts). Each returns a new body.

use super::{Body, Joint, Limb, Site};
use crate::error::{BodyError, Unexpected};
use crate::math::Vec3;
use crate::shape::TaperedEllipticCylinder;

/// Maximum factor by which one look at a free tip stretches or shrinks its limb.
const MOST_TIP_STRETCH: f64 = 1.25;

/// Limbs of equal length: a left-right pair, or a single limb of the trunk.
pub(crate) type Pair = Vec<usize>;

impl Body {
    /// The body with all lengths multiplied by `factor`.
    pub fn scaled(&self, factor: f64) -> Result<Self, BodyError> {
        Unexpected::unless(factor.is_finite() && factor > 0.0, "factor", "a finite factor above zero", factor)?;
        let mut body = self.clone();
        for limb in &mut body.limbs {
            limb.shape = limb
                .shape
                .stretched(factor, [factor; 4])
                .map_err(|error| Unexpected { what: format!("limbs.{}.{}", limb.name, error.what), ..error })?;
            if let Some((_, joint)) = &mut limb.parent {
                joint.parent_from_joint.translation *= factor;
                joint.limb_from_joint.translation *= factor;
                joint.semi_axes = joint.semi_axes.map(|axis| axis * factor);
            }
        }
        for site in &mut body.sites {
            site.position *= factor;
        }
        body.check()?;
        Ok(body)
    }

    /// The body with another shape for one limb. Joints and sites on the limb move along with the change of length.
    pub fn with_shape(&self, limb: &str, shape: TaperedEllipticCylinder) -> Result<Self, BodyError> {
        let index = self.limb_index(limb)?;
        let stretch = Vec3::new(1.0, 1.0, shape.length() / self.limbs[index].shape.length());
        let mut body = self.clone();
        body.limbs[index].shape = shape;
        body.map_landmarks(index, |position| position * stretch);
        body.check()?;
        Ok(body)
    }

    /// Moves the surface of a limb perpendicular to its axis by `shift` (limb frame, meters) and multiplies its semi-axes (a0,
    /// b0, a1, b1) by `axes`. The limb frame moves with the surface; joints and sites stay at their world positions. Does nothing
    /// if the result would not be a valid solid.
    pub(crate) fn change_girth(&mut self, limb: usize, shift: Vec3, axes: [f64; 4]) -> bool {
        self.reshape(limb, 1.0, axes, |position| position - shift)
    }

    /// Lengthens the surface of a limb with a free tip by a factor, within limits; joints and sites stay. Does nothing if the result
    /// would not be a valid solid.
    pub(crate) fn change_tip(&mut self, limb: usize, factor: f64) {
        self.reshape(limb, factor.clamp(1.0 / MOST_TIP_STRETCH, MOST_TIP_STRETCH), [1.0; 4], |position| position);
    }

    /// Limbs that have children, grouped into left-right pairs of equal length.
    pub fn pairs(&self) -> Vec<Pair> {
        let groups = self.roles.groups();
        let mut pairs: Vec<Pair> = Vec::new();
        for index in (0..self.limbs.len()).filter(|index| self.children(*index).next().is_some()) {
            match pairs.iter_mut().find(|pair| groups[pair[0]] == groups[index]) {
                Some(pair) => pair.push(index),
                None => pairs.push(vec![index]),
            }
        }
        pairs
    }

    /// Lengthens a limb by a factor, with everything fixed to it. Does nothing if the result would not be a valid solid.
    pub(crate) fn change_length(&mut self, limb: usize, factor: f64) {
        self.reshape(limb, factor, [1.0; 4], |position| position * Vec3::new(1.0, 1.0, factor));
    }

    /// Multiplies the length and the semi-axes (a0, b0, a1, b1) of a limb by factors, and replaces the positions of everything fixed
    /// to it. Does nothing and returns false if the result would not be a valid solid.
    pub(super) fn reshape(&mut self, limb: usize, length: f64, axes: [f64; 4], map: impl Fn(Vec3) -> Vec3) -> bool {
        let Ok(shape) = self.limbs[limb].shape.stretched(length, axes) else { return false };
        self.limbs[limb].shape = shape;
        self.map_landmarks(limb, map);
        true
    }

    /// The body with a further limb joined to `parent`. No points match the new limb's proximal cap, which faces the joint.
    pub fn with_limb(
        &self,
        name: &str,
        parent: &str,
        shape: TaperedEllipticCylinder,
        joint: Joint,
        sites: Vec<(String, Vec3)>,
    ) -> Result<Self, BodyError> {
        let parent = self.limb_index(parent)?;
        let Self { mut limbs, sites: mut all_sites, .. } = self.clone();
        let limb = limbs.len();
        limbs.push(Limb { name: name.into(), shape, parent: Some((parent, joint)), match_caps: [false, true] });
        all_sites.extend(sites.into_iter().map(|(name, position)| Site { name, limb, position }));
        Self::new(self.name.clone(), limbs, all_sites)
    }

    /// The body without a limb, its sites and its descendants, and the indices of the remaining limbs.
    pub fn without_limb(&self, name: &str) -> Result<(Self, Vec<usize>), BodyError> {
        let removed = self.limb_index(name)?;
        Unexpected::unless(removed > 0, "limb", "a limb other than the root", name)?;
        let stays =
            |limb: &usize| !std::iter::successors(Some(*limb), |limb| self.parent(*limb)).any(|up| up == removed);
        let kept: Vec<usize> = (0..self.limbs.len()).filter(stays).collect();
        let new_index = |limb: usize| kept.binary_search(&limb).ok();
        let limb = |index: &usize| {
            let limb = self.limbs[*index].clone();
            Limb { parent: limb.parent.and_then(|(parent, joint)| Some((new_index(parent)?, joint))), ..limb }
        };
        let site = |site: &Site| Some(Site { limb: new_index(site.limb)?, ..site.clone() });
        let (limbs, sites) = (kept.iter().map(limb).collect(), self.sites.iter().filter_map(site).collect());
        Ok((Self::new(self.name.clone(), limbs, sites)?, kept))
    }

    /// Replaces the positions of everything fixed to a limb: its sites and the ellipses of its joints.
    pub(super) fn map_landmarks(&mut self, limb: usize, map: impl Fn(Vec3) -> Vec3) {
        for site in self.sites.iter_mut().filter(|site| site.limb == limb) {
            site.position = map(site.position);
        }
        for (index, other) in self.limbs.iter_mut().enumerate() {
            if let Some((parent, joint)) = &mut other.parent {
                let ellipse = match (*parent == limb, index == limb) {
                    (true, _) => &mut joint.parent_from_joint,
                    (_, true) => &mut joint.limb_from_joint,
                    _ => continue,
                };
                ellipse.translation = map(ellipse.translation);
            }
        }
    }
}
