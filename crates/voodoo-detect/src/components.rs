//! Connected components of a depth image, and the combinations of them that may be a person.

use crate::view::ThinnedImage;
use nalgebra::{Matrix3, Vector3};
use voodoo_core::SURFACE_STEP;
use voodoo_core::math::{Aabb, Vec3, refill, reset, widest};

/// Components that are too large for a person are split again with steps of depth that are this fraction of the previous ones.
const CUT_FINER: f32 = 0.5;
/// Maximum number of splits.
const CUTS: usize = 2;
/// Visible surface of a person, square meters: from a head and shoulders to a wide coat.
const AREA: [f64; 2] = [0.08, 1.7];
/// Longest edge of a person's box, meters.
const LENGTH: [f64; 2] = [0.45, 2.5];
/// Components with less surface than this are noise, square meters.
const LEAST_COMPONENT: f64 = 0.004;
/// Maximum distance between components of one person whose connection is occluded, meters.
const GAP: f64 = 0.28;
/// A component is flat if the standard deviation of its points from their plane is a smaller part of its longest edge than this:
/// walls and table tops are not people.
const FLAT_COMPONENT: f64 = 0.011;
/// Number of points sampled from a component to compute distances.
const COMPONENT_SAMPLES: usize = 48;
/// Maximum number of components considered, the largest first.
const MOST_COMPONENTS: usize = 40;
/// No label.
const NONE: u32 = u32::MAX;
/// Bits of the neighbors to which a pixel may be connected.
const LEFT: u8 = 1;
const UP: u8 = 2;
const LEFT_BY_TWO: u8 = 4;
const UP_BY_TWO: u8 = 8;

/// A connected component; camera frame, meters.
#[derive(Clone, Debug)]
struct Component {
    label: u32,
    area: f64,
    bounds: Aabb,
    /// At most [`COMPONENT_SAMPLES`] of its points.
    samples: Vec<Vec3>,
    /// Number of points added so far; every `every`-th of them was kept.
    added: usize,
    every: usize,
}

impl Component {
    fn new(label: u32, area: f64) -> Self {
        Self { label, area, bounds: Aabb::from_points([]), samples: Vec::new(), added: 0, every: 1 }
    }

    /// Adds a point; only every `every`-th is kept once there are many.
    fn add(&mut self, point: Vec3) {
        self.bounds = self.bounds.union(Aabb::new(point, point));
        // `every` is a power of two, which avoids a division per pixel.
        if self.added & (self.every - 1) == 0 {
            if self.samples.len() == COMPONENT_SAMPLES {
                // Drops every second kept point to make room.
                self.samples = self.samples.iter().step_by(2).copied().collect();
                self.every *= 2;
            }
            self.samples.push(point);
        }
        self.added += 1;
    }
}

/// Components that together may be a person.
#[derive(Clone, Debug, PartialEq)]
pub struct PersonCandidate {
    /// Labels of its components.
    pub(crate) labels: Vec<u32>,
    /// Visible surface area, square meters.
    pub area: f64,
    /// Its box, camera frame.
    pub bounds: Aabb,
}

impl PersonCandidate {
    /// Distance of a point (camera frame) to its box, plus a small fraction of the distance to the box's center.
    pub(crate) fn distance(&self, point: Vec3) -> f64 {
        /// A point within several boxes belongs to the one with the nearest center.
        const TO_MIDDLE: f64 = 0.1;
        let outside = (self.bounds.mins - point).max(point - self.bounds.maxs).max(Vec3::ZERO).length();
        outside + TO_MIDDLE * point.distance(self.bounds.center())
    }

    /// Whether a component is one of its.
    pub(crate) fn has(&self, label: &u32) -> bool {
        self.labels.binary_search(label).is_ok()
    }

    /// Whether two candidates share a component.
    pub(crate) fn overlaps(&self, other: &Self) -> bool {
        self.labels.iter().any(|label| other.has(label))
    }
}

/// Working memory, and the components of the last image.
#[derive(Debug, Default)]
pub(crate) struct Components {
    /// The label of every pixel: the index of an earlier pixel of the same component, or of itself.
    pub(crate) labels: Vec<u32>,
    parts: Vec<Component>,
    /// The distinct labels, ascending.
    distinct: Vec<u32>,
    /// Surface area of each component, at the index of its label; other entries are meaningless.
    areas: Vec<f32>,
    /// 1 for every pixel that is to be connected to its neighbors.
    again: Vec<u8>,
    /// Bit mask for each pixel: which of its neighbors it is connected to.
    linked: Vec<u8>,
    /// The same without connections that follow from others.
    needed: Vec<u8>,
}

