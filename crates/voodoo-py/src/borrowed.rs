//! The content of a `Frame`, and what a step borrows from it: arrays of the caller, and names resolved in the body.

use std::sync::Arc;

use numpy::{PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::{Body, Camera};
use voodoo_core::{
    Cloud, DepthImage, DepthPixels, DetectedPerson, Frame, Ground, PositionRelation, RayRelation, Scope,
};
use voodoo_core::{ColorImage, ColorPixels};

use crate::arrays::{PointArray, PointView, contiguous};
use crate::errors::IntoPy;
use crate::frame::PyFrame;

pub(crate) struct CloudData {
    pub points: PointArray,
    pub world_from_sensor: Pose,
    pub weight: f64,
    pub limb: Option<String>,
    pub on_body: bool,
    pub source: u16,
}

pub(crate) enum DepthArray {
    U16(Py<PyArray2<u16>>),
    F32(Py<PyArray2<f32>>),
}

enum BorrowedPixels<'py> {
    U16(PyReadonlyArray2<'py, u16>),
    F32(PyReadonlyArray2<'py, f32>),
}

pub(crate) struct ImageData {
    pub pixels: DepthArray,
    pub camera: Arc<Camera>,
    pub meters_per_unit: f64,
    pub world_from_sensor: Pose,
    pub weight: f64,
    pub source: u16,
}

/// An image as passed by the caller: color or gray.
pub enum ColorArray {
    Color(Py<PyArray3<u8>>),
    Gray(Py<PyArray2<u8>>),
}

/// A borrow of a [`ColorArray`].
pub enum ColorPixelView<'py> {
    Color(PyReadonlyArray3<'py, u8>),
    Gray(PyReadonlyArray2<'py, u8>),
}

pub struct ColorData {
    pub pixels: ColorArray,
    pub camera: Arc<Camera>,
    pub world_from_sensor: Pose,
    pub stamp: f64,
    pub source: u16,
}

/// A borrow of a [`ColorData`].
pub struct ColorView<'py, 'a> {
    pixels: ColorPixelView<'py>,
    pub data: &'a ColorData,
}

impl ColorArray {
    /// Takes a contiguous array of shape (height, width, 3) or (height, width) and dtype uint8; none of another kind.
    pub fn new(image: &Bound<'_, PyAny>) -> Option<(Self, [usize; 2])> {
        let array = contiguous(image).ok()?;
        if let Ok(array) = array.cast::<PyArray3<u8>>() {
            let shape = array.shape();
            return (shape[2] == 3).then(|| (Self::Color(array.clone().unbind()), [shape[0], shape[1]]));
        }
        let array = array.cast::<PyArray2<u8>>().ok()?;
        Some((Self::Gray(array.clone().unbind()), [array.shape()[0], array.shape()[1]]))
    }

    pub fn view<'py>(&self, py: Python<'py>) -> ColorPixelView<'py> {
        match self {
            Self::Color(array) => ColorPixelView::Color(array.bind(py).readonly()),
            Self::Gray(array) => ColorPixelView::Gray(array.bind(py).readonly()),
        }
    }
}

impl ColorPixelView<'_> {
    pub fn pixels(&self) -> PyResult<ColorPixels<'_>> {
        Ok(match self {
            Self::Color(view) => ColorPixels::Color(view.as_slice()?.as_chunks().0),
            Self::Gray(view) => ColorPixels::Gray(view.as_slice()?),
        })
    }
}

impl ColorData {
    pub fn view<'py>(&self, py: Python<'py>) -> ColorView<'py, '_> {
        ColorView { pixels: self.pixels.view(py), data: self }
    }
}

impl ColorView<'_, '_> {
    /// The image as one of the camera with this index.
    pub fn image(&self, number: u16) -> PyResult<ColorImage<'_>> {
        let ColorData { ref camera, world_from_sensor, stamp, source, .. } = *self.data;
        Ok(ColorImage { pixels: self.pixels.pixels()?, camera, world_from_sensor, stamp, number, source })
    }
}

pub(crate) struct SiteData {
    pub site: String,
    pub position: Vec3,
    pub direction: Option<Vec3>,
    pub weight: f64,
    pub bias: f64,
    pub source: u16,
}

impl SiteData {
    /// The measured position, of the site with this index.
    fn relation(&self, site: usize) -> PositionRelation {
        let Self { position, weight, bias, source, .. } = *self;
        PositionRelation { site, position, weight, bias, source }
    }
}

/// A person who was found in this instant: positions of sites, and log odds.
pub(crate) struct PersonData {
    pub positions: Vec<SiteData>,
    pub person: f64,
}

/// Everything a step borrows: the views keep the arrays alive and readable.
pub struct Borrowed<'py> {
    clouds: Vec<(PointView<'py>, Pose, f64, Scope, u16)>,
    images: Vec<ImageView<'py>>,
    pub positions: Vec<PositionRelation>,
    pub rays: Vec<RayRelation>,
    detections: Vec<(Vec<PositionRelation>, f64)>,
    pub ground: Option<Ground>,
}

/// A depth image, and its array and camera.
struct ImageView<'py> {
    pixels: BorrowedPixels<'py>,
    camera: Arc<Camera>,
    meters_per_unit: f64,
    world_from_sensor: Pose,
    weight: f64,
    source: u16,
}

