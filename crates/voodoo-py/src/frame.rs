//! `Frame`: holds references to the caller's arrays until the step reads them.

use std::sync::Arc;

use numpy::{PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use voodoo_core::math::Aabb;
use voodoo_core::{Camera, Cloud, Ground, PointSlice, PositionRelation, RayRelation, Scope};

use crate::arguments;
use crate::arrays::{DEPTH_ARRAY, DepthView, Row, contiguous, picture, points, pose, unmasked, vector, viewable};
use crate::borrowed::{CloudData, ColorData, ColorViews, DepthViews, ImageData, PositionData, RayData, number};
use crate::camera::camera_of;
use crate::errors::{unless, warn, wrong_argument};
use crate::sites::PySiteRay;

#[doc = stub!("Frame")]
#[pyclass(name = "Frame", module = "voodoo")]
#[derive(Default)]
pub struct PyFrame {
    #[doc = stub!("Frame.stamp")]
    #[pyo3(get)]
    pub stamp: f64,
    pub(crate) clouds: Vec<CloudData>,
    pub(crate) images: Vec<ImageData>,
    pub(crate) colors: Vec<ColorData>,
    pub(crate) positions: Vec<PositionData>,
    pub(crate) rays: Vec<RayData>,
    /// Positions of the sites of persons who were found in this instant, and log odds.
    pub(crate) detections: Vec<(Vec<PositionData>, f64)>,
    pub(crate) ground: Option<Ground>,
    pub(crate) excluded: Vec<Aabb>,
    pub sources: Vec<String>,
}

impl PyFrame {
    /// Borrows the depth images.
    pub(crate) fn depth_views<'py>(&self, py: Python<'py>) -> PyResult<DepthViews<'py, '_>> {
        self.images.iter().map(|data| Ok((data.pixels.extract(py)?, data))).collect()
    }

    /// Borrows the color images.
    pub(crate) fn color_views<'py>(&self, py: Python<'py>) -> PyResult<ColorViews<'py, '_>> {
        self.colors.iter().map(|data| Ok((data.pixels.extract(py)?, data))).collect()
    }
}

#[pymethods]
impl PyFrame {
    #[new]
    fn new(#[pyo3(from_py_with = arguments::stamp)] stamp: f64) -> Self {
        Self { stamp, ..Self::default() }
    }

