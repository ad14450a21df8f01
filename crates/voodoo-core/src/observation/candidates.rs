//! Step 1 (K06 IV-B.1): free points inside the enlarged whole-body box, plus the points known to be on the body.

use crate::body::Body;
use crate::config::Config;
use crate::math::{Aabb, Mat3, Points, Pose, Vec3, shifted, vectorized};
use crate::observation::clusters::Clusters;
use crate::observation::depth_view::{DepthView, DepthViews};
use crate::observation::frame::{Cloud, DepthImage, Scope};
use crate::observation::pixels::{Grid, PointGate, STRETCH, Stretch};

/// Marks a point that may belong to any limb.
pub(crate) const ANY_LIMB: u16 = u16::MAX;

/// Measured points that may lie on the body, in the working frame (world axes, origin near the body), single precision.
#[derive(Debug, Default)]
pub(crate) struct Candidates {
    /// Positions.
    pub points: Points,
    /// Weights.
    pub weight: Vec<f32>,
    /// The surface for which each pixel stands, in patches: its weight without the precision of the image. Points of clouds stand for
    /// their weight.
    pub area: Vec<f32>,
    /// The limb they are known to be on, or [`ANY_LIMB`].
    pub limb: Vec<u16>,
    /// Index of the source of each point.
    pub source: Vec<u16>,
    /// The pixels of depth images come first, image after image: for each image, the number of points up to its end, and the
    /// position of its camera.
    pub cameras: Vec<(u32, Vec3)>,
    /// The points again, grouped into clusters of neighbors.
    pub(crate) clusters: Clusters,
    /// The points that [`Self::subsampled`] returns, if there are any.
    fewer: Option<Box<Candidates>>,
}

/// Number of pixels that is enough for coarse evaluations: where there are at least twice as many, they are subsampled, because
/// time grows in proportion. With 500 and with 800, the hypotheses of the rendered recordings have the same outcome.
const ROUGH_POINTS: usize = 700;

/// Box around the posed body, enlarged by `margin`, in the frame of `poses`.
pub(crate) fn body_box(body: &Body, poses: &[Pose], margin: f64) -> Aabb {
    let boxes = body.limbs().iter().zip(poses).map(|(limb, pose)| limb.shape.aabb(pose));
    boxes.fold(Aabb::EMPTY, Aabb::union).enlarged(margin)
}

impl Candidates {
    /// Number of candidates.
    pub(crate) fn len(&self) -> usize {
        self.points.len()
    }

    /// Gathers the candidates of a frame; `bounds` is the enlarged whole-body box in the working frame. Pixels of the learned
    /// backgrounds are left out.
    pub(crate) fn gather(&mut self, views: DepthViews, bounds: &Aabb, config: &Config) {
        let DepthViews { frame, ownership, origin, .. } = views;
        self.clear();
        let (up, floor) = match frame.ground {
            Some(ground) => (ground.normal, ground.relative_to(origin).offset + config.ground_clearance),
            None => (Vec3::ZERO, -1.0),
        };
        let [low, high, up] = [bounds.mins, bounds.maxs, up].map(|v| v.as_vec3().to_array());
        let gate = PointGate { low, high, up, floor: floor as f32 };
        for view in views.iter() {
            let first = self.points.len();
            self.gather_image(&view, bounds, &gate, config.max_points);
            self.leave_out(first, frame.excluded, origin);
            self.cameras.push((self.points.len() as u32, view.working_from_camera.translation));
        }
        for (number, cloud) in frame.clouds.iter().enumerate() {
            let first = self.points.len();
            let owners = ownership.owners(frame.images.len() + number);
            let is_others = |point: usize| owners.get(point).is_some_and(|owner| ownership.is_others(*owner));
            self.gather_cloud(cloud, origin, &gate, is_others);
            if !matches!(cloud.scope, Scope::Limb(_)) {
                self.leave_out(first, frame.excluded, origin);
            }
        }
        self.clusters.arrange(&self.points);
        self.thin();
    }

    /// The surface for which all points stand, in patches.
    pub(crate) fn area(&self) -> f64 {
        self.area.iter().map(|area| f64::from(*area)).sum()
    }

