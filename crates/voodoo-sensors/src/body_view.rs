//! Registers the depth measurements near the body to the image of a color camera, and finds the still scene.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;

use crate::registration::{MeasuredPixels, ProjectedPoints};
use crate::still::still;
use crate::window::Window;
use voodoo_core::Camera;
use voodoo_core::DepthPixels;
use voodoo_core::TrackError;
use voodoo_core::math::Vec3;

/// A camera whose pose entries change by less than this is static.
const CAMERA_STANDS: f64 = 1e-3;
/// Number of images over which the depth of a still surface hardly changes.
const STAYS_PICTURES: usize = 6;
/// A 4x4 transform, row by row.
pub type Matrix = [[f64; 4]; 4];

/// Depth measurements near the body, registered to the image of a color camera beside the depth camera.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BodyView {
    /// Height and width of the image.
    pub size: [usize; 2],
    /// For each pixel of the image, whether a point near the body was measured there, or it is outside the depth camera's field
    /// of view.
    pub mask: Vec<bool>,
    /// Columns and rows of the points in the image.
    pub pixels: Vec<[f64; 2]>,
    /// Depths of the points along the color camera's optical axis, meters.
    pub depths: Vec<f64>,
    /// For each point, whether no surface behind it was ever observed, so that it may be the scene. `None`: not known.
    pub still: Option<Vec<bool>>,
    /// For each pixel, whether a surface lies in front of one observed earlier. `None`: not known.
    pub before: Option<Vec<bool>>,
}

impl BodyView {
    /// Creates a view from measured values.
    pub fn measured(&self) -> MeasuredPixels<'_> {
        MeasuredPixels { places: &self.pixels, depths: &self.depths, still: self.still.as_deref() }
    }
}

/// Two flags for each evaluated pixel: whether it may be the scene, and whether a surface lies in front of one observed earlier.
pub type StillMasks = (Vec<bool>, Vec<bool>);

/// Finds candidates for the still scene of a static depth camera: pixels whose depth has not changed over some images and behind
/// which no surface was ever observed. So a table's edge does not become a hand.
///
/// A person who has not moved yet is a candidate too, so only a negative answer is certain: that pixel has changed.
#[derive(Clone, Debug, Default)]
pub struct StillDepth {
    size: [usize; 2],
    pose: Matrix,
    /// Images are never changed in place, so that copies share them.
    farthest: Arc<Vec<f32>>,
    last: VecDeque<Arc<Vec<f32>>>,
    /// Images for reuse, once no copy refers to them.
    spare: VecDeque<Arc<Vec<f32>>>,
}

impl StillDepth {
    /// Copies everything but the buffers for reuse.
    pub fn twin(&self) -> Self {
        let mut twin = self.clone();
        twin.spare.clear();
        twin
    }

    /// Returns a buffer for an image.
    fn image(&mut self) -> Vec<f32> {
        let mut image = self.spare.pop_front().and_then(|spare| Arc::try_unwrap(spare).ok()).unwrap_or_default();
        image.clear();
        image
    }

    /// Updates with an image of this size, meters, 0 = no return; a camera that has moved resets the scene.
    ///
    /// Returns for each pixel whether it may be the scene, and whether a surface lies in front of one observed earlier; `None` as
    /// long as too few images were observed. Only pixels within the given rows and columns are evaluated.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when the image does not have that size.
    pub fn update(
        &mut self,
        z: Vec<f32>,
        size: [usize; 2],
        pose: &Matrix,
        within: [Range<usize>; 2],
    ) -> Result<Option<StillMasks>, TrackError> {
        let entries = self.pose.as_flattened().iter().zip(pose.as_flattened());
        let moved = entries.into_iter().any(|(before, now)| !((before - now).abs() <= CAMERA_STANDS));
        if self.farthest.is_empty() || moved || self.size != size || self.farthest.len() != z.len() {
            (self.size, self.pose) = (size, *pose);
            self.farthest = Arc::new(z.clone());
            self.last.clear();
        } else {
            // NaN is kept.
            let farther = |(far, z): (&f32, &f32)| if *far > *z || far.is_nan() { *far } else { *z };
            let mut farthest = self.image();
            farthest.extend(self.farthest.iter().zip(&z).map(farther));
            self.spare.push_back(std::mem::replace(&mut self.farthest, Arc::new(farthest)));
        }
        let found = match self.last.front() {
            Some(then) if self.last.len() == STAYS_PICTURES => Some(still(&z, &self.farthest, then, size[1], within)?),
            _ => None,
        };
        if self.last.len() == STAYS_PICTURES {
            self.spare.extend(self.last.pop_front());
        }
        self.last.push_back(Arc::new(z));
        Ok(found)
    }
}

