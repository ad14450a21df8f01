//! Scores how well a pose explains a frame, to compare hypotheses. The unit is one surface patch (weight one).
//!
//! Points that no limb explains have a cost, and so does visible model surface that violates free space. Either term alone is
//! insufficient: a limb hidden inside the torso violates nothing, and a limb in empty space leaves few points unexplained.

use crate::association::correspondence::Correspondences;
use crate::body::Limb;
use crate::math::Pose;
use crate::observation::candidates::REFERENCE_PATCH;
use crate::observation::depth_view::DepthViews;
use crate::visibility::surface::{PatchVisibility, surface_rows};
use crate::visibility::{ALONG_LIMB, LIMB_RIM};

/// Distance from the model's surface at which a point counts as unexplained, meters. The surface violates free space where the
/// background is this far behind it, or a possible body point twice as far.
pub(crate) const EXPLAINED: f64 = 0.04;
/// Cost of an occluded patch, in patches: less than one, since occlusion is possible.
const OCCLUDED_COST: f64 = 0.3;

/// Patches of a limb that face a camera inside its image.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Patches {
    /// Weight of patches that violate free space.
    pub free_space: f64,
    /// Weight of patches behind the observed surface.
    pub occluded: f64,
    /// Weight of all patches.
    pub front_facing: f64,
}

impl std::ops::AddAssign for Patches {
    fn add_assign(&mut self, other: Self) {
        self.free_space += other.free_space;
        self.occluded += other.occluded;
        self.front_facing += other.front_facing;
    }
}

/// Visibility of a limb, summed over cameras.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Visibility {
    /// Patches weighted by their area in the image.
    pub image: Patches,
    /// Patches weighted as if the limb were viewed from its side, so that pointing along the ray does not reduce the cost of
    /// occlusion.
    pub side: Patches,
}

impl std::ops::AddAssign for Visibility {
    fn add_assign(&mut self, other: Self) {
        self.image += other.image;
        self.side += other.side;
    }
}

impl Visibility {
    /// Returns the cost in unexplained patches: a free-space violation costs as much as an unexplained patch, an occluded patch
    /// less.
    pub(crate) fn cost(&self) -> f64 {
        self.image.free_space + OCCLUDED_COST * self.side.occluded
    }
}

/// Returns the patches of a limb's surface that are visible to the cameras, occluded, and in free space.
pub(crate) fn limb_visibility(views: DepthViews, limb: &Limb, working_from_limb: &Pose) -> Visibility {
    let (shape, across) = (&limb.shape, [-LIMB_RIM, 0.0, LIMB_RIM]);
    let mut found = Visibility::default();
    for view in views.iter() {
        let camera_from_limb = view.working_from_camera.inverse() * *working_from_limb;
        for row in surface_rows(shape, &camera_from_limb) {
            let section = row.facing.section;
            let (a, b) = (section.a, section.b);
            // A limb viewed obliquely covers less of the image, and yields fewer points by the same factor.
            let aslant = row.facing.across.length() / (camera_from_limb * section.center()).length();
            let whole = 2.0 * a.min(b).max(0.5 * a.max(b)) * shape.length()
                / (REFERENCE_PATCH * (ALONG_LIMB.len() * across.len()) as f64);
            for place in row.places(&view, across) {
                let sight = place.sight();
                if sight == PatchVisibility::Unknown {
                    continue;
                }
                for (counts, patches) in [(&mut found.image, whole * aslant), (&mut found.side, whole)] {
                    match sight {
                        PatchVisibility::FreeSpace => counts.free_space += patches,
                        PatchVisibility::Occluded => counts.occluded += patches,
                        PatchVisibility::Consistent | PatchVisibility::Unknown => {}
                    }
                    counts.front_facing += patches;
                }
            }
        }
    }
    found
}