impl Components {
    /// Finds candidates for persons, those with the most probable sizes first.
    pub(crate) fn find(&mut self, view: &ThinnedImage, candidates: &mut Vec<PersonCandidate>) {
        let label = |(index, z): (usize, &f32)| if *z > 0.0 { index as u32 } else { NONE };
        refill(&mut self.labels, view.depth.iter().enumerate().map(label));
        reset(&mut self.again, view.depth.len(), 1);
        let mut finer = 1.0;
        self.join(view, finer);
        self.measure(view);
        for _ in 0..CUTS {
            let too_large = |label: &u32| f64::from(self.areas[*label as usize]) > AREA[1];
            if !self.distinct.iter().any(too_large) {
                break;
            }
            finer *= CUT_FINER;
            self.cut(view, finer);
            self.measure(view);
        }
        self.sum_up(view);
        candidates.clear();
        self.propose(candidates);
    }

    /// Splits components that are too large: connects their pixels again with smaller steps.
    fn cut(&mut self, view: &ThinnedImage, finer: f32) {
        let Self { labels, areas, again, .. } = self;
        let too_large = |label: &u32| *label != NONE && f64::from(areas[*label as usize]) > AREA[1];
        refill(again, labels.iter().map(|label| u8::from(too_large(label))));
        for ((label, again), index) in labels.iter_mut().zip(again).zip(0..) {
            if *again > 0 {
                *label = index;
            }
        }
        self.join(view, finer);
    }

    /// Connects neighbors, and pixels at a distance of two, that are on one surface, among the pixels marked in `again`.
    fn join(&mut self, view: &ThinnedImage, finer: f32) {
        self.link(view, finer);
        let width = view.width;
        let mut before = NONE;
        for index in 0..self.labels.len() {
            let linked = self.needed[index];
            if linked == LEFT {
                self.labels[index] = before;
                continue;
            }
            // No earlier pixel has this pixel as its root, and the root of the pixel to the left was resolved just before.
            let mut root = if linked & LEFT != 0 { before } else { index as u32 };
            for (bit, back) in [(UP, width), (LEFT_BY_TWO, 2), (UP_BY_TWO, 2 * width)] {
                if linked & bit == 0 || self.labels[index - back] == root {
                    continue;
                }
                let other = self.root((index - back) as u32);
                self.labels[root.max(other) as usize] = root.min(other);
                root = root.min(other);
            }
            if linked != 0 {
                self.labels[index] = root;
            }
            before = root;
        }
        self.distinct.clear();
        for index in 0..self.labels.len() {
            let label = self.labels[index];
            if label != NONE {
                // The pixel at this label came earlier and already has its final label.
                self.labels[index] = self.labels[label as usize];
                if label == index as u32 {
                    self.distinct.push(label);
                }
            }
        }
    }

    /// Computes a bit mask for each pixel: whether it is connected to the pixel on the left, above, two to the left and two
    /// above.
    fn link(&mut self, view: &ThinnedImage, finer: f32) {
        let Self { linked, needed, again, .. } = self;
        let width = view.width;
        reset(linked, view.depth.len(), 0);
        needed.clear();
        widest(
            #[inline(always)]
            || {
                for (bit, back) in [(LEFT, 1), (UP, width), (LEFT_BY_TWO, 2), (UP_BY_TWO, 2 * width)] {
                    let across = back < width;
                    // Row by row, so that the first pixels of a row are not connected to the end of the row before.
                    for start in (0..view.depth.len()).step_by(width.max(1)) {
                        let from = if across { start + back } else { start };
                        let to = start + width;
                        if from < back || from >= to {
                            continue;
                        }
                        let (own, others) = (&view.depth[from..to], &view.depth[from - back..to - back]);
                        let (again, again_others) = (&again[from..to], &again[from - back..to - back]);
                        let pairs = own.iter().zip(others).zip(again).zip(again_others);
                        for (linked, (((z, other), again), again_other)) in linked[from..to].iter_mut().zip(pairs) {
                            let near = (z - other).abs() < finer * (SURFACE_STEP[0] + SURFACE_STEP[1] * z.min(*other));
                            let valid = (*z > 0.0) & (*other > 0.0);
                            *linked |= bit * (u8::from(near & valid) & again & again_other);
                        }
                    }
                }
                // The first two rows have no neighbors above by two.
                let first = linked.len().min(2 * width.max(1));
                needed.extend_from_slice(&linked[..first]);
                let above = linked[first - first / 2..].iter().zip(&linked[..]);
                let pairs = linked[first..].iter().zip(linked[first - first.min(1)..].iter().zip(above));
                needed.extend(pairs.map(|(own, (left, (up, up_by_two)))| {
                    let is = |mask: &u8, bit: u8| u8::from(mask & bit != 0);
                    let [to_left, to_up] = [is(own, LEFT), is(own, UP)];
                    let follows = [
                        UP * (to_left & is(left, UP) & is(up, LEFT)),
                        LEFT_BY_TWO * (to_left & is(left, LEFT)),
                        UP_BY_TWO * ((to_up & is(up, UP)) | (to_left & is(left, UP_BY_TWO) & is(up_by_two, LEFT))),
                    ];
                    own & !(follows[0] | follows[1] | follows[2])
                }));
            },
        );
    }

