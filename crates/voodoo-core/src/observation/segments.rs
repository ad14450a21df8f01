//! Cuts the foreground of a frame into connected segments: each may be a lost body.

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

#[derive(Clone, Copy, Debug)]
struct Sample {
    key: u64,
    point: [f32; 3],
    weight: f32,
}

#[derive(Clone, Copy, Debug)]
struct Cell {
    key: u64,
    samples: (u32, u32),
    /// Union-find parent: another cell of the segment with a smaller index, or itself.
    parent: u32,
    /// Number of the segment, of a cell that is its own parent.
    segment: u32,
}

/// Working memory, and the segments of the last frame, largest first.
#[derive(Debug, Default)]
pub(crate) struct Segments {
    samples: Vec<Sample>,
    cells: Vec<Cell>,
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
        if !frame.excluded.is_empty() {
            let inside = |sample: &Sample| {
                let point = Vec3::from_array(sample.point.map(f64::from)) + origin;
                frame.excluded.iter().any(|bounds| bounds.contains(point))
            };
            self.samples.retain(|sample| !inside(sample));
        }
        if let Some(ground) = frame.ground {
            let floor = ground.relative_to(origin);
            let height = |point: [f32; 3]| floor.height(Vec3::from_array(point.map(f64::from)));
            self.samples.retain(|sample| height(sample.point) >= config.ground_clearance);
        }
        // An unstable sort needs no extra memory but does not keep the order of equal keys; sums must be the same in every run.
        self.samples.sort_unstable_by(|a, b| {
            let [first, second] = [a, b].map(|sample| sample.point.map(f64::from));
            a.key.cmp(&b.key).then_with(|| order(&first, &second))
        });
        self.fill_cells();
        self.join_cells();
        self.sum_up();
    }

    fn push(&mut self, point: Vec3, weight: f64) {
        let cell = (point / CELL).floor() + HALF_KEY;
        if !(cell.cmpge(Vec3::ONE).all() && cell.cmplt(Vec3::splat(2.0 * HALF_KEY - 1.0)).all()) {
            return;
        }
        let key = ((cell.x as u64) << 42) | ((cell.y as u64) << 21) | cell.z as u64;
        let point = point.to_array().map(|value| value as f32);
        self.samples.push(Sample { key, point, weight: weight as f32 });
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
                    self.push(point, image.weight * spread * f64::from(z * z));
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
                let parent = self.cells.len() as u32;
                self.cells.push(Cell { key: samples[0].key, samples: (start, end), parent, segment: 0 });
            }
            start = end;
        }
    }

    /// Joins every cell with its adjacent ones. Testing half of the directions is enough: the other neighbors find this cell.
    fn join_cells(&mut self) {
        for index in 0..self.cells.len() {
            let key = self.cells[index].key;
            for neighbor in 14..27_i64 {
                let offset = ((neighbor / 9 - 1) << 42) + ((neighbor / 3 % 3 - 1) << 21) + (neighbor % 3 - 1);
                let key_beside = key.wrapping_add_signed(offset);
                if let Ok(other) = self.cells.binary_search_by_key(&key_beside, |cell| cell.key) {
                    let (a, b) = (self.first(index as u32), self.first(other as u32));
                    self.cells[a.max(b) as usize].parent = a.min(b);
                }
            }
        }
    }

    /// The union-find root of a cell, with path compression.
    fn first(&mut self, mut cell: u32) -> u32 {
        loop {
            let parent = self.cells[cell as usize].parent;
            if parent == cell {
                return cell;
            }
            let next = self.cells[parent as usize].parent;
            self.cells[cell as usize].parent = next;
            cell = next;
        }
    }

    fn sum_up(&mut self) {
        self.found.clear();
        for index in 0..self.cells.len() {
            let first = self.first(index as u32) as usize;
            if first == index {
                self.cells[index].segment = self.found.len() as u32;
                self.found.push(Segment { center: Vec3::ZERO, bounds: Aabb::EMPTY, patches: 0.0 });
            }
            let segment = &mut self.found[self.cells[first].segment as usize];
            let (start, end) = self.cells[index].samples;
            for sample in &self.samples[start as usize..end as usize] {
                let weight = f64::from(sample.weight);
                let point = Vec3::from_array(sample.point.map(f64::from));
                segment.center += weight * point;
                segment.bounds = segment.bounds.union(Aabb::new(point, point));
                segment.patches += weight;
            }
        }
        for segment in &mut self.found {
            segment.center /= segment.patches;
        }
        // No two segments have the same centroid, so the order is the same in every run.
        let place = |segment: &Segment| segment.center.to_array();
        self.found.sort_unstable_by(|a, b| b.patches.total_cmp(&a.patches).then_with(|| order(&place(a), &place(b))));
    }
}

fn order(a: &[f64; 3], b: &[f64; 3]) -> std::cmp::Ordering {
    let axes = a.iter().zip(b).map(|(a, b)| a.total_cmp(b));
    axes.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
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