    /// A subset of approximately [`ROUGH_POINTS`] pixels with the same total weight where depth images have many; otherwise all
    /// points.
    pub(crate) fn subsampled(&self) -> &Self {
        self.fewer.as_deref().filter(|fewer| !fewer.points.is_empty()).unwrap_or(self)
    }

    fn clear(&mut self) {
        self.points.clear();
        self.weight.clear();
        self.area.clear();
        self.limb.clear();
        self.source.clear();
        self.cameras.clear();
    }

    /// Subsamples the pixels at a regular stride, and keeps all other points.
    fn thin(&mut self) {
        let mut fewer = self.fewer.take().unwrap_or_default();
        fewer.clear();
        let pixels = self.cameras.last().map_or(0, |(end, _)| *end as usize);
        let every = pixels / ROUGH_POINTS;
        if every > 1 {
            let mut start = 0;
            for (end, camera) in &self.cameras {
                (start..*end as usize).step_by(every).for_each(|index| fewer.take(self, index, every as f32));
                fewer.cameras.push((fewer.len() as u32, *camera));
                start = *end as usize;
            }
            (pixels..self.len()).for_each(|index| fewer.take(self, index, 1.0));
            fewer.clusters.arrange(&fewer.points);
        }
        self.fewer = Some(fewer);
    }

    /// Copies one point of `others`, with its weight multiplied by `times`.
    fn take(&mut self, others: &Self, index: usize, times: f32) {
        let Points { x, y, z } = &others.points;
        let point = [x[index], y[index], z[index]];
        let [weight, area] = [&others.weight, &others.area].map(|of| times * of[index]);
        self.push(point, [weight, area], others.limb[index], others.source[index]);
    }

    fn push(&mut self, point: [f32; 3], [weight, area]: [f32; 2], limb: u16, source: u16) {
        self.points.push(point);
        self.weight.push(weight);
        self.area.push(area);
        self.limb.push(limb);
        self.source.push(source);
    }

    /// Drops those points of one source, the last ones from `first` on, that lie inside the given boxes of the world.
    fn leave_out(&mut self, first: usize, boxes: &[Aabb], origin: Vec3) {
        if boxes.is_empty() {
            return;
        }
        let mut kept = first;
        for index in first..self.points.len() {
            let point = self.points.get(index) + origin;
            if !boxes.iter().any(|bounds| bounds.contains(point)) {
                let Points { x, y, z } = &self.points;
                self.points.set(kept, [x[index], y[index], z[index]]);
                kept += 1;
            }
        }
        // Weight, area, limb and source are the same for all of them.
        self.points.resize(kept);
        self.weight.truncate(kept);
        self.area.truncate(kept);
        self.limb.truncate(kept);
        self.source.truncate(kept);
    }

    fn gather_cloud(&mut self, cloud: &Cloud, origin: Vec3, gate: &PointGate, others: impl Fn(usize) -> bool) {
        let working_from_sensor = shifted(&cloud.world_from_sensor, origin);
        let (rotation, shift) = (Mat3::from_quat(working_from_sensor.rotation), working_from_sensor.translation);
        let limb = match cloud.scope {
            Scope::Limb(limb) => limb as u16,
            Scope::Free | Scope::Body => ANY_LIMB,
        };
        for index in 0..cloud.points.len() {
            let point = rotation * cloud.points.get(index) + shift;
            let point = point.as_vec3().to_array();
            if cloud.scope != Scope::Free || gate.passes(point) && !others(index) {
                self.push(point, [cloud.weight as f32; 2], limb, cloud.source);
            }
        }
    }

