//! Releases pixels of the background that show the body.

use super::background::{Background, Backgrounds};
use super::frame::Frame;
use super::observer::Own;

impl Backgrounds {
    /// Sets the learned depth to unknown at pixels that show the body, and returns the previous values.
    pub(crate) fn release(&mut self, frame: &Frame, own: Own) -> Vec<f32> {
        let Some(image) = frame.images.get(own.image) else { return Vec::new() };
        let Some(depth) = self.depth_mut(image) else { return Vec::new() };
        let scale = image.meters_per_unit as f32;
        let forget = |pixel: &usize| {
            let Some(depth) = depth.get_mut(*pixel) else { return 0.0 };
            let learned = *depth;
            // Depths learned behind the body stay.
            let z = image.pixels.get(*pixel) * scale;
            if !(z > 0.0) || Background::contains(learned, z) {
                *depth = 0.0;
            }
            learned
        };
        own.pixels.iter().map(forget).collect()
    }

    /// Restores the depths that `release` returned.
    pub(super) fn restore(&mut self, frame: &Frame, own: Own, learned: &[f32]) {
        let Some(depth) = frame.images.get(own.image).and_then(|image| self.depth_mut(image)) else { return };
        for (pixel, learned) in own.pixels.iter().zip(learned) {
            if let Some(depth) = depth.get_mut(*pixel) {
                *depth = *learned;
            }
        }
    }
}
