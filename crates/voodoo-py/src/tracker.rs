//! `Tracker`.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use voodoo_core::math::{Pose, Vec3};
use voodoo_core::{Body, Frame, RegionLine, TrackError, Tracker};

use crate::arrays::{ColorView, PointView, limb_poses, picture, points, vectors};
use crate::body::{JointParts, PyBody, joint};
use crate::borrowed::{Borrowed, ColorData, color_images, number};
use crate::config::config;
use crate::detector::{detector, warn_of_detector};
use crate::errors::{raise, wrong_argument};
use crate::estimate::{Names, PyEstimate};
use crate::frame::PyFrame;
use crate::people::TrackedBody;
use crate::shape::PyShape;

#[doc = stub!("Tracker")]
#[pyclass(name = "Tracker", module = "voodoo._core")]
pub struct PyTracker {
    pub tracker: Tracker,
    names: Arc<Names>,
    sources: Vec<String>,
    /// Names of the cameras of color images, in the order of their indices.
    cameras: Vec<String>,
    /// Number of steps in which the detector failed.
    detector_failures: usize,
}

/// Names and positions of sites.
pub(crate) type SitePositions = Vec<(String, [f64; 3])>;

/// Positions with the indices of their sites.
pub(crate) fn site_positions(body: &Body, joints: &SitePositions) -> PyResult<Vec<(usize, Vec3)>> {
    let place = |(name, position): &(String, [f64; 3])| {
        Ok((body.site_index(name).map_err(raise)?, Vec3::from_array(*position)))
    };
    joints.iter().map(place).collect()
}

#[doc = stub!("body_before")]
#[pyfunction]
pub(crate) fn body_before<'py>(
    tracker: TrackedBody<'py>,
    sites: PyReadonlyArray2<'py, f64>,
    camera: [f64; 3],
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let found = tracker.tracker()?.body_before(&vectors("sites", &sites)?, Vec3::from_array(camera));
    Ok(PyArray1::from_vec(sites.py(), found.map_err(raise)?))
}

impl PyTracker {
    /// Indices of the cameras of a frame's color images; a camera is identified by its name.
    fn cameras_of(&mut self, frame: &PyFrame) -> Vec<u16> {
        let camera = |data: &ColorData| number(&mut self.cameras, &frame.sources[usize::from(data.source)]);
        frame.colors.iter().map(camera).collect()
    }

    /// What the tracker makes of a frame's color images at given poses; releases the GIL.
    fn ask<T: Send>(
        &mut self,
        py: Python<'_>,
        frame: &PyFrame,
        poses: Option<Vec<Bound<'_, PyAny>>>,
        question: impl FnOnce(&mut Tracker, &Frame, Option<&[Pose]>) -> Result<T, TrackError> + Send,
    ) -> PyResult<T> {
        let poses = poses.map(|poses| limb_poses(self.tracker.body(), &poses)).transpose()?;
        let (cameras, views) = (self.cameras_of(frame), frame.color_views(py)?);
        let colors = color_images(&views, &cameras)?;
        let input = Frame { colors: &colors, ..Frame::empty(frame.stamp) };
        let tracker = &mut self.tracker;
        py.detach(|| question(tracker, &input, poses.as_deref())).map_err(raise)
    }

    fn body_changed(&mut self, py: Python<'_>) -> PyResult<()> {
        self.names = Arc::new(Names::from_body(py, self.tracker.body())?);
        Ok(())
    }
}

#[pymethods]
impl PyTracker {
    #[new]
    fn new(body: &PyBody, values: &Bound<'_, PyDict>, detector: &Bound<'_, PyAny>) -> PyResult<Self> {
        let mut tracker = Tracker::new(body.0.clone(), config(values)?).map_err(raise)?;
        if let Some(found) = self::detector(detector)? {
            tracker = tracker.with_detector(found);
        }
        let names = Arc::new(Names::from_body(values.py(), tracker.body())?);
        Ok(Self { tracker, names, sources: Vec::new(), cameras: Vec::new(), detector_failures: 0 })
    }

    fn _body(&self) -> PyBody {
        PyBody(self.tracker.body().clone())
    }

    #[getter]
    fn estimate(&self) -> PyEstimate {
        PyEstimate {
            estimate: self.tracker.estimate().clone(),
            names: self.names.clone(),
            sources: self.sources.clone(),
        }
    }

    #[pyo3(signature = (joints, *, fit_sizes=true))]
    fn _reset(&mut self, py: Python<'_>, joints: SitePositions, fit_sizes: bool) -> PyResult<PyEstimate> {
        let positions = site_positions(self.tracker.body(), &joints)?;
        self.tracker.reset(&positions, fit_sizes).map_err(raise)?;
        self.body_changed(py)?;
        self.sources.clear();
        Ok(self.estimate())
    }

    fn _reset_pose(&mut self, world_from_limb: Vec<Bound<'_, PyAny>>) -> PyResult<PyEstimate> {
        let poses = limb_poses(self.tracker.body(), &world_from_limb)?;
        self.tracker.reset_pose(&poses).map_err(raise)?;
        self.sources.clear();
        Ok(self.estimate())
    }

    /// Whether the tracker searches for a person while there is no pose.
    #[getter]
    fn can_search(&self) -> bool {
        self.tracker.can_search()
    }

    /// Why a detected person is not tracked.
    #[getter]
    fn refusal(&self) -> Option<String> {
        self.tracker.refusal().map(|refusal| refusal.to_string())
    }