    fn gather_image(&mut self, view: &DepthView, bounds: &Aabb, gate: &PointGate, max_points: usize) {
        let DepthView { image, working_from_camera, .. } = *view;
        let [columns, rows] = image_window(image, &working_from_camera, bounds);
        let m = columns_f32(&working_from_camera);
        let points = &mut self.points;
        // A pixel represents a patch of surface: its size follows from the distance of the body.
        let distance = working_from_camera.inverse_transform_point(bounds.center()).length().max(NEAREST_BODY);
        let [fx, fy] = image.camera.focal();
        let patch = distance * distance / (fx * fy);
        let grid = Grid::new(VISIBLE_AREA / patch / max_points as f64);
        let area = patch * (grid.rows * grid.columns) as f64 / REFERENCE_PATCH;
        let stride = grid.columns;
        vectorized!({
            // The grid is fixed to the image: a box that moves takes the same pixels.
            for row in (rows.start.next_multiple_of(grid.rows)..rows.end).step_by(grid.rows) {
                let offset = grid.offset(row);
                let first = (columns.start + stride - offset).next_multiple_of(stride) - stride + offset;
                for start in (first..columns.end).step_by(STRETCH * stride) {
                    let stretch = Stretch::load(view, row, start..columns.end, stride);
                    if stretch.returned() {
                        stretch.gather(&m, gate, points);
                    }
                }
            }
        });
        let count = self.points.len();
        self.weight.resize(count, (image.weight * area) as f32);
        self.area.resize(count, area as f32);
        self.limb.resize(count, ANY_LIMB);
        self.source.resize(count, image.source);
    }
}

/// Least assumed distance of a body from its camera, meters, for computing the surface area that a pixel represents.
const NEAREST_BODY: f64 = 0.3;
/// Approximate area of a person that is visible to a camera, m^2; adjacent objects count as well.
const VISIBLE_AREA: f64 = 0.6;
/// A depth pixel that represents this much surface has weight one: 12 mm squared, a pixel of the papers' 160x124 time-of-flight
/// camera at 2.4 m. Finer pixels have less weight, coarser ones more: the resolution does not change the balance.
pub(crate) const REFERENCE_PATCH: f64 = 0.012 * 0.012;

/// Columns and rows that can show anything inside the box, see [`crate::Camera::window`].
pub(crate) fn image_window(
    image: &DepthImage,
    working_from_sensor: &Pose,
    bounds: &Aabb,
) -> [std::ops::Range<usize>; 2] {
    image.camera.window(bounds.corners().into_iter().map(|corner| working_from_sensor.inverse_transform_point(corner)))
}

