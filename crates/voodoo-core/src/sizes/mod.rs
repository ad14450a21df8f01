//! Sizes of the body: fitted to the first frame after a reset and refined by later frames.

mod color_girth;
pub(crate) mod girth;
mod reported;

use crate::association::contour::edges;
use crate::body::{Body, MOST_STRETCH, Model, Pair};
use crate::config::Config;
use crate::detect::JointMap;
use crate::fit::{CONTOUR_FROM, Fit, Setting};
use crate::math::{Pose, Vec3};
use crate::solver::Gate;
use color_girth::ColorGirths;
use girth::{
    ALIKE, ASIDE_SIGMA, FOUND_SHARE, GIRTH_STEPS, Girth, GirthPrior, first_system, follow_girth, side_system,
    start_girth,
};
pub(crate) use reported::LengthEstimate;
use reported::ReportedLengths;

/// Points farther than this from the given pose are not used for the sizes, meters.
const START_GATE: Gate = Gate::within(0.10);
/// Relative standard deviation of a limb's length that no detection reported.
pub(crate) const LENGTH_SIGMA: f64 = 0.1;

/// How a pose was set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start {
    /// The pose is exact and the sizes are known.
    SizesKnown,
    /// The pose is exact; the first frame fits the sizes at this pose.
    Positions,
    /// The pose comes from a detector; it is fitted before the sizes are.
    Detected,
}

/// Estimates of the sizes.
#[derive(Debug, Default)]
pub(crate) struct Sizes {
    /// Whether the next frame fits the sizes.
    pub open: bool,
    /// Whether the pose was not set exactly, so that it is fitted before the girths are, and the sizes were found with it.
    pub rough: bool,
    /// The body as it was set, before frames changed its sizes; `None` where these are known, so that no frame changes them.
    pub set: Option<Body>,
    /// Girth estimates; empty when the girths were given.
    girths: Vec<Girth>,
    /// Girth estimates from color edges.
    color_girths: ColorGirths,
    /// Groups of limbs with a common length that is refined; empty where the lengths are known.
    pub pairs: Vec<Pair>,
    /// The factor by which each group was lengthened since the sizes were set, and buffers for the next change and its prior.
    stretched: Vec<f64>,
    change: Vec<f64>,
    pull: Vec<f64>,
    /// Lengths reported by detections of an auto-initialized body: its lengths are pulled towards the mean of all reports.
    pub reported: ReportedLengths,
}

impl Sizes {
    /// Restarts after a pose was set. Unless the sizes are known, the next frame fits them and later frames refine the lengths.
    pub(crate) fn restart(&mut self, model: &Model, start: Start, config: &Config) {
        *self = Self::default();
        if start == Start::SizesKnown {
            return;
        }
        (self.open, self.rough, self.set) = (true, start == Start::Detected, Some(model.body.clone()));
        if config.fit_girths {
            self.girths = vec![Girth::default(); model.body.limbs().len()];
        }
        if config.fit_lengths && config.solver.is_whole_body() {
            self.follow_lengths(model);
        }
    }

    /// Standard deviation of the mean radius of a limb, meters; NaN where it was given.
    pub(crate) fn girth_sigma(&self, body: &Body, limb: usize) -> f64 {
        let known = self.girths.get(limb).zip(GirthPrior::of(body, limb, &self.girths));
        known.map_or(f64::NAN, |(girth, prior)| girth.sigma(&body.limbs()[limb].shape, &prior))
    }

    /// Tells `fit` how well the limbs' radii are known. Where the joints were given, the first frame measured how far from them the
    /// surface is.
    pub(crate) fn set_radius_sigmas(&self, body: &Body, fit: &mut Fit) {
        let sigma = |limb| if self.rough { self.girth_sigma(body, limb) } else { f64::NAN };
        fit.set_radius_sigmas((0..body.limbs().len()).map(sigma));
    }