/// A depth image with its camera, and the region in which the body is expected.
#[derive(Clone, Copy, Debug)]
pub struct DepthBesideColor<'a> {
    /// Depth image, row by row.
    pub image: DepthPixels<'a>,
    /// Meters per unit of the image.
    pub meters_per_unit: f64,
    /// Calibration of the depth camera.
    pub camera: &'a Camera,
    /// Pose of the depth camera.
    pub world_from_depth: Matrix,
    /// Transform `color_from_depth`.
    pub color_from_depth: Matrix,
    /// Every step-th row and column is used.
    pub step: usize,
    /// Enlargement of the box around the body, meters.
    pub margin: f64,
    /// Positions of the body, world frame, meters.
    pub joints: &'a [[f64; 3]],
}

/// The points of a depth image near the body, in the color camera frame.
#[derive(Clone, Debug)]
pub struct Nearby {
    /// Points, meters.
    pub points: Vec<[f64; 3]>,
    still: Option<Vec<bool>>,
    moved: Option<Vec<bool>>,
}

impl DepthBesideColor<'_> {
    /// Depth of the body along the depth camera's optical axis, meters: the median over its positions.
    pub fn body_depth(&self) -> f64 {
        let mut depths: Vec<f64> = self.joints.iter().map(|place| self.in_depth(*place)[2]).collect();
        depths.sort_unstable_by(f64::total_cmp);
        let upper = depths.len() / 2;
        match (depths.get(upper.wrapping_sub(1)), depths.get(upper)) {
            (Some(lower), Some(upper)) if depths.len().is_multiple_of(2) => 0.5 * (lower + upper),
            (_, Some(middle)) => *middle,
            _ => f64::NAN,
        }
    }

    /// Returns the points near the body; `scene` is updated with the image.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when array sizes do not match.
    pub fn points_near_body(&self, scene: Option<&mut StillDepth>) -> Result<Nearby, TrackError> {
        let (whole, step) = ([self.camera.height(), self.camera.width()], self.step.max(1));
        let size = whole.map(|size| size.div_ceil(step));
        if self.camera.pixels() != self.image.len() {
            let found = format!("{} for {whole:?}", self.image.len());
            return Err(TrackError::measurement("depth", "a depth for every pixel of the camera", found));
        }
        let (low, high) = self.bounds();
        let [rows, columns] = self.window(low, high).map(|span| span.start.div_ceil(step)..span.end.div_ceil(step));
        let mut scene = scene;
        let depth = self.meters(scene.as_mut().map_or_else(Vec::new, |scene| scene.image()));
        let within = [rows.clone(), columns.clone()];
        let window = Window { depth: &depth, size, camera: self.camera, step, rows, columns };
        let (points, pixels) = window.within(low, high, &self.world_from_depth, &self.color_from_depth)?;
        let standing = match scene {
            Some(scene) => scene.update(depth, size, &self.world_from_depth, within)?,
            None => None,
        };
        let at = |marks: Vec<bool>| pixels.iter().map(|index| marks[*index as usize]).collect();
        let (still, moved) = standing.map_or((None, None), |(still, moved)| (Some(at(still)), Some(at(moved))));
        Ok(Nearby { points, still, moved })
    }

    /// Copies every step-th row and column, in meters, into a buffer.
    fn meters(&self, mut meters: Vec<f32>) -> Vec<f32> {
        let (scale, width, step) = (self.meters_per_unit as f32, self.camera.width(), self.step.max(1));
        fn every<T: Copy>(pixels: &[T], width: usize, step: usize) -> impl Iterator<Item = T> {
            pixels.chunks(width).step_by(step).flat_map(move |row| row.iter().step_by(step)).copied()
        }
        match (self.image, step) {
            (DepthPixels::U16(pixels), 1) => meters.extend(pixels.iter().map(|pixel| f32::from(*pixel) * scale)),
            (DepthPixels::U16(pixels), _) => {
                meters.extend(every(pixels, width, step).map(|pixel| f32::from(pixel) * scale));
            }
            (DepthPixels::F32(pixels), 1) => meters.extend(pixels.iter().map(|pixel| pixel * scale)),
            (DepthPixels::F32(pixels), _) => meters.extend(every(pixels, width, step).map(|pixel| pixel * scale)),
        }
        meters
    }

    fn in_depth(&self, place: [f64; 3]) -> [f64; 3] {
        let pose = &self.world_from_depth;
        let offset = [0, 1, 2].map(|axis| place[axis] - pose[axis][3]);
        [0, 1, 2].map(|axis| (0..3).map(|row| offset[row] * pose[row][axis]).sum())
    }

    /// Lower and upper corner of the box around the body, world frame.
    fn bounds(&self) -> ([f64; 3], [f64; 3]) {
        let least = |axis: usize| self.joints.iter().fold(f64::INFINITY, |least, place| least.min(place[axis]));
        let most = |axis: usize| self.joints.iter().fold(f64::NEG_INFINITY, |most, place| most.max(place[axis]));
        ([0, 1, 2].map(|axis| least(axis) - self.margin), [0, 1, 2].map(|axis| most(axis) + self.margin))
    }

    /// Rows and columns of the depth image that may show the box between two corners.
    fn window(&self, low: [f64; 3], high: [f64; 3]) -> [Range<usize>; 2] {
        let corner = |index: usize| {
            let place = [0, 1, 2].map(|axis| if index >> axis & 1 == 1 { high[axis] } else { low[axis] });
            Vec3::from_array(self.in_depth(place))
        };
        let [columns, rows] = self.camera.window((0..8).map(corner));
        [rows, columns]
    }
}

