//! Model of the static scene shared by all persons, learned in pixels that no person owns.

use crate::observation::background::{Background, Backgrounds, SCENE_STEP};
use crate::observation::frame::{DepthImage, Frame};
use crate::observation::ownership::NO_OWNER;

/// One row in this many is learned per frame, for speed; the scene is static.
const LEARNED_ROWS: usize = 8;
/// Weight of a new return in the learned depth.
const NEW_DEPTH: f32 = 0.1;
/// Number of consecutive observations after which a return becomes part of the scene, where no depth was known and where a deeper
/// one was. The second number is large so that a standing person who has not been detected yet is not learned.
const STILL_FRAMES: [u8; 2] = [4, 60];
/// Least fraction of the pixels that somebody new covers: far away, or at the border of the image.
const NEW_SHARE: f64 = 0.005;
/// Least width of somebody new, meters. The rim of a person whose body is somewhat thinner or lags behind is narrower.
const NEW_WIDTH: f64 = 0.1;
/// Time after which a camera's background has been searched for persons, seconds.
const OLD: f64 = 3.0;
/// Largest difference between equal depths, meters.
const SAME: f32 = 0.05;

/// The learned scene, and where it is learned next.
#[derive(Debug, Default)]
pub(super) struct SceneModel {
    /// The learned scene.
    pub(super) known: Backgrounds,
    /// Whether the last frame that was learned showed nobody new: nothing but persons and the known scene.
    pub(super) shows_nobody_new: bool,
}

impl SceneModel {
    /// Whether the camera of an image has been at its position for long enough that its view was searched for persons.
    pub(super) fn is_old(&self, image: &DepthImage, stamp: f64) -> bool {
        self.known.of_image(image).and_then(|known| known.since).is_some_and(|since| stamp - since > OLD)
    }

    /// Learns some rows in pixels that no person owns; the whole image in the second frame of a camera at its position.
    pub(super) fn learn(&mut self, frame: &Frame, owners: &[Vec<u16>]) {
        // Pixels that were learned, and those of them that show neither a person nor the known scene.
        let (mut learned, mut unexplained) = (0, 0);
        for (image, owners) in frame.images.iter().zip(owners) {
            let Some(background) = self.known.of_image_mut(image) else { continue };
            let Background { depth: known, pending, frames, since, filled, row, .. } = background;
            *row = (*row + 1) % LEARNED_ROWS;
            if since.is_none() {
                *since = Some(frame.stamp);
                continue;
            }
            let all = !std::mem::replace(filled, true);
            if all {
                for (index, owner) in owners.iter().enumerate() {
                    let z = image.depth(index).unwrap_or(0.0);
                    let learned = if *owner == NO_OWNER { &mut known[index] } else { &mut pending[index] };
                    *learned = z;
                }
            }
            for row in (*row..image.camera.height()).step_by(LEARNED_ROWS) {
                learned += image.camera.width();
                let (mut new, mut width) = (0, 0.0);
                for index in row * image.camera.width()..(row + 1) * image.camera.width() {
                    let depth = image.depth(index).filter(|_| owners[index] == NO_OWNER);
                    // Something new is clearly before the known scene, or where nothing was seen before.
                    let is_new = |z: &f32| {
                        known[index] == 0.0 && pending[index] == 0.0
                            || *z < known[index] - SCENE_STEP && !Background::contains(known[index], *z)
                    };
                    match depth.filter(is_new) {
                        Some(z) => (new, width) = (new + 1, width + f64::from(z) / image.camera.focal()[0]),
                        None => (new, width) = (0, 0.0),
                    }
                    if width >= NEW_WIDTH {
                        unexplained += std::mem::take(&mut new);
                    }
                    let Some(z) = depth else { continue };
                    learn_pixel(&mut known[index], &mut pending[index], &mut frames[index], z);
                }
            }
        }
        self.shows_nobody_new = (unexplained as f64) < NEW_SHARE * learned as f64;
    }

    /// Whether most of these pixels of an image show the learned scene.
    pub(super) fn is_still(&self, image: &DepthImage, pixels: &[usize]) -> bool {
        let known = self.known.depth(image);
        let still = |pixel: &&usize| {
            let known = known.get(**pixel).copied().unwrap_or(0.0);
            image.depth(**pixel).is_some_and(|z| Background::contains(known, z))
        };
        2 * pixels.iter().filter(still).count() > pixels.len()
    }
}

/// Learns a return: a deeper surface replaces the learned one, and returns of the same one are averaged.
fn learn_pixel(known: &mut f32, tentative: &mut f32, frames: &mut u8, z: f32) {
    if *known > 0.0 && z > *known - SCENE_STEP {
        *known = if z > *known + SCENE_STEP { z } else { *known + NEW_DEPTH * (z - *known) };
        *frames = 0;
        return;
    }
    if (z - *tentative).abs() > SAME {
        (*tentative, *frames) = (z, 0);
    }
    *frames = frames.saturating_add(1);
    if *frames >= STILL_FRAMES[usize::from(*known > 0.0)] {
        (*known, *frames) = (z, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::with_frame;

    const PIXELS: usize = 160 * 124;

    fn feed(scene: &mut SceneModel, millimeters: u16, frame: usize, check: impl FnOnce(&mut SceneModel, &Frame)) {
        feed_owned(scene, millimeters, NO_OWNER, frame, check);
    }

    fn feed_owned(
        scene: &mut SceneModel,
        millimeters: u16,
        owner: u16,
        frame: usize,
        check: impl FnOnce(&mut SceneModel, &Frame),
    ) {
        with_frame(&[millimeters; PIXELS], frame as f64 / 30.0, |frame| {
            scene.known.register(frame);
            check(scene, frame);
            scene.learn(frame, &[vec![owner; PIXELS]]);
        });
    }

    #[test]
    fn something_new_is_before_the_scene_and_noise_is_not() {
        let mut scene = SceneModel::default();
        (0..3).for_each(|frame| feed(&mut scene, 4000, frame, |_, _| ()));
        let mut new = |millimeters: u16, owner: u16| {
            feed_owned(&mut scene, millimeters, owner, 3, |_, _| ());
            !scene.shows_nobody_new
        };
        assert!(!new(3900, NO_OWNER) && !new(2000, 0) && new(2000, NO_OWNER));
    }

    #[test]
    fn what_a_person_reveals_is_not_new_and_what_comes_before_nothing_is() {
        for (covered, owner) in [(2000, 0), (0, NO_OWNER)] {
            let mut scene = SceneModel::default();
            (0..3).for_each(|frame| feed_owned(&mut scene, covered, owner, frame, |_, _| ()));
            feed(&mut scene, 4000, 3, |_, _| ());
            assert_eq!(scene.shows_nobody_new, owner != NO_OWNER);
        }
    }

    #[test]
    fn where_a_person_was_taken_for_the_scene_it_is_forgotten_and_behind_one_who_came_it_stays() {
        for (came, left) in [(5000, 0.0), (3000, 5.0)] {
            let mut scene = SceneModel::default();
            (0..3).for_each(|frame| feed(&mut scene, 5000, frame, |_, _| ()));
            feed(&mut scene, came, 3, |scene, frame| {
                scene.known.release(frame, 0, &[7]);
                assert_eq!(scene.known.depth(&frame.images[0])[7..9], [left, 5.0]);
            });
        }
    }
}