    /// Takes over limbs that the user changed: their girths count as given, and the lengths are refined from the new ones.
    pub(crate) fn edited(&mut self, model: &Model) {
        let open = if self.open && !self.girths.is_empty() { model.body.limbs().len() } else { 0 };
        self.girths = vec![Girth::default(); open];
        self.color_girths = ColorGirths::default();
        self.set = self.set.is_some().then(|| model.body.clone());
        if !self.pairs.is_empty() {
            self.follow_lengths(model);
        }
    }

    /// Starts to refine the limbs' lengths from those they have.
    fn follow_lengths(&mut self, model: &Model) {
        self.pairs = model.body.pairs();
        self.stretched = vec![1.0; self.pairs.len()];
    }

    /// Fits the sizes to the first frame after a reset, whose pose is known.
    pub(crate) fn initialize(&mut self, setting: Setting, model: &mut Model, poses: &mut [Pose], fit: &mut Fit) {
        if !std::mem::take(&mut self.open) || !setting.config.fit_girths {
            return;
        }
        let mut edges_found = Vec::new();
        let share = if self.rough { FOUND_SHARE } else { 1.0 };
        for _ in 0..GIRTH_STEPS {
            // The pose is known, so the closest limb is the one that was observed.
            fit.match_points(setting.with_model(model), poses, &START_GATE);
            for limb in 0..poses.len() {
                let shape = model.body.limbs()[limb].shape;
                edges_found.clear();
                for view in setting.observation.views.iter() {
                    edges(&view, &model.body.limbs()[limb], &poses[limb], |edge| {
                        // Outside the rim, the edge may belong to another limb.
                        if edge.reach <= edge.rim || model.body.closest_limb(poses, edge.place) == limb {
                            edges_found.push(edge);
                        }
                    });
                }
                if let Some(tip) = edges_found.iter().find(|edge| edge.side == Vec3::Z) {
                    let longer = 1.0 + (tip.reach - tip.rim) / shape.length();
                    model.body.change_tip(limb, longer);
                }
                let matches = &fit.correspondences.limbs[limb];
                let sigma = setting.config.depth_contour_sigma;
                if let Some(system) = first_system(&shape, matches, &poses[limb], &edges_found, sigma) {
                    start_girth(&mut self.girths, limb, &system, share, &mut model.body, &mut poses[limb]);
                }
            }
        }
        if self.rough {
            self.girths.iter_mut().for_each(Girth::discount);
        }
        self.set_radius_sigmas(&model.body, fit);
        self.color_girths.start(setting, model, poses, fit);
    }

    /// Finds the depth contour of a frame in which the body was fitted at `poses`, from which sizes are estimated, and refines the
    /// lengths unless the body is `lost`, with a prior from the reported lengths: those of a seated start are rough. The joints
    /// stay closed.
    pub(crate) fn refine_lengths(
        &mut self,
        setting: Setting,
        model: &mut Model,
        poses: &mut [Pose],
        predicted: &[Pose],
        fit: &mut Fit,
        map: &JointMap,
        lost: bool,
    ) {
        if !(self.pairs.is_empty() && self.girths.is_empty()) && setting.config.max_steps >= CONTOUR_FROM {
            fit.match_contour(setting.with_model(model), poses);
        }
        if self.pairs.is_empty() || lost {
            return;
        }
        let Self { pairs, stretched, change, pull, reported, .. } = self;
        change.clear();
        pull.clear();
        for (pair, stretched) in pairs.iter().zip(stretched.iter()) {
            let (factor, sigma) = reported.factor(map, pair[0]).unwrap_or((1.0, LENGTH_SIGMA));
            change.push(factor - stretched);
            // Errors of points are correlated over frames, so a frame has a fraction of its information: the prior has more instead.
            pull.push(ALIKE / (sigma * sigma));
        }
        if !fit.lengths(setting.with_model(model), predicted, poses, pairs, pull, change) {
            return;
        }
        for ((pair, total), change) in pairs.iter().zip(stretched).zip(change.iter()) {
            let factor = (*total + change).clamp(1.0 / MOST_STRETCH, MOST_STRETCH) / *total;
            *total *= factor;
            pair.iter().for_each(|limb| model.body.change_length(*limb, factor));
        }
        model.body.close_joints(poses);
    }