/// Cost of the points that the pose leaves unexplained: `w min(d^2 / c^2, 1)` of every candidate.
pub(crate) fn unexplained(correspondences: &Correspondences, total_weight: f64) -> f64 {
    let mut cost = total_weight;
    for matches in &correspondences.limbs {
        for (weight, distance) in matches.weight.iter().zip(&matches.surface.signed_distance) {
            let ratio = f64::from(*distance) / EXPLAINED;
            cost -= f64::from(*weight) * (1.0 - ratio * ratio).max(0.0);
        }
    }
    cost
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::association::correspondence::LimbMatches;
    use crate::body::{Body, HumanModel};
    use crate::math::{Quat, Vec3};
    use crate::observation::background::Backgrounds;
    use crate::observation::frame::{DepthImage, DepthPixels, Frame};
    use crate::testing::pinhole;
    use crate::visibility::render::{Rendering, Viewpoint};

    const WIDTH: usize = 160;
    const HEIGHT: usize = 120;
    const INTRINSICS: [f64; 4] = [140.0, 140.0, 79.5, 59.5];

    /// What a camera at the origin sees of a body, and `behind` where it sees none of it, millimeters.
    fn shoot(body: &Body, poses: &[Pose], behind: u16) -> Vec<u16> {
        let world_from_sensor = Pose::IDENTITY;
        let view = Viewpoint { camera: pinhole(WIDTH, HEIGHT, INTRINSICS), world_from_sensor };
        let mut image = Rendering::default();
        image.render(body, poses, &view, None).unwrap();
        let millimeters = |depth: &f32| if *depth > 0.0 { (depth * 1000.0).round() as u16 } else { behind };
        image.depth().iter().map(millimeters).collect()
    }

    /// What is seen of every limb together.
    fn visible(pixels: &[u16], body: &Body, poses: &[Pose]) -> Visibility {
        let images = [DepthImage {
            pixels: DepthPixels::U16(pixels),
            camera: pinhole(WIDTH, HEIGHT, INTRINSICS),
            meters_per_unit: 0.001,
            world_from_sensor: Pose::IDENTITY,
            weight: 1.0,
            source: 0,
        }];
        let frame = Frame { images: &images, ..Frame::empty(0.0) };
        let views =
            DepthViews { frame: &frame, backgrounds: &Backgrounds::default(), segmented: &[false], origin: Vec3::ZERO };
        let mut all = Visibility::default();
        body.limbs().iter().zip(poses).for_each(|(limb, pose)| all += limb_visibility(views, limb, pose));
        all
    }

    /// A person who faces the camera, 2.5 m before it, arms hanging.
    fn standing(body: &Body) -> Vec<Pose> {
        let upright = Quat::from_axis_angle(Vec3::X, std::f64::consts::FRAC_PI_2);
        body.rest_pose(Pose::from_parts(Vec3::new(0.0, 0.0, 2.5), upright))
    }

    #[test]
    fn a_body_where_it_is_visible_costs_little_and_elsewhere_much() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = standing(&body);
        let pixels = shoot(&body, &poses, 4000);
        let right = visible(&pixels, &body, &poses);
        assert!(
            right.image.front_facing > 500.0 && right.image.free_space < 0.05 * right.image.front_facing,
            "{right:?}"
        );
        // The farther the lateral offset, the more of the body is where the camera observes the wall.
        let mut last = right.cost();
        for shift in [0.1, 0.2, 0.4] {
            let aside: Vec<Pose> =
                poses.iter().map(|pose| Pose::from_parts(pose.translation + shift * Vec3::X, pose.rotation)).collect();
            let cost = visible(&pixels, &body, &aside).cost();
            assert!(cost > last + 50.0, "{cost} at {shift} m after {last}");
            last = cost;
        }
    }

    #[test]
    fn a_body_behind_a_wall_is_hidden_and_before_it_contradicted() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = standing(&body);
        let wall = |millimeters: u16| visible(&vec![millimeters; WIDTH * HEIGHT], &body, &poses);
        let (before, behind, nothing) = (wall(1500), wall(4000), wall(0));
        assert!(before.image.front_facing > 0.0 && before.image.occluded == before.image.front_facing, "{before:?}");
        assert!(before.image.free_space == 0.0 && behind.image.occluded == 0.0);
        assert_eq!(behind.image.free_space, behind.image.front_facing);
        assert!(before.cost() < behind.cost(), "to be hidden is possible, to be seen through is not");
        assert_eq!(nothing, Visibility::default(), "no return says nothing");
    }

    #[test]
    fn points_cost_what_the_surface_leaves_of_them() {
        let mut all = Correspondences::default();
        let mut matches = LimbMatches { weight: vec![2.0, 0.0, 1.0, 3.0], ..LimbMatches::default() };
        matches.surface.signed_distance = vec![0.0, 0.0, -0.02, 0.5];
        all.limbs.push(matches);
        // Five points of weight one are matched to nothing at all: `w min(d^2 / c^2, 1)` one by one.
        let expected = 5.0 + 2.0 * 0.0 + 1.0 * (0.02_f64 / EXPLAINED).powi(2) + 3.0;
        assert!((unexplained(&all, 5.0 + 2.0 + 1.0 + 3.0) - expected).abs() < 1e-6);
    }

    #[test]
    fn a_limb_visible_aslant_shows_as_much_less_as_its_image_is_shorter() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let limb = &body.limbs()[body.limb_index("l_calf").unwrap()];
        let pixels = vec![4000_u16; 160 * 120];
        let images = [DepthImage {
            pixels: DepthPixels::U16(&pixels),
            camera: pinhole(WIDTH, HEIGHT, INTRINSICS),
            meters_per_unit: 0.001,
            world_from_sensor: Pose::IDENTITY,
            weight: 1.0,
            source: 0,
        }];
        let frame = Frame { images: &images, ..Frame::empty(0.0) };
        let views =
            DepthViews { frame: &frame, backgrounds: &Backgrounds::default(), segmented: &[false], origin: Vec3::ZERO };
        let at = |angle: f64| {
            let turn = Quat::from_axis_angle(Vec3::Y, angle);
            let middle = turn * Vec3::new(0.0, 0.0, 0.5 * limb.shape.length());
            limb_visibility(views, limb, &Pose::from_parts(Vec3::new(0.0, 0.0, 2.5) - middle, turn)).image
        };
        let across = at(std::f64::consts::FRAC_PI_2);
        assert!(across.front_facing > 50.0 && across.free_space == across.front_facing, "{across:?}");
        for angle in [0.2_f64, 0.6, 1.0] {
            let ratio = at(angle).front_facing / across.front_facing;
            assert!((ratio - angle.sin()).abs() < 0.02, "{angle}: {ratio}");
        }
    }
}
