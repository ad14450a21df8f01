//! Segments a depth image into candidates and crops them for the network.

use crate::components::{Components, PersonCandidate};
use crate::floor::find_floor;
use crate::view::ThinnedImage;
use voodoo_core::math::Vec3;
use voodoo_core::{DepthImage, Ground, Surroundings};

/// Segments depth images into candidates; keeps its memory between images.
#[derive(Debug, Default)]
pub struct Segmentation {
    pub(crate) view: ThinnedImage,
    pub(crate) parts: Components,
    /// The candidates of the last image, those of a standing person's size first.
    pub candidates: Vec<PersonCandidate>,
    /// The floor in the last image, given or estimated, camera frame.
    pub floor: Option<Ground>,
    /// The upward direction, camera frame.
    pub(crate) up: Vec3,
}

impl Segmentation {
    /// Segments an image into candidates.
    pub fn find(&mut self, image: &DepthImage, around: &Surroundings) {
        let camera_from_world = image.world_from_sensor.inverse();
        self.view.read(image, around);
        let given = around.ground.map(|ground| {
            let normal = camera_from_world.rotation * ground.normal;
            Ground { normal, ..ground.relative_to(image.world_from_sensor.translation) }
        });
        // If no upward direction is given, up is upwards in the image.
        let up = around.up.map_or(-Vec3::Y, |up| camera_from_world.rotation * up);
        self.floor = given.or_else(|| find_floor(&self.view, up));
        self.up = self.floor.map_or(up, |floor| floor.normal);
        // The floor is a part of the known scene.
        self.view.remove_explained(around);
        if let Some(floor) = &self.floor {
            self.view.remove_floor(floor);
        }
        self.parts.find(&self.view, &mut self.candidates);
    }

    /// The full-image indices of all pixels of a candidate, including those skipped by the subsampling.
    pub fn mask(&self, candidate: &PersonCandidate) -> Vec<usize> {
        let own = self.parts.labels.iter().enumerate().filter(|(_, label)| candidate.has(label));
        own.flat_map(|(index, _)| self.view.block(index)).collect()
    }
}