    #[doc = stub!("Frame.add_points")]
    #[pyo3(signature = (points, *, world_from_sensor=None, weight=1.0, limb=None, on_body=false, source="points"))]
    fn add_points(
        &mut self,
        points: &Bound<'_, PyAny>,
        world_from_sensor: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = arguments::weight)] weight: f64,
        limb: Option<String>,
        on_body: bool,
        source: &str,
    ) -> PyResult<()> {
        let array = self::points("points", points)?.unbind();
        let cloud = Cloud {
            points: PointSlice::F32(&[]),
            world_from_sensor: pose("world_from_sensor", world_from_sensor)?,
            weight,
            scope: if on_body { Scope::Body } else { Scope::Free },
            source: number(&mut self.sources, source),
        };
        self.clouds.push((array, cloud, limb));
        Ok(())
    }

    #[doc = stub!("Frame.add_depth")]
    #[pyo3(signature = (image, *, camera, meters_per_unit=0.001, world_from_sensor=None, weight=1.0, source="depth"))]
    fn add_depth(
        &mut self,
        image: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = camera_of)] camera: Arc<Camera>,
        #[pyo3(from_py_with = arguments::meters_per_unit)] meters_per_unit: f64,
        world_from_sensor: Option<&Bound<'_, PyAny>>,
        #[pyo3(from_py_with = arguments::weight)] weight: f64,
        source: &str,
    ) -> PyResult<()> {
        let [height, width] = [camera.height(), camera.width()];
        let wrong = |found: &Bound<'_, PyAny>| wrong_argument("image", DEPTH_ARRAY, found);
        let array = image.cast::<PyUntypedArray>().map_err(|_| wrong(&image.get_type()))?;
        unmasked("image", image, "fill it with 0, which is no return: image.filled(0)")?;
        let pixels = viewable::<DepthView>(image).ok_or_else(|| wrong(image))?;
        let expected = format_args!("{height} rows of {width} pixels, as its camera has");
        unless(array.shape() == [height, width], "image", expected, format_args!("shape {:?}", array.shape()))?;
        let unlikely = implausible_depth(&pixels, meters_per_unit)?.is_some();
        let data = ImageData {
            pixels: pixels.unbind(),
            camera,
            meters_per_unit,
            world_from_sensor: pose("world_from_sensor", world_from_sensor)?,
            weight,
            source: number(&mut self.sources, source),
        };
        self.images.push(data);
        if unlikely { warn_of_unit(image.py(), source, meters_per_unit) } else { Ok(()) }
    }

    #[doc = stub!("Frame.add_color")]
    #[pyo3(signature = (image, *, camera, world_from_sensor=None, stamp=None, source="color"))]
    fn add_color(
        &mut self,
        image: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = camera_of)] camera: Arc<Camera>,
        world_from_sensor: Option<&Bound<'_, PyAny>>,
        stamp: Option<&Bound<'_, PyAny>>,
        source: &str,
    ) -> PyResult<()> {
        let [height, width] = [camera.height(), camera.width()];
        let expected = format!("an array of shape ({height}, {width}, 3) or ({height}, {width}) and dtype uint8");
        unmasked("image", image, "fill it: image.filled(0)")?;
        let (pixels, _) = picture(image)
            .filter(|(_, found)| *found == [height, width])
            .ok_or_else(|| wrong_argument("image", &expected, image))?;
        let data = ColorData {
            pixels: pixels.unbind(),
            camera,
            world_from_sensor: pose("world_from_sensor", world_from_sensor)?,
            stamp: stamp.map_or(Ok(self.stamp), arguments::stamp)?,
            source: number(&mut self.sources, source),
        };
        self.colors.push(data);
        Ok(())
    }

    #[doc = stub!("Frame.add_position")]
    #[pyo3(signature = (site, position, *, weight=1.0, bias=0.0, source="positions"))]
    fn add_position(
        &mut self,
        #[pyo3(from_py_with = arguments::site)] site: String,
        position: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::weight)] weight: f64,
        #[pyo3(from_py_with = arguments::bias)] bias: f64,
        source: &str,
    ) -> PyResult<()> {
        let (position, source) = (vector("position", position)?, number(&mut self.sources, source));
        self.positions.push((site, PositionRelation { site: 0, position, weight, bias, source }));
        Ok(())
    }

    #[doc = stub!("Frame.add_ray")]
    #[pyo3(signature = (site, *, origin, direction, weight=1.0, bias=0.0, source="rays"))]
    fn add_ray(
        &mut self,
        #[pyo3(from_py_with = arguments::site)] site: String,
        origin: &Bound<'_, PyAny>,
        direction: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::weight)] weight: f64,
        #[pyo3(from_py_with = arguments::bias)] bias: f64,
        source: &str,
    ) -> PyResult<()> {
        let (origin, direction) = (vector("origin", origin)?, vector("direction", direction)?);
        let source = number(&mut self.sources, source);
        self.rays.push((site, RayRelation { site: 0, origin, direction, weight, bias, source }));
        Ok(())
    }

    #[doc = stub!("Frame.add_detection")]
    #[pyo3(signature = (joints, *, log_odds=f64::INFINITY, weight=1.0, source="detections"))]
    fn add_detection(
        &mut self,
        joints: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::log_odds)] log_odds: f64,
        #[pyo3(from_py_with = arguments::weight)] weight: f64,
        source: &str,
    ) -> PyResult<()> {
        let pairs = joints.py().get_type::<PyDict>().call1((joints,));
        let pairs = pairs.ok().and_then(|pairs| pairs.cast_into::<PyDict>().ok());
        let pairs = pairs.ok_or_else(|| wrong_argument("joints", "a mapping from names to positions", joints))?;
        let position = |(name, position): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
            let site = arguments::site(&name)?;
            let position = vector(&format!("joints[{site}]"), &position)?;
            Ok((site, PositionRelation { site: 0, position, weight, bias: 0.0, source: 0 }))
        };
        let mut positions = pairs.iter().map(position).collect::<PyResult<Vec<_>>>()?;
        let source = number(&mut self.sources, source);
        positions.iter_mut().for_each(|(_, of)| of.source = source);
        self.detections.push((positions, log_odds));
        Ok(())
    }

    /// Mean distance of the measured positions and rays from the predicted positions of their sites, meters; infinite without any.
    fn _distance(&self, sites: &Bound<'_, PyDict>) -> PyResult<f64> {
        let positions = self.positions.iter().map(|(site, of)| (site, of.position, None));
        let rays = self.rays.iter().map(|(site, of)| (site, of.origin, of.direction.try_normalize()));
        let (mut sum, mut count) = (0.0, 0);
        for (site, start, along) in positions.chain(rays) {
            if let Some(place) = sites.get_item(site)? {
                let away = vector(site, &place)? - start;
                sum += along.map_or(away, |along| away.reject_from_normalized(along)).length();
                count += 1;
            }
        }
        Ok(if count == 0 { f64::INFINITY } else { sum / f64::from(count) })
    }

    /// Adds the rays with sufficient trust, weighted by their standard deviations; returns their number.
    #[pyo3(signature = (rays, *, reference_sigma, max_weight, min_trust))]
    fn _add_site_rays(
        &mut self,
        rays: Vec<PyRef<'_, PySiteRay>>,
        reference_sigma: f64,
        max_weight: f64,
        min_trust: f64,
    ) -> PyResult<usize> {
        let used = || rays.iter().filter(|ray| ray.trust >= min_trust);
        let weights = used().map(|ray| {
            let weight = |sigma: f64| {
                unless(sigma > 0.0 && sigma.is_finite(), "sigma", "finite meters > 0", sigma)?;
                Ok::<_, PyErr>((reference_sigma / sigma).powi(2).min(max_weight) * ray.trust)
            };
            Ok([ray.place.as_ref().map_or(Ok(0.0), |_| weight(ray.place_sigma))?, weight(ray.sigma)?])
        });
        let weights: Vec<[f64; 2]> = weights.collect::<PyResult<_>>()?;
        for (ray, [of_place, weight]) in used().zip(&weights) {
            let (site, source, bias) = (ray.site.clone(), number(&mut self.sources, &ray.source), ray.bias);
            let (origin, direction) = (ray.origin.0, ray.direction.0);
            if let Some(Row(position)) = ray.place {
                let of = PositionRelation { site: 0, position, weight: *of_place, bias, source };
                self.positions.push((site.clone(), of));
            }
            self.rays.push((site, RayRelation { site: 0, origin, direction, weight: *weight, bias, source }));
        }
        Ok(weights.len())
    }

    #[doc = stub!("Frame.set_ground")]
    #[pyo3(signature = (*, normal, offset=0.0))]
    fn set_ground(
        &mut self,
        normal: &Bound<'_, PyAny>,
        #[pyo3(from_py_with = arguments::offset)] offset: f64,
    ) -> PyResult<()> {
        self.ground = Some(Ground { normal: vector("normal", normal)?, offset });
        Ok(())
    }

    #[doc = stub!("Frame.exclude")]
    fn exclude(&mut self, low: &Bound<'_, PyAny>, high: &Bound<'_, PyAny>) -> PyResult<()> {
        self.excluded.push(Aabb { mins: vector("low", low)?, maxs: vector("high", high)? });
        Ok(())
    }

    fn __repr__(&self) -> String {
        format!(
            "Frame(stamp={}, clouds={}, depth_images={}, colors={}, sites={}, detections={}, sources={:?})",
            self.stamp,
            self.clouds.len(),
            self.images.len(),
            self.colors.len(),
            self.positions.len() + self.rays.len(),
            self.detections.len(),
            self.sources
        )
    }
}

#[doc = stub!("implausible_depth")]
#[pyfunction]
pub(crate) fn implausible_depth(image: &Bound<'_, PyAny>, meters_per_unit: f64) -> PyResult<Option<f64>> {
    let view = contiguous(image).and_then(|array| array.extract::<DepthView>());
    let view = view.map_err(|_| wrong_argument("image", DEPTH_ARRAY, image))?;
    Ok(view.pixels()?.implausible_depth(meters_per_unit))
}

/// The words are the same in every frame: Python shows them once.
fn warn_of_unit(py: Python<'_>, source: &str, unit: f64) -> PyResult<()> {
    let text = format!(
        "{source}: expected depths of meters, found a median below 1 cm or beyond 100 m with meters_per_unit={unit}, \
         which is 0.001 for an image in millimeters and 1.0 for one in meters"
    );
    warn(py, "UnitWarning", text, 1)
}
