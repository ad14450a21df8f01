//! Whether something else stands before a tracked body: what hides it is somebody else, and not where it went.

use super::detection_check::NEW_TRACK_AGE;
use crate::hypotheses::PATIENCE;
use crate::math::Vec3;
use crate::observation::depth_view::{DepthViews, Pixel};
use crate::observation::frame::Frame;
use crate::visibility::LITTLE;

/// What is so much nearer to a camera than a joint hides it, and than a body stands before it, meters: more than half of a body is
/// thick.
const IN_FRONT: f64 = 0.25;

/// A body that is hidden, or was a moment ago.
#[derive(Debug, Default)]
pub(super) struct Occlusion {
    /// Frames in which it was seen where it was thought to be.
    visible_frames: usize,
    /// When it was hidden the last time, seconds, and where it stood before or was tracked since, world frame.
    last: Option<(f64, Vec3)>,
    /// Where it is thought to be now: hidden, it may go on.
    now: Vec3,
}

impl Occlusion {
    /// Notes what a frame shows where a body's joints are, the root's first, world frame; whether it is `tracked`, or at least seen.
    /// Furniture hides it, too, but nobody would take that for the body.
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
        // Its own arms hide little of it.
        if f64::from(occluded) >= LITTLE * f64::from(all) {
            let place = self.last.map_or(root, |(_, place)| place);
            // Only what was seen can be hidden: a start that was given wrongly may lie behind the body.
            self.last = (self.visible_frames >= PATIENCE).then_some((stamp, place));
            return;
        }
        self.visible_frames += usize::from(visible);
        let last = self.last.filter(|(last, _)| stamp - last < NEW_TRACK_AGE);
        self.last = last.map(|(last, place)| (last, if tracked { root } else { place }));
    }

    /// Whether what is seen at a place of the world stands before the hidden body, or before where that went.
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
    fn what_stands_before_a_body_that_was_tracked_hides_it_and_for_a_while_after_that() {
        let (model, poses) = standing();
        let root = poses[0].translation;
        let open = before_wall(&model.body, &poses);
        let mut covered = open.clone();
        put_board(&mut covered, root - 0.8 * Vec3::Z, [0.3, 0.9]);
        let mut occlusion = Occlusion::default();
        let (nothing, mut scene) = (Backgrounds::default(), Backgrounds::default());
        // At which places somebody hides the body after a frame: beside it, behind it, before it.
        let mut after = |pixels: &[u16], stamp: f64, tracked: bool| {
            with_frame(pixels, stamp, |frame| {
                occlusion.observe(views(frame, &nothing), poses.iter().map(|pose| pose.translation), tracked, tracked);
                [0.6 * Vec3::X, 0.6 * Vec3::Z, -0.6 * Vec3::Z].map(|off| occlusion.is_occluder(frame, root + off))
            })
        };
        assert_eq!(after(&covered, -2.0, false), [false; 3], "it was never seen");
        for frame in 0..PATIENCE {
            assert_eq!(after(&open, 0.1 * frame as f64 - 1.0, true), [false; 3], "nothing stands before it");
        }
        assert_eq!(after(&covered, 0.2, true), [false, false, true]);
        for tracked in [false, true] {
            assert_eq!(
                after(&open, if tracked { 0.4 } else { 0.3 }, tracked),
                [false, false, true],
                "it may come back"
            );
        }
        assert_eq!(after(&open, 0.3 + NEW_TRACK_AGE, true), [false; 3], "long ago");
        // Where it goes on to while it is hidden counts as well, and furniture does not.
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
        // Its own depth hides no body.
        let near = before_wall(&model.body, &moved(&poses, -0.15 * Vec3::Z));
        assert_eq!(after(&near, 3.0, true), [false; 3]);
    }
}