impl Nearby {
    /// Columns and rows of the points in the color image; NaN where a point is not visible.
    pub fn projected(&self, camera: &Camera) -> Vec<[f64; 2]> {
        let in_camera = |point: &[f64; 3]| camera.project(Vec3::from_array(*point)).unwrap_or([f64::NAN; 2]);
        self.points.iter().map(in_camera).collect()
    }

    /// Registers the points, at these pixels (column, row), to an image of `[height, width]`. Gaps between depth pixels are
    /// closed within `reach` pixels. Pixels outside the depth camera's field of view (`beyond`) are included in the mask.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when array sizes do not match.
    pub fn view(
        self,
        pixels: Vec<[f64; 2]>,
        beyond: &[bool],
        reach: usize,
        size: [usize; 2],
    ) -> Result<BodyView, TrackError> {
        let projected = ProjectedPoints::new(&pixels, &self.points, self.moved.as_deref(), size)?;
        let (mask, before) = projected.visible_mask(beyond, reach, size)?;
        let inside = |index: &isize| *index as usize;
        let depths = projected.inside.iter().map(|index| self.points[inside(index)][2]).collect();
        let still = self.still.map(|still| projected.inside.iter().map(|index| still[inside(index)]).collect());
        let pixels = projected.inside.iter().map(|index| pixels[inside(index)]).collect();
        Ok(BodyView { size, mask, pixels, depths, still, before })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;

    const LEVEL: Matrix = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

    #[test]
    fn a_scene_is_known_after_some_pictures_and_copies_have_their_own() {
        let mut scene = StillDepth::default();
        for count in 0..9 {
            let twin = scene.twin();
            let found = scene.update(vec![3.0; 12], [3, 4], &LEVEL, [0..3, 0..4]).unwrap();
            assert_eq!(found.is_some(), count >= STAYS_PICTURES, "{count}");
            assert_eq!(twin.last.len(), count.min(STAYS_PICTURES));
        }
        let twin = scene.twin();
        let mut hand = vec![3.0; 12];
        hand[5] = 2.0;
        hand[11] = f32::NAN;
        let (still, before) = scene.update(hand, [3, 4], &LEVEL, [0..3, 0..4]).unwrap().unwrap();
        assert_eq!((still[5], before[5], still[0]), (false, true, true));
        assert!(scene.farthest[11].is_nan() && *twin.farthest == [3.0; 12]);
        let moved = [[1.0, 0.0, 0.0, 0.01], LEVEL[1], LEVEL[2], LEVEL[3]];
        assert!(scene.update(vec![3.0; 12], [3, 4], &moved, [0..3, 0..4]).unwrap().is_none());
    }

    #[test]
    fn noise_is_not_before_the_scene_but_a_hand_that_came_is_and_stays_so() {
        let mut scene = StillDepth::default();
        let (size, hand) =
            ([60, 80], |index: usize| (20..30).contains(&(index / 80)) && (30..40).contains(&(index % 80)));
        let mut found = None;
        for step in 0..20_u32 {
            // Noise of up to 3 cm to either side, different for each pixel and image.
            let noise =
                |index: usize| (step * 4800 + index as u32).wrapping_mul(2_654_435_761) as f32 / u32::MAX as f32;
            let depth = |index: usize| {
                if step >= 8 && hand(index) { 2.5 } else { 3.0 + 0.06 * (noise(index) - 0.5) }
            };
            found = scene.update((0..4800).map(depth).collect(), size, &LEVEL, [0..60, 0..80]).unwrap();
            assert_eq!(found.is_some(), step as usize >= STAYS_PICTURES);
        }
        let (still, before) = found.unwrap();
        let within = |index: usize, margin: usize| {
            let (row, column) = (index / 80, index % 80);
            (20 + margin..30 - margin).contains(&row) && (30 + margin..40 - margin).contains(&column)
        };
        let around = |index: usize| (19..31).contains(&(index / 80)) && (29..41).contains(&(index % 80));
        assert!((0..4800).filter(|index| within(*index, 1)).all(|index| before[index] && !still[index]));
        let outside: Vec<usize> = (0..4800).filter(|index| !around(*index)).collect();
        assert!(outside.iter().all(|index| !before[*index]));
        assert!(20 * outside.iter().filter(|index| !still[**index]).count() < outside.len());
    }

    #[test]
    fn the_body_is_searched_for_in_its_box_alone() {
        let mut image = vec![4000_u16; 24 * 16];
        (6..10).for_each(|row| image[row * 24 + 8..row * 24 + 12].fill(2000));
        let camera = Camera::pinhole(24, 16, [20.0, 20.0, 11.5, 7.5]).unwrap();
        let beside = DepthBesideColor {
            image: DepthPixels::U16(&image),
            meters_per_unit: 0.001,
            camera: &camera,
            world_from_depth: LEVEL,
            color_from_depth: LEVEL,
            step: 1,
            margin: 0.3,
            joints: &[[-0.2, 0.0, 1.9], [-0.1, 0.1, 2.0], [-0.1, 0.1, 2.2]],
        };
        assert_eq!(beside.body_depth(), 2.0);
        let nearby = beside.points_near_body(None).unwrap();
        assert_eq!(nearby.points.len(), 16);
        let pixels = nearby.projected(&camera);
        let view = nearby.view(pixels, &vec![false; 24 * 16], 1, [16, 24]).unwrap();
        assert_eq!(view.mask.iter().filter(|pixel| **pixel).count(), 36);
        assert!((view.depths[0] - 2.0).abs() < 1e-6 && view.mask[5 * 24 + 7] && !view.mask[4 * 24 + 7]);
        let coarse = DepthBesideColor { step: 2, ..beside };
        assert_eq!(coarse.points_near_body(None).unwrap().points.len(), 4);
        let narrow = Camera::pinhole(23, 16, [20.0, 20.0, 11.5, 7.5]).unwrap();
        assert!(DepthBesideColor { camera: &narrow, ..beside }.points_near_body(None).is_err());
    }
}
