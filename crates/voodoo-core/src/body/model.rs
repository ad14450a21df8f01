//! The tracked model: the body with its current sizes, the reference body, and its arms and legs.

use super::Body;
use super::two_bone::TwoBone;
use crate::error::{BodyError, TrackError};
use crate::math::{Pose, Vec3};

/// The tracked body. It changes when sizes are fitted and when limbs are edited, but not with the pose.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    /// The body with its current sizes.
    pub body: Body,
    /// The body with the sizes that the user gave: every start is fitted from these.
    pub reference_body: Body,
    /// Arms and legs, with the lengths they had at the last start or edit.
    pub extremities: Vec<TwoBone>,
}

impl Model {
    /// The model of `body`.
    pub(crate) fn new(body: Body) -> Self {
        Self { reference_body: body.clone(), extremities: TwoBone::from_body(&body), body }
    }

    /// Replaces the body by one with other sizes or other limbs.
    pub(crate) fn adopt(&mut self, body: Body) {
        self.extremities = TwoBone::from_body(&body);
        self.body = body;
    }

    /// Fits sizes and world poses so that sites (index, world position) lie at the given positions; see [`Body::fit`].
    pub(crate) fn fit(&self, positions: &[(usize, Vec3)], fit_sizes: bool) -> Result<(Body, Vec<Pose>), TrackError> {
        let start = if fit_sizes { &self.reference_body } else { &self.body };
        start.fit(positions, fit_sizes)
    }

    /// Applies the same change to the current and the reference body; on error neither changes.
    pub(crate) fn edit(&mut self, change: impl Fn(&Body) -> Result<Body, BodyError>) -> Result<(), BodyError> {
        let (body, reference_body) = (change(&self.body)?, change(&self.reference_body)?);
        self.reference_body = reference_body;
        self.adopt(body);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::HumanModel;

    fn human() -> Model {
        Model::new(Body::human(1.75, HumanModel::Full).unwrap())
    }

    #[test]
    fn an_edit_that_is_refused_changes_nothing() {
        let mut model = human();
        let before = model.clone();
        assert!(model.edit(|body| body.scaled(f64::NAN)).is_err());
        assert!(model.edit(|body| body.without_limb("tail").map(|(body, _)| body)).is_err());
        assert_eq!((model.body, model.reference_body), (before.body, before.reference_body));
    }

    #[test]
    fn a_removed_arm_is_no_extremity_any_more() {
        let mut model = human();
        let arms = model.extremities.len();
        let name = model.body.limbs()[model.extremities[0].upper].name.clone();
        model.edit(|body| body.without_limb(&name).map(|(body, _)| body)).unwrap();
        assert_eq!(model.extremities.len(), arms - 1);
        assert_eq!(model.reference_body, model.body);
    }

    #[test]
    fn a_start_is_fitted_from_the_given_sizes_not_from_those_of_the_start_before() {
        let mut model = human();
        let poses = model.body.rest_pose(Pose::IDENTITY);
        let sites: Vec<(usize, Vec3)> =
            (0..model.body.sites().len()).map(|site| (site, model.body.site_position(&poses, site))).collect();
        let (first, _) = model.fit(&sites, true).unwrap();
        let larger: Vec<(usize, Vec3)> = sites.iter().map(|(site, place)| (*site, *place * 1.2)).collect();
        let (large, _) = model.fit(&larger, true).unwrap();
        model.adopt(large);
        let (again, _) = model.fit(&sites, true).unwrap();
        assert_eq!(first, again);
        assert!(model.fit(&[(10_000, Vec3::ZERO)], true).is_err());
    }
}
