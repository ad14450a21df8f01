//! Detects occlusion of a tracked body: what hides the body is another person, not the body at a new position.

use super::PATIENCE;
use super::detection_check::NEW_TRACK_AGE;
use crate::math::Vec3;
use crate::observation::depth_view::{DepthViews, Pixel};
use crate::observation::frame::Frame;
use crate::visibility::LITTLE;

/// An object nearer to a camera than a joint by this occludes the joint, and one nearer than a body by this is in front of it,
/// meters. The value exceeds half the thickness of a body.
const IN_FRONT: f64 = 0.25;

/// Occlusion state of a body that is hidden or was recently.
#[derive(Debug, Default)]
pub(super) struct Occlusion {
    /// Number of frames in which the body was observed in its pose.
    visible_frames: usize,
    /// Stamp of the last occlusion, seconds, and the position of the body before it, or tracked since then; world frame.
    last: Option<(f64, Vec3)>,
    /// Current position of the track; a hidden body may keep moving.
    now: Vec3,
}

impl Occlusion {
    /// Updates with a frame and the positions of a body's joints, the root's first, world frame. `tracked` is whether the body is
    /// tracked, and `visible` whether it is at least not lost. Furniture in the background may also hide the body, but is ignored
    /// because it is never taken for the body.
    pub(super) fn observe(
        &mut self,
        views: DepthViews,
        joints: impl Iterator<Item = Vec3>,
        tracked: bool,
        visible: bool,
    ) {
        let (mut occluded, mut all, mut root) = (0, 0, None);
        for joint in joints {
            occluded += i32::from(views.iter().any(|view| {
                let place = view.working_from_camera.inverse_transform_point(joint - views.origin);
                matches!(view.at(place), Pixel::Foreground(z) if z < place.z - IN_FRONT)
            }));
            all += 1;
            root = root.or(Some(joint));
        }
        let stamp = views.frame.stamp;
        let Some(root) = root else { return };
        self.now = root;
        // The body's own arms occlude only few of its joints.
        if f64::from(occluded) >= LITTLE * f64::from(all) {
            let place = self.last.map_or(root, |(_, place)| place);
            // Only a body that was observed can be occluded: a wrong start may lie behind the body.
            self.last = (self.visible_frames >= PATIENCE).then_some((stamp, place));
            return;
        }
        self.visible_frames += usize::from(visible);
        let last = self.last.filter(|(last, _)| stamp - last < NEW_TRACK_AGE);
        self.last = last.map(|(last, place)| (last, if tracked { root } else { place }));
    }

    /// Whether an object at a world position is in front of the hidden body, at its last observed or its current position.
    pub(super) fn is_occluder(&self, frame: &Frame, place: Vec3) -> bool {
        let Some((_, own)) = self.last else { return false };
        frame.images.iter().any(|image| {
            let depth = |place: Vec3| (image.world_from_sensor.inverse() * place).z;
            depth(place) < depth(own).max(depth(self.now)) - IN_FRONT
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::background::Backgrounds;
    use crate::testing::{before_wall, moved, put_board, standing, with_frame};

    fn views<'a>(frame: &'a Frame<'a>, backgrounds: &'a Backgrounds) -> DepthViews<'a> {
        DepthViews { frame, backgrounds, segmented: &[false], origin: Vec3::ZERO }
    }

    #[test]
    fn an_object_in_front_of_a_tracked_body_is_an_occluder_then_and_for_a_while_afterwards() {
        let (model, poses) = standing();
        let root = poses[0].translation;
        let open = before_wall(&model.body, &poses);
        let mut covered = open.clone();
        put_board(&mut covered, root - 0.8 * Vec3::Z, [0.3, 0.9]);
        let mut occlusion = Occlusion::default();
        let (nothing, mut scene) = (Backgrounds::default(), Backgrounds::default());
        // Which objects count as occluders after a frame: beside, behind and in front of the body.
        let mut after = |pixels: &[u16], stamp: f64, tracked: bool| {
            with_frame(pixels, stamp, |frame| {
                occlusion.observe(views(frame, &nothing), poses.iter().map(|pose| pose.translation), tracked, tracked);
                [0.6 * Vec3::X, 0.6 * Vec3::Z, -0.6 * Vec3::Z].map(|off| occlusion.is_occluder(frame, root + off))
            })
        };
        assert_eq!(after(&covered, -2.0, false), [false; 3], "the body was never observed");
        for frame in 0..PATIENCE {
            assert_eq!(after(&open, 0.1 * frame as f64 - 1.0, true), [false; 3], "nothing occludes the body");
        }
        assert_eq!(after(&covered, 0.2, true), [false, false, true]);
        for tracked in [false, true] {
            assert_eq!(
                after(&open, if tracked { 0.4 } else { 0.3 }, tracked),
                [false, false, true],
                "occluded recently"
            );
        }
        assert_eq!(after(&open, 0.3 + NEW_TRACK_AGE, true), [false; 3], "no longer occluded recently");
        // The position that the body moves to while it is hidden counts as well; furniture does not.
        let beyond = moved(&poses, 0.3 * Vec3::Z);
        with_frame(&covered, 2.6, |frame| {
            scene.start(frame, |_, _| {});
            for (backgrounds, poses, by) in
                [(&nothing, &poses, false), (&nothing, &beyond, true), (&scene, &beyond, false)]
            {
                let mut occlusion = Occlusion { visible_frames: PATIENCE, ..Occlusion::default() };
                occlusion.observe(views(frame, backgrounds), poses.iter().map(|pose| pose.translation), true, true);
                assert_eq!(occlusion.is_occluder(frame, root - 0.2 * Vec3::Z), by);
            }
        });
        // A body does not occlude itself by its own thickness.
        let near = before_wall(&model.body, &moved(&poses, -0.15 * Vec3::Z));
        assert_eq!(after(&near, 3.0, true), [false; 3]);
    }
}