    #[getter]
    fn detector_failures(&self) -> usize {
        self.detector_failures
    }

    /// Processes one frame; releases the GIL.
    fn step(&mut self, py: Python<'_>, frame: &PyFrame) -> PyResult<PyEstimate> {
        let borrowed = Borrowed::new(py, frame, self.tracker.body(), 0)?;
        let cameras = self.cameras_of(frame);
        let tracker = &mut self.tracker;
        borrowed.with_frame(&cameras, |input| py.detach(|| tracker.step(input).map(|_| ())).map_err(raise))?;
        self.sources.clone_from(&frame.sources);
        warn_of_detector(py, self.tracker.detector_error(), &mut self.detector_failures)?;
        Ok(self.estimate())
    }

    /// Sets images of the empty scene of the camera with this name; an empty list discards them.
    fn _set_background(&mut self, source: &str, images: Vec<Bound<'_, PyAny>>) -> PyResult<()> {
        let mut views = Vec::with_capacity(images.len());
        for (index, image) in images.iter().enumerate() {
            let expected = "an array of shape (height, width, 3) or (height, width) and dtype uint8";
            let wrong = || wrong_argument(&format!("images[{index}]"), expected, image);
            let (pixels, size) = picture(image).ok_or_else(wrong)?;
            views.push((pixels.extract::<ColorView>()?, size));
        }
        let pixels = views.iter().map(|(view, size)| Ok((view.pixels()?, *size))).collect::<PyResult<Vec<_>>>()?;
        let camera = number(&mut self.cameras, source);
        self.tracker.set_background(camera, &pixels).map_err(raise)
    }

    /// Probability of each pixel of a frame's images to show the body at given poses: name of the camera -> (height, width).
    #[pyo3(signature = (frame, poses=None))]
    fn _segment<'py>(
        &mut self,
        py: Python<'py>,
        frame: &PyFrame,
        poses: Option<Vec<Bound<'py, PyAny>>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let found = self.ask(py, frame, poses, |tracker, input, poses| tracker.segment(input, poses))?;
        let likely = PyDict::new(py);
        for (pixels, ColorData { camera, source, .. }) in found.into_iter().zip(&frame.colors) {
            let pixels = PyArray1::from_vec(py, pixels).reshape([camera.height(), camera.width()])?;
            likely.set_item(&frame.sources[usize::from(*source)], pixels)?;
        }
        Ok(likely)
    }

    /// Learns the body's colors from a frame's images at given poses.
    #[pyo3(signature = (frame, poses=None))]
    fn _learn_colors<'py>(
        &mut self,
        py: Python<'py>,
        frame: &PyFrame,
        poses: Option<Vec<Bound<'py, PyAny>>>,
    ) -> PyResult<()> {
        self.ask(py, frame, poses, |tracker, input, poses| tracker.learn_colors(input, poses))
    }

    /// The contour lines of the last step in the images of a camera: limb, pixel (2), outward normal (2), offset, sigma, row by
    /// row.
    fn _region_lines<'py>(&self, py: Python<'py>, source: &str) -> Bound<'py, PyArray1<f32>> {
        let camera = self.cameras.iter().position(|known| known == source);
        let lines = camera.into_iter().flat_map(|camera| self.tracker.region_lines(camera as u16));
        let row = |line: RegionLine| {
            let ([u, v], [nu, nv]) = (line.place, line.normal);
            [line.limb as f32, u, v, nu, nv, line.offset, line.sigma]
        };
        PyArray1::from_vec(py, lines.flat_map(row).collect())
    }

    /// Signed distance of world points `(N, 3)` to the posed body, meters, negative inside.
    fn distance<'py>(&self, py: Python<'py>, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let view: PointView = self::points("points", points)?.extract()?;
        let slice = view.points()?;
        let distances = py.detach(|| self.tracker.distance(slice)).map_err(raise)?;
        Ok(PyArray1::from_vec(py, distances))
    }

    /// Signed distances `(limbs, N)` of world points `(N, 3)` to every limb of the posed body, meters, negative inside.
    fn limb_distances<'py>(&self, py: Python<'py>, points: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let view: PointView = self::points("points", points)?.extract()?;
        let slice = view.points()?;
        let distances = py.detach(|| self.tracker.limb_distances(slice)).map_err(raise)?;
        Ok(PyArray2::from_vec2(py, &distances)?)
    }

    fn scale(&mut self, factor: f64) -> PyResult<()> {
        self.tracker.scale(factor).map_err(raise)
    }

    fn set_shape(&mut self, limb: &str, shape: &PyShape) -> PyResult<()> {
        self.tracker.set_shape(limb, shape.0).map_err(raise)
    }

    fn _add_limb(
        &mut self,
        py: Python<'_>,
        name: &str,
        parent: &str,
        shape: &PyShape,
        parts: JointParts,
        sites: SitePositions,
    ) -> PyResult<()> {
        let sites = sites.into_iter().map(|(name, position)| (name, Vec3::from_array(position))).collect();
        self.tracker.add_limb(name, parent, shape.0, joint(parts), sites).map_err(raise)?;
        self.body_changed(py)
    }

    fn remove_limb(&mut self, py: Python<'_>, name: &str) -> PyResult<()> {
        self.tracker.remove_limb(name).map_err(raise)?;
        self.body_changed(py)
    }

    fn __repr__(&self) -> String {
        format!(
            "Tracker(body={:?}, limbs={}, last={})",
            self.tracker.body().name(),
            self.tracker.body().limbs().len(),
            self.estimate().__repr__()
        )
    }
}
