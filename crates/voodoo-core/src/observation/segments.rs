//! Cuts the foreground of a frame into connected segments: each may be a lost body.

use std::cmp::Ordering;

use crate::config::Config;
use crate::math::{Aabb, Vec3};
use crate::observation::background::Background;
use crate::observation::candidates::REFERENCE_PATCH;
use crate::observation::depth_view::{DepthView, DepthViews};

/// Approximate number of samples per source: a search runs while the body is lost, and must keep up with the frame rate.
const SAMPLES_PER_SOURCE: usize = 5000;
/// Edge length of a cell, meters: samples in adjacent cells are connected.
const CELL: f64 = 0.12;
/// A cell with fewer surface patches than this holds stray returns: a surface fills several hundred.
const LEAST_PATCHES: f32 = 15.0;
/// Half of the number of cells per axis that a key can represent.
const HALF_KEY: f64 = (1_u64 << 20) as f64;

/// A connected segment; working frame, meters.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Segment {
    /// Centroid of the samples.
    pub center: Vec3,
    /// Bounding box.
    pub bounds: Aabb,
    /// Visible surface area, in patches.
    pub patches: f64,
}

/// A sample of a surface. Samples are sorted by cell, and then by position, so that sums are the same in every run.
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd)]
struct Sample {
    key: u64,
    point: [f32; 3],
    weight: f32,
}

#[derive(Clone, Copy, Debug)]
struct Cell {
    key: u64,
    samples: (u32, u32),
    /// Number of the segment, once it is known.
    segment: Option<usize>,
}

/// Working memory, and the segments of the last frame, largest first.
#[derive(Debug, Default)]
pub(crate) struct Segments {
    samples: Vec<Sample>,
    cells: Vec<Cell>,
    /// Cells of a segment whose neighbors have yet to be visited.
    unvisited: Vec<usize>,
    /// The segments.
    pub found: Vec<Segment>,
}

impl Segments {
    /// Segments a whole frame.
    pub(crate) fn find(&mut self, views: DepthViews, config: &Config) {
        let DepthViews { frame, origin, .. } = views;
        self.samples.clear();
        self.sample_images(views);
        for cloud in frame.clouds {
            let step = cloud.points.len().div_ceil(SAMPLES_PER_SOURCE).max(1);
            for index in (0..cloud.points.len()).step_by(step) {
                let point = cloud.world_from_sensor * cloud.points.get(index) - origin;
                self.push(point, cloud.weight * step as f64);
            }
        }
        let floor = frame.ground.map(|ground| ground.relative_to(origin));
        self.samples.retain(|sample| {
            let point = sample.position();
            let excluded = frame.excluded.iter().any(|bounds| bounds.contains(point + origin));
            !excluded && floor.is_none_or(|floor| floor.height(point) >= config.ground_clearance)
        });
        // An unstable sort needs no extra memory.
        self.samples.sort_unstable_by(|a, b| a.partial_cmp(b).unwrap_or(Ordering::Equal));
        self.fill_cells();
        self.number_cells();
        self.sum_up();
    }

    fn push(&mut self, point: Vec3, weight: f64) {
        let cell = (point / CELL).floor() + HALF_KEY;
        if !(cell.cmpge(Vec3::ONE).all() && cell.cmplt(Vec3::splat(2.0 * HALF_KEY - 1.0)).all()) {
            return;
        }
        let key = ((cell.x as u64) << 42) | ((cell.y as u64) << 21) | cell.z as u64;
        self.samples.push(Sample { key, point: point.as_vec3().to_array(), weight: weight as f32 });
    }

    fn sample_images(&mut self, views: DepthViews) {
        for DepthView { image, background, .. } in views.iter() {
            let step = ((image.pixels.len() as f64 / SAMPLES_PER_SOURCE as f64).sqrt().ceil() as usize).max(1);
            let [fx, fy] = image.camera.focal();
            let spread = (step * step) as f64 / (fx * fy * REFERENCE_PATCH);
            for row in (0..image.camera.height()).step_by(step) {
                for pixel in (row * image.camera.width()..(row + 1) * image.camera.width()).step_by(step) {
                    let Some(z) = image.depth(pixel) else { continue };
                    if background.get(pixel).is_some_and(|depth| Background::contains(*depth, z)) {
                        continue;
                    }
                    let point = image.world_from_sensor * image.back_project(pixel, z) - views.origin;
                    self.push(point, spread * f64::from(z * z));
                }
            }
        }
    }

