//! What a `Frame` holds, and what a step borrows of it: arrays of the caller, names looked up in the body.

use numpy::{PyArray2, PyArray3, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3};
use pyo3::prelude::*;
use voodoo_core::Body;
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::observation::frame::{
    Cloud, ColorImage, DepthImage, DepthPixels, Ground, PositionRelation, RayRelation, Scope,
};

use crate::arrays::{PointArray, PointView};
use crate::errors::IntoPy;

pub struct CloudData {
    pub points: PointArray,
    pub world_from_sensor: Pose,
    pub weight: f64,
    pub limb: Option<String>,
    pub on_body: bool,
    pub source: u16,
}

pub enum DepthArray {
    U16(Py<PyArray2<u16>>),
    F32(Py<PyArray2<f32>>),
}

enum BorrowedPixels<'py> {
    U16(PyReadonlyArray2<'py, u16>),
    F32(PyReadonlyArray2<'py, f32>),
}

pub struct ImageData {
    pub pixels: DepthArray,
    pub size: [usize; 2],
    pub metres_per_unit: f64,
    pub intrinsics: [f64; 4],
    pub rays: Option<Py<PyArray3<f32>>>,
    pub world_from_sensor: Pose,
    pub weight: f64,
    pub source: u16,
}

pub struct ColorData {
    pub pixels: Py<PyArray3<u8>>,
    pub size: [usize; 2],
    pub intrinsics: [f64; 4],
    pub world_from_sensor: Pose,
}

/// A borrow of a [`ColorData`].
pub struct ColorView<'py, 'a> {
    pixels: PyReadonlyArray3<'py, u8>,
    data: &'a ColorData,
}

impl ColorData {
    pub fn view<'py>(&self, py: Python<'py>) -> ColorView<'py, '_> {
        ColorView { pixels: self.pixels.bind(py).readonly(), data: self }
    }
}

impl ColorView<'_, '_> {
    pub fn image(&self) -> PyResult<ColorImage<'_>> {
        let ColorData { size: [height, width], intrinsics, world_from_sensor, .. } = *self.data;
        Ok(ColorImage { pixels: self.pixels.as_slice()?.as_chunks().0, width, height, intrinsics, world_from_sensor })
    }
}

pub struct SiteData {
    pub site: String,
    pub position: Vec3,
    pub direction: Option<Vec3>,
    pub weight: f64,
    pub bias: f64,
    pub source: u16,
}

/// Everything a step borrows: the views keep the arrays alive and readable.
pub struct Borrowed<'py> {
    clouds: Vec<(PointView<'py>, Pose, f64, Scope, u16)>,
    images: Vec<ImageView<'py>>,
    pub positions: Vec<PositionRelation>,
    pub rays: Vec<RayRelation>,
    pub ground: Option<Ground>,
}

/// Pixels, rays, and the image with everything that is no array.
type ImageView<'py> = (BorrowedPixels<'py>, Option<PyReadonlyArray3<'py, f32>>, DepthImage<'static>);

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

    pub fn images(&self) -> PyResult<Vec<DepthImage<'_>>> {
        self.images
            .iter()
            .map(|(pixels, rays, image)| {
                let pixels = match pixels {
                    BorrowedPixels::U16(view) => DepthPixels::U16(view.as_slice()?),
                    BorrowedPixels::F32(view) => DepthPixels::F32(view.as_slice()?),
                };
                let rays = match rays {
                    Some(view) => Some(view.as_slice()?.as_chunks().0),
                    None => None,
                };
                Ok(DepthImage { pixels, rays, ..*image })
            })
            .collect()
    }
}

/// What a `Frame` holds.
#[derive(Clone, Copy)]
pub struct Held<'a> {
    pub clouds: &'a [CloudData],
    pub images: &'a [ImageData],
    pub sites: &'a [SiteData],
    pub ground: Option<Ground>,
}

impl Held<'_> {
    /// Borrows the arrays and looks the names up in `body`.
    pub fn borrow_for<'py>(self, py: Python<'py>, body: &Body) -> PyResult<Borrowed<'py>> {
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
                let rays = image.rays.as_ref().map(|rays| rays.bind(py).readonly());
                let [height, width] = image.size;
                let plain = DepthImage {
                    pixels: DepthPixels::U16(&[]),
                    width,
                    height,
                    metres_per_unit: image.metres_per_unit,
                    intrinsics: image.intrinsics,
                    rays: None,
                    world_from_sensor: image.world_from_sensor,
                    weight: image.weight,
                    source: image.source,
                };
                (pixels, rays, plain)
            })
            .collect();
        let (mut positions, mut rays) = (Vec::new(), Vec::new());
        for data in self.sites {
            let site = body.site_index(&data.site).map_err(|error| error.into_py(py))?;
            match data.direction {
                None => positions.push(PositionRelation {
                    site,
                    position: data.position,
                    weight: data.weight,
                    bias: data.bias,
                    source: data.source,
                }),
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
        Ok(Borrowed { clouds, images, positions, rays, ground: self.ground })
    }
}
