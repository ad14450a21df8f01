//! Scores how well a pose explains a frame, to compare hypotheses. The unit is one surface patch (weight one).
//!
//! Points that no limb explains have a cost, and so does visible model surface that violates free space. Either term alone is
//! insufficient: a limb hidden inside the torso violates nothing, and a limb in empty space leaves few points unexplained.

use crate::body::Limb;
use crate::math::{Pose, Vec3};
use crate::observation::candidates::REFERENCE_PATCH;
use crate::observation::depth_view::{DepthView, DepthViews};
use crate::visibility::surface::{PatchVisibility, SurfacePlace, surface_rows};
use crate::visibility::{ALONG_LIMB, LIMB_RIM};

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

impl Patches {
    /// Adds those in another image.
    pub(crate) fn add(&mut self, other: Self) {
        self.free_space += other.free_space;
        self.occluded += other.occluded;
        self.front_facing += other.front_facing;
    }
}

/// Returns the patches of a limb's surface that are visible to the cameras, occluded, and in free space.
pub(crate) fn limb_visibility(views: DepthViews, limb: &Limb, working_from_limb: &Pose) -> Patches {
    let mut found = Patches::default();
    views.iter().for_each(|view| found.add(limb_visibility_in(&view, limb, working_from_limb, |_| false, |_| ())));
    found
}

/// Like [`limb_visibility`], in one image. Patches that another limb hides, at points (camera frame) for which `hidden` is true,
/// are occluded as well. `each` gets the points of every section: at one rim, in the middle, and at the other rim.
pub(crate) fn limb_visibility_in(
    view: &DepthView,
    limb: &Limb,
    working_from_limb: &Pose,
    hidden: impl Fn(Vec3) -> bool,
    mut each: impl FnMut([SurfacePlace; 3]),
) -> Patches {
    let (shape, across) = (&limb.shape, [-LIMB_RIM, 0.0, LIMB_RIM]);
    let mut found = Patches::default();
    let camera_from_limb = view.working_from_camera.inverse() * *working_from_limb;
    for (_, facing, points) in surface_rows(shape, &camera_from_limb, across) {
        let section = facing.section;
        let (a, b) = (section.a, section.b);
        // A limb viewed obliquely covers less of the image, and yields fewer points by the same factor.
        let aslant = facing.across.length() / (camera_from_limb * section.center()).length();
        let patches = aslant * 2.0 * a.min(b).max(0.5 * a.max(b)) * shape.length()
            / (REFERENCE_PATCH * (ALONG_LIMB.len() * across.len()) as f64);
        let places = points.map(|point| SurfacePlace::observed(view, point));
        each(places);
        for place in places {
            match place.sight() {
                PatchVisibility::Unknown => continue,
                PatchVisibility::FreeSpace => found.free_space += patches,
                PatchVisibility::Occluded => found.occluded += patches,
                PatchVisibility::Consistent if hidden(place.point) => found.occluded += patches,
                PatchVisibility::Consistent => {}
            }
            found.front_facing += patches;
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, HumanModel};
    use crate::math::Quat;
    use crate::observation::background::Backgrounds;
    use crate::observation::frame::{DepthImage, DepthPixels, Frame};
    use crate::testing::{pinhole, views};
    use crate::visibility::render::{Rendering, Viewpoint};

    const WIDTH: usize = 160;
    const HEIGHT: usize = 120;
    const INTRINSICS: [f64; 4] = [140.0, 140.0, 79.5, 59.5];

    /// What a camera at the origin sees of a body, and `behind` where it sees none of it, millimeters.
    fn shoot(body: &Body, poses: &[Pose], behind: u16) -> Vec<u16> {
        let world_from_sensor = Pose::IDENTITY;
        let view = Viewpoint { camera: pinhole(WIDTH, HEIGHT, INTRINSICS), world_from_sensor };
        let mut image = Rendering::default();
        image.render(body, poses, &view).unwrap();
        let millimeters = |depth: &f32| if *depth > 0.0 { (depth * 1000.0).round() as u16 } else { behind };
        image.depth().iter().map(millimeters).collect()
    }

    /// What is seen of every limb together.
    fn visible(pixels: &[u16], body: &Body, poses: &[Pose]) -> Patches {
        let images = [DepthImage {
            pixels: DepthPixels::U16(pixels),
            camera: pinhole(WIDTH, HEIGHT, INTRINSICS),
            meters_per_unit: 0.001,
            world_from_sensor: Pose::IDENTITY,
            weight: 1.0,
            source: 0,
        }];
        let frame = Frame { images: &images, ..Frame::empty(0.0) };
        let backgrounds = Backgrounds::default();
        let views = views(&frame, &backgrounds);
        let mut all = Patches::default();
        body.limbs().iter().zip(poses).for_each(|(limb, pose)| all.add(limb_visibility(views, limb, pose)));
        all
    }

    /// A person who faces the camera, 2.5 m before it, arms hanging.
    fn standing(body: &Body) -> Vec<Pose> {
        let upright = Quat::from_axis_angle(Vec3::X, std::f64::consts::FRAC_PI_2);
        body.rest_pose(Pose::from_parts(Vec3::new(0.0, 0.0, 2.5), upright))
    }

    #[test]
    fn a_body_where_it_is_visible_violates_little_free_space_and_elsewhere_much() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = standing(&body);
        let pixels = shoot(&body, &poses, 4000);
        let right = visible(&pixels, &body, &poses);
        assert!(right.front_facing > 500.0 && right.free_space < 0.05 * right.front_facing, "{right:?}");
        // The farther the lateral offset, the more of the body is where the camera observes the wall.
        let mut last = right.free_space;
        for shift in [0.1, 0.2, 0.4] {
            let aside: Vec<Pose> =
                poses.iter().map(|pose| Pose::from_parts(pose.translation + shift * Vec3::X, pose.rotation)).collect();
            let past = visible(&pixels, &body, &aside).free_space;
            assert!(past > last + 50.0, "{past} at {shift} m after {last}");
            last = past;
        }
    }

    #[test]
    fn a_body_behind_a_wall_is_hidden_and_before_it_contradicted() {
        let body = Body::human(1.75, HumanModel::Full).unwrap();
        let poses = standing(&body);
        let wall = |millimeters: u16| visible(&vec![millimeters; WIDTH * HEIGHT], &body, &poses);
        let (before, behind, nothing) = (wall(1500), wall(4000), wall(0));
        assert!(before.front_facing > 0.0 && before.occluded == before.front_facing, "{before:?}");
        assert!(before.free_space == 0.0 && behind.occluded == 0.0);
        assert_eq!(behind.free_space, behind.front_facing);
        assert_eq!(nothing, Patches::default(), "no return says nothing");
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
        let backgrounds = Backgrounds::default();
        let views = views(&frame, &backgrounds);
        let at = |angle: f64| {
            let turn = Quat::from_axis_angle(Vec3::Y, angle);
            let middle = turn * Vec3::new(0.0, 0.0, 0.5 * limb.shape.length());
            limb_visibility(views, limb, &Pose::from_parts(Vec3::new(0.0, 0.0, 2.5) - middle, turn))
        };
        let across = at(std::f64::consts::FRAC_PI_2);
        assert!(across.front_facing > 50.0 && across.free_space == across.front_facing, "{across:?}");
        for angle in [0.2_f64, 0.6, 1.0] {
            let ratio = at(angle).front_facing / across.front_facing;
            assert!((ratio - angle.sin()).abs() < 0.02, "{angle}: {ratio}");
        }
    }
}