    fn root(&mut self, mut index: u32) -> u32 {
        loop {
            let parent = self.labels[index as usize];
            if parent == index {
                return index;
            }
            let next = self.labels[parent as usize];
            self.labels[index as usize] = next;
            index = next;
        }
    }

    /// Sums the surface area of every component.
    fn measure(&mut self, view: &ThinnedImage) {
        let Self { labels, areas, distinct, .. } = self;
        areas.resize(labels.len(), 0.0);
        for label in distinct {
            areas[*label as usize] = 0.0;
        }
        let area = view.pixel_area() as f32;
        // Neighbors mostly share their label, so a sum is written only when the label changes.
        let (mut last, mut sum) = (NONE, 0.0);
        for (label, z) in labels.iter().zip(&view.depth).filter(|(label, _)| **label != NONE) {
            if *label != last {
                if last != NONE {
                    areas[last as usize] = sum;
                }
                (last, sum) = (*label, areas[*label as usize]);
            }
            sum += area * z * z;
        }
        if last != NONE {
            areas[last as usize] = sum;
        }
    }

    /// Computes the sizes of the components, the largest first.
    fn sum_up(&mut self, view: &ThinnedImage) {
        let Self { labels, parts, areas, distinct, .. } = self;
        let part = |label: &u32| Component::new(*label, f64::from(areas[*label as usize]));
        refill(parts, distinct.iter().map(part).filter(|part| part.area > LEAST_COMPONENT));
        parts.sort_by(|a, b| b.area.total_cmp(&a.area).then(a.label.cmp(&b.label)));
        parts.truncate(MOST_COMPONENTS);
        // From here on the entry at a label's index is its component's index plus one.
        for label in distinct {
            areas[*label as usize] = 0.0;
        }
        for (number, part) in parts.iter().enumerate() {
            areas[part.label as usize] = number as f32 + 1.0;
        }
        for (index, label) in labels.iter().enumerate().filter(|(_, label)| **label != NONE) {
            if let Some(part) = (areas[*label as usize] as usize).checked_sub(1) {
                parts[part].add(view.point(index));
            }
        }
    }

    /// Proposes every component that may be a person, by itself and together with nearby components.
    fn propose(&self, candidates: &mut Vec<PersonCandidate>) {
        for (number, part) in self.parts.iter().enumerate() {
            let large = (0.3 * AREA[0]..=AREA[1]).contains(&part.area);
            if !large || is_flat(&part.samples, part.bounds.extents().max_element()) {
                continue;
            }
            let alone = PersonCandidate { labels: vec![part.label], area: part.area, bounds: part.bounds };
            let together = self.with_near_parts(number, alone.clone());
            for candidate in [alone, together] {
                let within = |size: f64, [least, most]: [f64; 2]| least < size && size < most;
                if within(candidate.area, AREA)
                    && within(candidate.bounds.extents().max_element(), LENGTH)
                    && !candidates.contains(&candidate)
                {
                    candidates.push(candidate);
                }
            }
        }
        candidates.sort_by(|a, b| unlikely(a).total_cmp(&unlikely(b)).then(a.labels.cmp(&b.labels)));
    }

    /// Combines a component with nearby ones as long as the result is no larger than a person.
    fn with_near_parts(&self, seed: usize, mut whole: PersonCandidate) -> PersonCandidate {
        let mut taken = vec![seed];
        let mut next = 0;
        while next < taken.len() {
            let from = &self.parts[taken[next]];
            next += 1;
            for (number, other) in self.parts.iter().enumerate() {
                if taken.contains(&number) || whole.area + other.area > AREA[1] {
                    continue;
                }
                let bounds = whole.bounds.union(other.bounds);
                if bounds.extents().max_element() < LENGTH[1] && near(from, other) {
                    taken.push(number);
                    whole.labels.push(other.label);
                    whole.area += other.area;
                    whole.bounds = bounds;
                }
            }
        }
        whole.labels.sort_unstable();
        whole
    }
}

/// Whether two components are closer to each other than components of one person may be.
fn near(a: &Component, b: &Component) -> bool {
    let gap = (a.bounds.mins - b.bounds.maxs).max(b.bounds.mins - a.bounds.maxs).max(Vec3::ZERO).length();
    if gap > GAP {
        return false;
    }
    a.samples.iter().any(|p| b.samples.iter().any(|q| p.distance_squared(*q) < GAP * GAP))
}