impl Borrowed<'_> {
    pub fn clouds(&self) -> PyResult<Vec<Cloud<'_>>> {
        self.clouds
            .iter()
            .map(|(view, world_from_sensor, weight, scope, source)| {
                Ok(Cloud {
                    points: view.slice()?,
                    world_from_sensor: *world_from_sensor,
                    weight: *weight,
                    scope: *scope,
                    source: *source,
                })
            })
            .collect()
    }

    /// The frame of these views and of what was borrowed with them from `held`.
    pub fn frame<'a>(
        &'a self,
        held: &'a PyFrame,
        clouds: &'a [Cloud<'a>],
        images: &'a [DepthImage<'a>],
        colors: &'a [ColorImage<'a>],
        detections: &'a [DetectedPerson<'a>],
    ) -> Frame<'a> {
        Frame::empty(held.stamp)
            .with_clouds(clouds)
            .with_images(images)
            .with_colors(colors)
            .with_positions(&self.positions)
            .with_rays(&self.rays)
            .with_detections(detections)
            .with_ground(self.ground)
            .with_excluded(&held.excluded)
    }

    /// The detected persons.
    pub fn detections(&self) -> Vec<DetectedPerson<'_>> {
        self.detections.iter().map(|(positions, person)| DetectedPerson { positions, person: *person }).collect()
    }

    pub fn images(&self) -> PyResult<Vec<DepthImage<'_>>> {
        self.images
            .iter()
            .map(|image| {
                let pixels = match &image.pixels {
                    BorrowedPixels::U16(view) => DepthPixels::U16(view.as_slice()?),
                    BorrowedPixels::F32(view) => DepthPixels::F32(view.as_slice()?),
                };
                let ImageView { ref camera, meters_per_unit, world_from_sensor, weight, source, .. } = *image;
                Ok(DepthImage { pixels, camera, meters_per_unit, world_from_sensor, weight, source })
            })
            .collect()
    }
}

/// The content of a `Frame`.
#[derive(Clone, Copy)]
pub(crate) struct Held<'a> {
    pub clouds: &'a [CloudData],
    pub images: &'a [ImageData],
    pub sites: &'a [SiteData],
    pub detections: &'a [PersonData],
    pub ground: Option<Ground>,
}

impl Held<'_> {
    /// Borrows the arrays and looks the names up in `body`.
    pub(crate) fn borrow_for<'py>(self, py: Python<'py>, body: &Body) -> PyResult<Borrowed<'py>> {
        let clouds = self
            .clouds
            .iter()
            .map(|cloud| {
                let scope = match &cloud.limb {
                    Some(name) => Scope::Limb(body.limb_index(name).map_err(|error| error.into_py(py))?),
                    None if cloud.on_body => Scope::Body,
                    None => Scope::Free,
                };
                Ok((cloud.points.view(py), cloud.world_from_sensor, cloud.weight, scope, cloud.source))
            })
            .collect::<PyResult<_>>()?;
        let images = self
            .images
            .iter()
            .map(|image| {
                let pixels = match &image.pixels {
                    DepthArray::U16(array) => BorrowedPixels::U16(array.bind(py).readonly()),
                    DepthArray::F32(array) => BorrowedPixels::F32(array.bind(py).readonly()),
                };
                ImageView {
                    pixels,
                    camera: Arc::clone(&image.camera),
                    meters_per_unit: image.meters_per_unit,
                    world_from_sensor: image.world_from_sensor,
                    weight: image.weight,
                    source: image.source,
                }
            })
            .collect();
        let (mut positions, mut rays) = (Vec::new(), Vec::new());
        let index = |data: &SiteData| body.site_index(&data.site).map_err(|error| error.into_py(py));
        for data in self.sites {
            let site = index(data)?;
            match data.direction {
                None => positions.push(data.relation(site)),
                Some(direction) => rays.push(RayRelation {
                    site,
                    origin: data.position,
                    direction,
                    weight: data.weight,
                    bias: data.bias,
                    source: data.source,
                }),
            }
        }
        let person = |data: &PersonData| {
            let positions = data.positions.iter().map(|data| Ok(data.relation(index(data)?)));
            Ok((positions.collect::<PyResult<_>>()?, data.person))
        };
        let detections = self.detections.iter().map(person).collect::<PyResult<_>>()?;
        Ok(Borrowed { clouds, images, positions, rays, detections, ground: self.ground })
    }
}

/// The measurements of a person, together with the common ones.
pub(crate) struct Parts<'a> {
    clouds: Vec<Cloud<'a>>,
    positions: Vec<PositionRelation>,
    rays: Vec<RayRelation>,
}

impl<'a> Parts<'a> {
    /// `first` is the index of the first source of the person's own measurements.
    pub(crate) fn new(all: &Frame<'a>, own: &'a Borrowed<'_>, first: u16) -> PyResult<Self> {
        let clouds = own.clouds()?.into_iter().map(|cloud| Cloud { source: cloud.source + first, ..cloud });
        let positions =
            own.positions.iter().map(|relation| PositionRelation { source: relation.source + first, ..*relation });
        let rays = own.rays.iter().map(|relation| RayRelation { source: relation.source + first, ..*relation });
        Ok(Self {
            clouds: all.clouds.iter().copied().chain(clouds).collect(),
            positions: all.positions.iter().copied().chain(positions).collect(),
            rays: all.rays.iter().copied().chain(rays).collect(),
        })
    }

    pub(crate) fn frame<'b>(&'b self, all: &Frame<'b>, stamp: f64) -> Frame<'b> {
        let own = all.with_clouds(&self.clouds).with_positions(&self.positions).with_rays(&self.rays);
        let mut frame = own.with_colors(&[]);
        frame.stamp = stamp;
        frame
    }
}