    fn fill_cells(&mut self) {
        self.cells.clear();
        let mut start = 0;
        for samples in self.samples.chunk_by(|a, b| a.key == b.key) {
            let end = start + samples.len() as u32;
            if samples.iter().map(|sample| sample.weight).sum::<f32>() >= LEAST_PATCHES {
                self.cells.push(Cell { key: samples[0].key, samples: (start, end), segment: None });
            }
            start = end;
        }
    }

    /// Numbers the segments in the order of their first cells, and tells every cell the number of its segment: that of the adjacent
    /// ones.
    fn number_cells(&mut self) {
        let Self { cells, unvisited, found, .. } = self;
        found.clear();
        for index in 0..cells.len() {
            if cells[index].segment.is_some() {
                continue;
            }
            unvisited.push(index);
            cells[index].segment = Some(found.len());
            while let Some(cell) = unvisited.pop() {
                for neighbor in 0..27_i64 {
                    let offset = ((neighbor / 9 - 1) << 42) + ((neighbor / 3 % 3 - 1) << 21) + (neighbor % 3 - 1);
                    let key_beside = cells[cell].key.wrapping_add_signed(offset);
                    if let Ok(other) = cells.binary_search_by_key(&key_beside, |cell| cell.key)
                        && cells[other].segment.is_none()
                    {
                        unvisited.push(other);
                        cells[other].segment = Some(found.len());
                    }
                }
            }
            found.push(Segment { center: Vec3::ZERO, bounds: Aabb::EMPTY, patches: 0.0 });
        }
    }

    fn sum_up(&mut self) {
        for Cell { samples: (start, end), segment, .. } in &self.cells {
            let Some(number) = segment else { continue };
            let segment = &mut self.found[*number];
            for sample in &self.samples[*start as usize..*end as usize] {
                let (point, weight) = (sample.position(), f64::from(sample.weight));
                segment.center += weight * point;
                segment.bounds = segment.bounds.union(Aabb::new(point, point));
                segment.patches += weight;
            }
        }
        for segment in &mut self.found {
            segment.center /= segment.patches;
        }
        self.found.sort_by(|a, b| b.patches.total_cmp(&a.patches));
    }
}

impl Sample {
    fn position(&self) -> Vec3 {
        Vec3::from_array(self.point.map(f64::from))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Pose;
    use crate::observation::background::Backgrounds;
    use crate::observation::frame::{Cloud, Frame, PointSlice, Scope};
    use crate::testing::views;

    #[test]
    fn points_apart_are_segments_largest_first_and_strays_are_none() {
        let patch = |at: [f64; 3], count: usize| {
            (0..count).map(move |i| [at[0] + 0.01 * (i % 30) as f64, at[1] + 0.01 * (i / 30) as f64, at[2]])
        };
        let mut points: Vec<[f64; 3]> = patch([1.0, 0.0, 0.0], 600).chain(patch([3.0, 0.0, 0.0], 900)).collect();
        // Single returns, half a meter apart, do not connect the two.
        points.extend((0..40).map(|i| [0.5 * f64::from(i), 0.5, 1.0]));
        let mut found = Vec::new();
        for _ in 0..2 {
            let clouds = [Cloud {
                points: PointSlice::F64(&points),
                world_from_sensor: Pose::IDENTITY,
                weight: 1.0,
                scope: Scope::Free,
                source: 0,
            }];
            let frame = Frame { clouds: &clouds, ..Frame::empty(0.0) };
            let mut segments = Segments::default();
            segments.find(views(&frame, &Backgrounds::default()), &Config::default());
            found.push(segments.found);
            // A different order of the same points gives bitwise identical segments.
            points.reverse();
        }
        assert_eq!(found[0], found[1]);
        assert_eq!(found[0].len(), 2, "{found:?}");
        assert!((found[0][0].patches - 900.0).abs() < 40.0 && (found[0][1].patches - 600.0).abs() < 40.0, "{found:?}");
        assert!((found[0][0].center - Vec3::new(3.145, 0.145, 0.0)).length() < 0.02, "{found:?}");
    }
}
