//! The still scene that all persons stand in, learned where nobody is.

use crate::observation::background::{Background, Backgrounds};
use crate::observation::frame::{DepthImage, Frame};
use crate::observation::ownership::NO_OWNER;

/// One row of this many is learned in a frame, for speed: the scene stands still.
const LEARNED_ROWS: usize = 8;
/// A deeper return by more than this replaces what was learned, and a nearer one by less is taken in, meters.
const DEPTH_STEP: f32 = 0.15;
/// Share of a new return in what was learned.
const NEW_DEPTH: f32 = 0.1;
/// Where nothing was known, or something deeper, a return is the scene when it was there in so many looks in a row: a person who
/// was not found yet stands still for less.
const STILL_FRAMES: [u8; 2] = [4, 60];
/// What a camera has seen for longer than this was looked at for persons, seconds.
const OLD: f64 = 3.0;
/// Looks are alike within this, meters.
const SAME: f32 = 0.05;

/// What is known of the scene, and what may become so.
#[derive(Debug, Default)]
pub(super) struct SceneModel {
    known: Backgrounds,
    images: Vec<PendingDepth>,
    row: usize,
}

/// What was seen lately where the scene is not known, pixel by pixel, and in how many looks in a row.
#[derive(Debug, Default)]
struct PendingDepth {
    depth: Vec<f32>,
    frames: Vec<u8>,
    /// Since when the camera has been there, seconds; none in the first frame.
    since: Option<f64>,
    /// What it showed in the second frame was learned.
    filled: bool,
}

impl SceneModel {
    /// What is known.
    pub(super) fn known(&self) -> &Backgrounds {
        &self.known
    }

    /// Takes up the images of a frame whose cameras were not there before: nothing is known of them, unless they came from near by.
    pub(super) fn register(&mut self, frame: &Frame) {
        self.images.resize_with(frame.images.len(), PendingDepth::default);
        for (image, tentative) in frame.images.iter().zip(&mut self.images) {
            tentative.depth.resize(image.pixels.len(), 0.0);
            tentative.frames.resize(image.pixels.len(), 0);
        }
        let images = &mut self.images;
        self.known.register(frame, |number, carried| {
            if !carried {
                (images[number].since, images[number].filled) = (None, false);
            }
        });
    }

    /// Whether the camera of an image has been where it is for long enough: what stood there was looked at.
    pub(super) fn is_old(&self, image: usize, stamp: f64) -> bool {
        self.images.get(image).and_then(|image| image.since).is_some_and(|since| stamp - since > OLD)
    }

    /// Learns some rows where nobody is; all of them where the camera has stood still for the first time.
    pub(super) fn learn(&mut self, frame: &Frame, owners: &[Vec<u16>]) {
        self.row = (self.row + 1) % LEARNED_ROWS;
        for ((image, tentative), owners) in frame.images.iter().zip(&mut self.images).zip(owners) {
            let Some(known) = self.known.depth_mut(image) else { continue };
            if tentative.since.is_none() {
                tentative.since = Some(frame.stamp);
                continue;
            }
            let all = !std::mem::replace(&mut tentative.filled, true);
            if all {
                for (known, index) in known.iter_mut().zip(0..).filter(|(_, index)| owners[*index] == NO_OWNER) {
                    *known = meters(image, index).unwrap_or(0.0);
                }
            }
            for row in (self.row..image.camera.height()).step_by(LEARNED_ROWS) {
                for index in row * image.camera.width()..(row + 1) * image.camera.width() {
                    let Some(z) = meters(image, index).filter(|_| owners[index] == NO_OWNER) else { continue };
                    learn_pixel(&mut known[index], &mut tentative.depth[index], &mut tentative.frames[index], z);
                }
            }
        }
    }

    /// Whether most of these pixels of an image show what is known to be still.
    pub(super) fn is_still(&self, frame: &Frame, image: usize, pixels: &[usize]) -> bool {
        let Some((image, known)) = frame.images.get(image).and_then(|image| Some((image, self.known.of_image(image)?)))
        else {
            return false;
        };
        let still = |pixel: &&usize| {
            let known = known.depth().get(**pixel).copied().unwrap_or(0.0);
            meters(image, **pixel).is_some_and(|z| Background::contains(known, z))
        };
        2 * pixels.iter().filter(still).count() > pixels.len()
    }

    /// These pixels of an image show a person: where the scene was thought to be there, nothing is known of it. What was learned
    /// behind the person stays; forgotten, it would stand out as a flat body when the person is gone.
    pub(super) fn release(&mut self, frame: &Frame, image: usize, pixels: &[usize]) {
        let Some(image) = frame.images.get(image) else { return };
        let Some(known) = self.known.depth_mut(image) else { return };
        for pixel in pixels {
            if let Some(depth) = known.get_mut(*pixel)
                && meters(image, *pixel).is_none_or(|z| Background::contains(*depth, z))
            {
                *depth = 0.0;
            }
        }
    }
}

fn learn_pixel(known: &mut f32, tentative: &mut f32, frames: &mut u8, z: f32) {
    if *known > 0.0 && z > *known - DEPTH_STEP {
        *known = if z > *known + DEPTH_STEP { z } else { *known + NEW_DEPTH * (z - *known) };
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

/// Depth of a pixel, if anything returned.
fn meters(image: &DepthImage, index: usize) -> Option<f32> {
    let z = image.pixels.get(index) * image.meters_per_unit as f32;
    (z > 0.0 && z.is_finite()).then_some(z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::with_frame;

    const PIXELS: usize = 160 * 124;

    fn feed(scene: &mut SceneModel, millimeters: u16, frame: usize, check: impl FnOnce(&mut SceneModel, &Frame)) {
        with_frame(&[millimeters; PIXELS], frame as f64 / 30.0, |frame| {
            scene.register(frame);
            check(scene, frame);
            scene.learn(frame, &[vec![NO_OWNER; PIXELS]]);
        });
    }

    #[test]
    fn where_a_person_was_taken_for_the_scene_it_is_forgotten_and_behind_one_who_came_it_stays() {
        for (came, left) in [(5000, 0.0), (3000, 5.0)] {
            let mut scene = SceneModel::default();
            (0..3).for_each(|frame| feed(&mut scene, 5000, frame, |_, _| ()));
            feed(&mut scene, came, 3, |scene, frame| {
                scene.release(frame, 0, &[7]);
                let known = scene.known().of_image(&frame.images[0]).map(|known| [known.depth()[7], known.depth()[8]]);
                assert_eq!(known, Some([left, 5.0]));
            });
        }
    }
}
