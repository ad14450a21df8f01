//! The content of a `Frame`, and what a step borrows from it: arrays of the caller, and names resolved in the body.

use std::sync::Arc;

use pyo3::prelude::*;
use voodoo_core::math::Pose;
use voodoo_core::{
    Body, Camera, Cloud, ColorImage, DepthImage, DetectedPerson, Frame, PositionRelation, RayRelation, Scope,
};

use crate::arrays::{ColorView, DepthView, PointView};
use crate::errors::raise;
use crate::frame::PyFrame;

/// Index of a name in a list, which it joins if it is new.
pub(crate) fn number(names: &mut Vec<String>, name: &str) -> u16 {
    let known = names.iter().position(|known| known == name);
    let number = known.unwrap_or_else(|| {
        names.push(name.to_owned());
        names.len() - 1
    });
    number as u16
}

/// A cloud, whose points are those of a [`PointView`] of the array, and the name of the limb that they are on.
pub(crate) type CloudData = (Py<PyAny>, Cloud<'static>, Option<String>);
/// A measured position, and the name of its site, whose index is not known yet.
pub(crate) type PositionData = (String, PositionRelation);
/// A ray, and the name of its site, whose index is not known yet.
pub(crate) type RayData = (String, RayRelation);

pub(crate) struct ImageData {
    /// An array for a [`DepthView`].
    pub pixels: Py<PyAny>,
    pub camera: Arc<Camera>,
    pub meters_per_unit: f64,
    pub world_from_sensor: Pose,
    pub weight: f64,
    pub source: u16,
}

pub(crate) struct ColorData {
    /// An array for a [`ColorView`].
    pub pixels: Py<PyAny>,
    pub camera: Arc<Camera>,
    pub world_from_sensor: Pose,
    pub stamp: f64,
    pub source: u16,
}

/// The depth images of a frame, and borrows of their arrays.
pub(crate) type DepthViews<'py, 'a> = Vec<(DepthView<'py>, &'a ImageData)>;
/// The color images of a frame, and borrows of their arrays.
pub(crate) type ColorViews<'py, 'a> = Vec<(ColorView<'py>, &'a ColorData)>;

/// The depth images of these views.
pub(crate) fn depth_images<'a>(views: &'a DepthViews) -> PyResult<Vec<DepthImage<'a>>> {
    let image = |(view, data): &'a (DepthView, &ImageData)| {
        let ImageData { ref camera, meters_per_unit, world_from_sensor, weight, source, .. } = **data;
        Ok(DepthImage { pixels: view.pixels()?, camera, meters_per_unit, world_from_sensor, weight, source })
    };
    views.iter().map(image).collect()
}

/// The color images of these views, of the cameras with these indices.
pub(crate) fn color_images<'a>(views: &'a ColorViews, cameras: &[u16]) -> PyResult<Vec<ColorImage<'a>>> {
    let image = |((view, data), number): (&'a (ColorView, &ColorData), &u16)| {
        let ColorData { ref camera, world_from_sensor, stamp, source, .. } = **data;
        Ok(ColorImage { pixels: view.pixels()?, camera, world_from_sensor, stamp, number: *number, source })
    };
    views.iter().zip(cameras).map(image).collect()
}

/// Everything a step borrows: the views keep the arrays alive and readable.
pub(crate) struct Borrowed<'py, 'a> {
    held: &'a PyFrame,
    clouds: Vec<(PointView<'py>, Cloud<'static>)>,
    images: DepthViews<'py, 'a>,
    colors: ColorViews<'py, 'a>,
    pub(crate) positions: Vec<PositionRelation>,
    pub(crate) rays: Vec<RayRelation>,
    detections: Vec<(Vec<PositionRelation>, f64)>,
}

impl<'py, 'a> Borrowed<'py, 'a> {
    /// Borrows the arrays of a frame and looks the names up in `body`. The frame's sources are numbered from `first`.
    pub(crate) fn new(py: Python<'py>, frame: &'a PyFrame, body: &Body, first: usize) -> PyResult<Self> {
        let first = first as u16;
        let index = |name: &str| body.site_index(name).map_err(raise);
        let cloud = |(points, cloud, limb): &'a CloudData| {
            let limb = limb.as_ref().map(|name| body.limb_index(name)).transpose().map_err(raise)?;
            let (scope, source) = (limb.map_or(cloud.scope, Scope::Limb), cloud.source + first);
            Ok((points.extract(py)?, Cloud { scope, source, ..*cloud }))
        };
        let position =
            |(name, of): &PositionData| Ok(PositionRelation { site: index(name)?, source: of.source + first, ..*of });
        let ray = |(name, of): &RayData| Ok(RayRelation { site: index(name)?, source: of.source + first, ..*of });
        let person = |(positions, person): &(Vec<PositionData>, f64)| {
            Ok((positions.iter().map(position).collect::<PyResult<_>>()?, *person))
        };
        let positions = frame.positions.iter().map(position).collect::<PyResult<_>>()?;
        let rays = frame.rays.iter().map(ray).collect::<PyResult<_>>()?;
        let clouds = frame.clouds.iter().map(cloud).collect::<PyResult<_>>()?;
        let detections = frame.detections.iter().map(person).collect::<PyResult<_>>()?;
        let (images, colors) = (frame.depth_views(py)?, frame.color_views(py)?);
        Ok(Self { held: frame, clouds, images, colors, positions, rays, detections })
    }

    pub(crate) fn clouds(&self) -> PyResult<Vec<Cloud<'_>>> {
        self.clouds.iter().map(|(view, cloud)| Ok(Cloud { points: view.points()?, ..*cloud })).collect()
    }

    /// What a function makes of the frame, whose color images are of the cameras with these indices.
    pub(crate) fn with_frame<T>(&self, cameras: &[u16], then: impl FnOnce(&Frame) -> PyResult<T>) -> PyResult<T> {
        let (clouds, images, colors) =
            (self.clouds()?, depth_images(&self.images)?, color_images(&self.colors, cameras)?);
        let detections = self.detections.iter();
        let detections: Vec<_> =
            detections.map(|(positions, person)| DetectedPerson { positions, person: *person }).collect();
        let frame = Frame {
            stamp: self.held.stamp,
            clouds: &clouds,
            images: &images,
            colors: &colors,
            positions: &self.positions,
            rays: &self.rays,
            detections: &detections,
            ground: self.held.ground,
            excluded: &self.held.excluded,
        };
        then(&frame)
    }
}