/// Columns of the rotation, then the translation.
pub(super) fn columns_f32(pose: &Pose) -> [[f32; 3]; 4] {
    [pose.rotation * Vec3::X, pose.rotation * Vec3::Y, pose.rotation * Vec3::Z, pose.translation]
        .map(|column| column.as_vec3().to_array())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Quat;
    use crate::observation::background::{Background, Backgrounds};
    use crate::observation::frame::{Frame, Ground, PointSlice};
    use crate::testing::{everything, image, views};

    #[test]
    fn candidates_are_the_returns_in_the_box_above_the_floor_and_before_the_scene() {
        let wave = |index: usize| 2.0 + 0.8 * ((index * 37 % 101) as f32 / 101.0);
        let mut pixels: Vec<f32> = (0..40 * 30).map(wave).collect();
        pixels.iter_mut().step_by(7).for_each(|depth| *depth = 0.0);
        pixels[11] = f32::NAN;
        // The optical axis is the world's x axis, up is z.
        let rotation = Quat::from_mat3(&Mat3::from_cols(-Vec3::Y, -Vec3::Z, Vec3::X));
        let world_from_sensor = Pose::from_parts(Vec3::new(0.0, 0.3, 1.0), rotation);
        let images = [DepthImage { world_from_sensor, source: 3, ..image(&pixels, 40, 60.0) }];
        let ground = Some(Ground { normal: Vec3::Z, offset: 0.5 });
        let frame = Frame { images: &images, ground, ..Frame::empty(0.0) };
        let mut backgrounds = Backgrounds::default();
        // Everything farther than 2.6 m is scene.
        backgrounds.register(&frame);
        let depths = &mut backgrounds.of_image_mut(&images[0]).unwrap().depth;
        depths.iter_mut().zip(&pixels).for_each(|(depth, z)| *depth = 2.6 + 1e-6 * if *z > 0.0 { *z } else { 0.0 });
        let origin = Vec3::new(2.3, 0.0, 1.0);
        let bounds = Aabb::new(Vec3::new(-0.4, -0.3, -0.6), Vec3::new(0.4, 0.5, 0.4));
        let config = Config { max_points: 1_000_000, ..Config::default() };
        let mut found = Candidates::default();
        let views = DepthViews { frame: &frame, ownership: everything(&backgrounds), segmented: &[false], origin };
        found.gather(views, &bounds, &config);
        // The reference: one pixel after the other, in double precision.
        let expected: Vec<Vec3> = (0..pixels.len())
            .filter(|index| pixels[*index] > 0.0)
            .filter(|index| !Background::contains(2.6 + 1e-6 * pixels[*index], pixels[*index]))
            .map(|index| world_from_sensor * images[0].back_project(index, pixels[index]))
            .filter(|point| point.z >= 0.5 + config.ground_clearance)
            .map(|point| point - origin)
            .filter(|point| bounds.contains(*point))
            .collect();
        assert!(expected.len() > 100 && expected.len() < 700, "{}", expected.len());
        assert_eq!(found.len(), expected.len());
        for (index, point) in expected.iter().enumerate() {
            assert!((found.points.get(index) - *point).length() < 1e-5, "{index}: {point}");
        }
        assert!(found.limb.iter().all(|limb| *limb == ANY_LIMB) && found.source.iter().all(|source| *source == 3));
        assert_eq!(found.cameras, [(expected.len() as u32, world_from_sensor.translation - origin)]);
    }

    #[test]
    fn a_coarse_subset_has_fewer_pixels_that_weigh_as_much_and_all_other_points() {
        let mut all = Candidates::default();
        let pixels = 4 * ROUGH_POINTS;
        for index in 0..pixels {
            all.push([index as f32, 0.0, 2.0], [0.5; 2], ANY_LIMB, 1);
        }
        all.cameras = vec![(1000, Vec3::X), (pixels as u32, Vec3::Y)];
        (0..3).for_each(|index| all.push([index as f32, 1.0, 0.0], [2.0; 2], 7, 2));
        all.thin();
        let rough = all.subsampled();
        assert_eq!(rough.len(), ROUGH_POINTS + 3);
        assert_eq!(rough.weight.iter().sum::<f32>(), all.weight.iter().sum::<f32>());
        assert_eq!(rough.cameras, [(250, Vec3::X), (ROUGH_POINTS as u32, Vec3::Y)]);
        assert!((0..ROUGH_POINTS).all(|index| rough.points.x[index] == 4.0 * index as f32));
        assert_eq!((&rough.limb[ROUGH_POINTS..], &rough.source[ROUGH_POINTS..]), (&[7; 3][..], &[2; 3][..]));
        // A coarse image keeps all its points.
        all.cameras = vec![(2 * ROUGH_POINTS as u32 - 1, Vec3::X)];
        all.thin();
        assert_eq!(all.subsampled().len(), all.len());
    }

    #[test]
    fn what_is_known_to_be_on_the_body_passes_every_box() {
        let points = [[9.0, 9.0, 9.0], [0.1, 0.0, 0.0]];
        let cloud = |scope| Cloud {
            points: PointSlice::F64(&points),
            world_from_sensor: Pose::IDENTITY,
            weight: 2.0,
            scope,
            source: 0,
        };
        let bounds = Aabb::new(Vec3::splat(-1.0), Vec3::splat(1.0));
        for (scope, count, limb) in [(Scope::Free, 1, ANY_LIMB), (Scope::Body, 2, ANY_LIMB), (Scope::Limb(4), 2, 4)] {
            let clouds = [cloud(scope)];
            let frame = Frame { clouds: &clouds, ..Frame::empty(0.0) };
            let mut found = Candidates::default();
            found.gather(views(&frame, &Backgrounds::default()), &bounds, &Config::default());
            assert_eq!((found.len(), &found.limb[..]), (count, &vec![limb; count][..]), "{scope:?}");
            assert_eq!(found.weight, vec![2.0; count]);
        }
    }
}