/// Whether points, whose box has this longest edge, lie near a plane.
fn is_flat(points: &[Vec3], edge: f64) -> bool {
    let count = points.len() as f64;
    let mean = points.iter().sum::<Vec3>() / count;
    let mut scatter = Matrix3::zeros();
    for point in points {
        let from = Vector3::from((*point - mean).to_array());
        scatter += from * from.transpose() / count;
    }
    scatter.symmetric_eigenvalues().min() < (FLAT_COMPONENT * edge).powi(2)
}

/// Absolute difference of the logarithms of the visible surface area and that of a standing person.
fn unlikely(candidate: &PersonCandidate) -> f64 {
    /// Visible surface area of a standing person, square meters.
    const STANDING: f64 = 0.55;
    (candidate.area / STANDING).ln().abs()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{before_wall, image, put_board, standing};
    use voodoo_core::Surroundings;

    /// Candidates in an image of the unit tests' camera.
    fn candidates(pixels: &[u16]) -> Vec<PersonCandidate> {
        let (mut view, mut found) = (ThinnedImage::default(), Vec::new());
        view.read(&image(pixels), &Surroundings::default());
        Components::default().find(&view, &mut found);
        found
    }

    #[test]
    fn a_person_before_a_wall_is_a_candidate_and_the_wall_is_none() {
        let (body, poses) = standing();
        let found = candidates(&before_wall(&body, &poses));
        assert_eq!(found.len(), 1, "{found:?}");
        let (size, middle) = (found[0].bounds.maxs - found[0].bounds.mins, found[0].bounds.center());
        assert!((1.5..1.85).contains(&size.y) && size.z < 0.5, "{size}");
        assert!(middle.distance(poses[0].translation) < 0.25, "{middle}");
    }

    #[test]
    fn a_person_cut_in_two_by_something_before_it_is_one_candidate() {
        let (body, poses) = standing();
        let mut pixels = before_wall(&body, &poses);
        // A rail at the height of the hips, a meter before the body.
        put_board(&mut pixels, Vec3::new(0.0, 0.03, 1.6), [1.5, 0.03]);
        let found = candidates(&pixels);
        let whole = found.iter().find(|candidate| candidate.labels.len() > 1);
        assert!(whole.is_some_and(|whole| (whole.bounds.maxs - whole.bounds.mins).y > 1.5), "{found:?}");
    }

    #[test]
    fn components_are_those_that_a_search_from_pixel_to_pixel_finds() {
        let size = before_wall(&standing().0, &standing().1).len();
        let mut state = 7_u64;
        // Depths of few levels, some of which are connected, with holes.
        let mut pixels = vec![0; size];
        for pixel in &mut pixels {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *pixel = [0, 0, 1000, 1020, 1060, 1500, 1500, 1540][(state >> 61) as usize];
        }
        let (mut view, mut parts) = (ThinnedImage::default(), Components::default());
        view.read(&image(&pixels), &Surroundings::default());
        parts.find(&view, &mut Vec::new());
        parts.labels.iter_mut().zip(0..).filter(|(label, _)| **label != NONE).for_each(|(label, index)| *label = index);
        parts.again.fill(1);
        parts.join(&view, 1.0);
        let (depth, width) = (&view.depth, view.width);
        let connected = |a: usize, b: usize| {
            let [a, b] = [depth[a], depth[b]];
            a > 0.0 && b > 0.0 && (a - b).abs() < SURFACE_STEP[0] + SURFACE_STEP[1] * a.min(b)
        };
        let mut expected = vec![NONE; depth.len()];
        for first in (0..depth.len()).filter(|index| depth[*index] > 0.0) {
            let mut open = if expected[first] == NONE { vec![first] } else { Vec::new() };
            while let Some(index) = open.pop() {
                if std::mem::replace(&mut expected[index], first as u32) == first as u32 {
                    continue;
                }
                let (row, column) = (index / width, index % width);
                let near = [1, 2].into_iter().flat_map(|step| {
                    let across =
                        [(column >= step).then(|| index - step), (column + step < width).then(|| index + step)];
                    let down = index + step * width;
                    across
                        .into_iter()
                        .chain([(row >= step).then(|| index - step * width), (down < depth.len()).then_some(down)])
                });
                open.extend(near.flatten().filter(|other| expected[*other] == NONE && connected(index, *other)));
            }
        }
        assert!(parts.labels == expected && parts.distinct.len() > 100);
    }

    #[test]
    fn nothing_and_what_is_flat_small_or_too_large_are_no_candidates() {
        let size = before_wall(&standing().0, &standing().1).len();
        assert_eq!(candidates(&vec![0; size]), []);
        for (depth, half) in [(2.6, [0.3, 0.8]), (2.0, [0.05, 0.1]), (3.0, [1.4, 1.2])] {
            let mut pixels = vec![0; size];
            put_board(&mut pixels, Vec3::new(0.0, 0.0, depth), half);
            assert_eq!(candidates(&pixels), [], "{half:?}");
        }
    }
}