    /// Updates the girths with color edges, and those of limbs whose pose was known in the frame before with the depth-contour
    /// edges on their sides.
    pub(crate) fn refine_girths(
        &mut self,
        setting: Setting,
        model: &mut Model,
        poses: &[Pose],
        fit: &mut Fit,
        relied_on: impl Fn(usize) -> bool,
    ) {
        self.color_girths.follow(setting, model, poses, fit);
        for limb in (0..self.girths.len()).filter(|limb| relied_on(*limb)) {
            let shape = &model.body.limbs()[limb].shape;
            let (system, thickness) = side_system(shape, fit.contours.sides(limb), setting.config.depth_contour_sigma);
            follow_girth(&mut self.girths, limb, &system, (ASIDE_SIGMA, 1.0), thickness, &mut model.body);
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;
    use crate::shape::TaperedEllipticCylinder;
    use crate::testing::{before_wall, stand, standing, with_setting};

    /// A body some of whose limbs have other lengths and girths.
    fn changed(body: &Body, limbs: &[&str], length: f64, girth: f64) -> Body {
        limbs.iter().fold(body.clone(), |body, name| {
            let s = body.limbs()[body.limb_index(name).unwrap()].shape;
            let [a0, b0, a1, b1] = [s.a0(), s.b0(), s.a1(), s.b1()].map(|axis| girth * axis);
            let shape = TaperedEllipticCylinder::new(length * s.length(), a0, b0, a1, b1).unwrap();
            body.with_shape(name, shape).unwrap()
        })
    }

    /// Returns the body after a first frame that shows `person`. It was set as `set`, with the feet at the person's feet.
    fn first_frame(person: &Body, set: &Body, config: &Config) -> Body {
        let pixels = before_wall(person, &stand(person));
        let (mut model, mut poses) = (Model::new(set.clone()), stand(set));
        let (before, start) = (model.clone(), poses.clone());
        let (mut sizes, mut fit) = (Sizes::default(), Fit::new(config).unwrap());
        sizes.restart(&model, Start::Positions, config);
        with_setting(&pixels, config, &before, &start, |setting| {
            sizes.initialize(setting, &mut model, &mut poses, &mut fit);
            // The next frame is not the first.
            let fitted = (model.body.clone(), poses.clone());
            sizes.initialize(setting, &mut model, &mut poses, &mut fit);
            assert_eq!((&model.body, &poses), (&fitted.0, &fitted.1));
        });
        model.body
    }

    fn girth(body: &Body, limb: &str) -> f64 {
        let s = body.limbs()[body.limb_index(limb).unwrap()].shape;
        s.a0() + s.b0() + s.a1() + s.b1()
    }

    fn length(body: &Body, limb: &str) -> f64 {
        body.limbs()[body.limb_index(limb).unwrap()].shape.length()
    }

    #[test]
    fn the_first_frame_fits_girths_to_a_thicker_person() {
        let body = standing().0.body;
        let limbs = ["l_thigh", "r_thigh", "l_calf", "r_calf"];
        let person = changed(&body, &limbs, 1.0, 1.2);
        let found = first_frame(&person, &body, &Config::default());
        for limb in body.limbs() {
            let ratio = girth(&found, &limb.name) / girth(&body, &limb.name);
            let thicker = ["l_thigh", "r_thigh", "l_calf", "r_calf"].contains(&limb.name.as_str());
            // The anthropometric prior limits the change: at least half of the difference must be found.
            assert!(
                if thicker { (1.08..1.22).contains(&ratio) } else { (0.95..1.08).contains(&ratio) },
                "{}: {ratio}",
                limb.name
            );
        }
        let same = first_frame(&person, &body, &Config { fit_girths: false, ..Config::default() });
        assert_eq!(same, body);
    }

    /// Returns the body after some frames of a person, starting from the sizes and the pose of `set`.
    fn followed(person: &Body, set: &Body, config: &Config, lost: bool, frames: usize) -> Body {
        let pixels = before_wall(person, &stand(person));
        let mut model = Model::new(set.clone());
        let mut poses = stand(set);
        let (mut sizes, mut fit) = (Sizes::default(), Fit::new(config).unwrap());
        sizes.restart(&model, Start::Positions, config);
        for _ in 0..frames {
            let (before, predicted) = (model.clone(), poses.clone());
            with_setting(&pixels, config, &before, &predicted, |setting| {
                fit.run(setting.with_model(&model), &predicted, &mut poses);
                let map = JointMap::default();
                sizes.refine_lengths(setting, &mut model, &mut poses, &predicted, &mut fit, &map, lost);
                sizes.refine_girths(setting, &mut model, &poses, &mut fit, |_| true);
            });
        }
        model.body
    }

    #[test]
    fn frames_draw_the_lengths_to_what_is_visible() {
        let body = standing().0.body;
        let names = ["l_thigh", "r_thigh", "l_calf", "r_calf"];
        for wrong in [0.92, 1.08] {
            let set = changed(&body, &names, wrong, 1.0);
            let found = followed(&body, &set, &Config::default(), false, 20);
            for name in names {
                let off = length(&found, name) / length(&body, name) - 1.0;
                assert!(off.abs() < 0.05, "{name} is off by {off} after {}", wrong - 1.0);
            }
            let lengths_alone = Config { fit_girths: false, ..Config::default() };
            assert_eq!(followed(&body, &set, &lengths_alone, true, 3), set, "a lost body teaches nothing");
        }
    }

    #[test]
    fn radii_are_uncertain_where_the_joints_were_found_with_the_pose() {
        let (model, poses) = standing();
        let (pixels, config) = (before_wall(&model.body, &poses), Config::default());
        let sigma = |start| {
            let (mut sizes, mut fit) = (Sizes::default(), Fit::new(&config).unwrap());
            sizes.restart(&model, start, &config);
            sizes.set_radius_sigmas(&model.body, &mut fit);
            with_setting(&pixels, &config, &model, &poses, |setting| {
                fit.match_last(setting.with_model(&model), &poses, true)
            });
            fit.correspondences.limbs[0].radius_variance.sqrt()
        };
        assert_eq!([Start::SizesKnown, Start::Positions].map(sigma), [0.0; 2]);
        let radius = 0.25 * model.body.limbs()[0].shape.ends().map(|end| end.a + end.b).iter().sum::<f64>();
        let share = sigma(Start::Detected) / radius;
        assert!((0.05..0.15).contains(&share), "{share} of the radius");
    }

    #[test]
    fn girths_follow_the_contour_of_limbs_that_are_relied_on() {
        let body = standing().0.body;
        let names = ["l_thigh", "r_thigh", "l_calf", "r_calf"];
        let (person, config) = (changed(&body, &names, 1.0, 1.2), Config { fit_lengths: false, ..Config::default() });
        let pixels = before_wall(&person, &stand(&person));
        let (mut model, mut poses) = (Model::new(body.clone()), stand(&body));
        let (mut sizes, mut fit) = (Sizes::default(), Fit::new(&config).unwrap());
        // Start as if a first frame had fitted the girths.
        sizes.restart(&model, Start::Positions, &config);
        (sizes.open, sizes.girths) = (false, vec![Girth::default(); poses.len()]);
        let left = |limb: usize| body.limbs()[limb].name.starts_with("l_");
        for _ in 0..20 {
            let (before, predicted) = (model.clone(), poses.clone());
            with_setting(&pixels, &config, &before, &predicted, |setting| {
                fit.run(setting.with_model(&model), &predicted, &mut poses);
                let map = JointMap::default();
                sizes.refine_lengths(setting, &mut model, &mut poses, &predicted, &mut fit, &map, false);
                sizes.refine_girths(setting, &mut model, &poses, &mut fit, left);
            });
        }
        for (index, limb) in body.limbs().iter().enumerate() {
            let ratio = girth(&model.body, &limb.name) / girth(&body, &limb.name);
            assert!(left(index) || ratio == 1.0, "{} is not relied on: {ratio}", limb.name);
            let thicker = names[..3].contains(&limb.name.as_str()) && left(index);
            assert!(!thicker || (1.05..1.22).contains(&ratio), "{}: {ratio}", limb.name);
        }
    }
}
