//! The skin cue of one camera: learned models and tracked regions.

use std::sync::Arc;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use voodoo_core::math::Vec3;
use voodoo_sensors::chroma::{CHROMA_BINS, LUMA_BINS};
use voodoo_sensors::eye::Eye;
use voodoo_sensors::skin::candidates::SkinCandidate;
use voodoo_sensors::skin::cue::{SkinCue, SkinInput, SkinSettings};
use voodoo_sensors::skin::rules::Expected;
use voodoo_sensors::skin::teacher::{Pace, Teacher, VisibleSite};

use crate::arrays::rows;
use crate::body_view::{PyBodyView, rows_of};
use crate::camera::camera_of;
use crate::errors::{IntoPy, exception};
use crate::people::TrackedBody;
use crate::sites::places_of;

type Row<'py> = Bound<'py, PyArray1<f64>>;
type CandidatePlace = ((f64, f64), i32, usize, bool);
type Ray<'py> = (usize, Row<'py>, Row<'py>, Option<Row<'py>>, f64);
fn row_of(candidate: &SkinCandidate) -> CandidatePlace {
    let [u, v] = candidate.pixel;
    ((u, v), candidate.region, candidate.area, candidate.hand)
}

/// Positions in front of a camera, and their pixels.
type PlacesInFront = (Vec<[f64; 3]>, Vec<[f64; 2]>);

/// World positions in front of a camera, meters, and their columns and rows; NaN behind it, and where the lens model has no
/// pixel.
pub(crate) fn before(eye: &Eye, places: impl Iterator<Item = Vec3>) -> PlacesInFront {
    let inside: Vec<[f64; 3]> = places.map(|place| eye.in_sensor(place).to_array()).collect();
    let pixels = inside.iter().map(|place| eye.pixel(Vec3::from_array(*place))).collect();
    (inside, pixels)
}

fn image_of<'a>(image: &'a PyReadonlyArray3<'_, u8>) -> PyResult<(&'a [[u8; 3]], [usize; 2])> {
    let size = image.dims();
    if size[2] != 3 {
        let text = format!("image: expected shape (height, width, 3), found {:?}", image.shape());
        return Err(exception(image.py(), "MeasurementError", text));
    }
    Ok((image.as_slice()?.as_chunks().0, [size[0], size[1]]))
}

#[doc = stub!("SkinTeacher")]
#[pyclass(name = "SkinTeacher", module = "voodoo._core")]
#[derive(Default)]
pub struct PySkinTeacher(Teacher);

#[pymethods]
impl PySkinTeacher {
    #[new]
    fn new() -> Self {
        Self::default()
    }

    #[getter]
    fn learned(&self) -> u32 {
        self.0.learned
    }

    #[getter]
    fn skin<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let shape = [CHROMA_BINS, CHROMA_BINS, LUMA_BINS];
        Ok(PyArray1::from_slice(py, &self.0.colors.skin).reshape(shape)?.into_any())
    }

    /// Learns colors and background from an image.
    #[pyo3(signature = (cue, image, places, *, world_from_sensor, camera, half_life, every, settled))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn learn<'py>(
        &mut self,
        py: Python<'py>,
        cue: &PySkinCue,
        image: Option<PyReadonlyArray3<'py, u8>>,
        places: PyReadonlyArray2<'py, f64>,
        world_from_sensor: PyReadonlyArray2<'py, f64>,
        camera: &Bound<'py, PyAny>,
        half_life: f64,
        every: u32,
        settled: u32,
    ) -> PyResult<()> {
        let camera = camera_of(camera)?;
        let eye = Eye { world_from_sensor: rows_of("world_from_sensor", &world_from_sensor)?, camera: &camera };
        let places = rows("places", &places)?.iter().map(|place| Vec3::from_array(*place));
        let (inside, pixels) = before(&eye, places);
        let visible_site = |(site, (place, pixel)): (usize, (&[f64; 3], &[f64; 2]))| {
            let in_front = place[2] > 0.1 && pixel.iter().all(|value| value.is_finite());
            let found = cue.cue.assigned.iter().any(|(other, _)| *other == site);
            in_front.then_some(VisibleSite {
                pixel: *pixel,
                depth: place[2],
                head: cue.cue.settings.is_head(site),
                found,
            })
        };
        let sites: Vec<VisibleSite> = inside.iter().zip(&pixels).enumerate().filter_map(visible_site).collect();
        let image = image.as_ref().map(image_of).transpose()?;
        let pace = Pace { focal: eye.focal(), half_life, every, settled };
        py.detach(|| self.0.learn(&cue.cue.picture, image, &sites, &pace));
        Ok(())
    }
}

#[doc = stub!("SkinCue")]
#[pyclass(name = "SkinCue", module = "voodoo._core")]
pub struct PySkinCue {
    cue: SkinCue,
    /// Of each site its name, and those of shoulder, elbow and hand of its side.
    arms: Arc<Vec<[String; 4]>>,
}

#[pymethods]
impl PySkinCue {
    #[new]
    #[pyo3(signature = (sites, *, gate, growth, lost_gate, widest_gate, unexplained, ambiguity))]
    fn new(
        sites: Vec<String>,
        gate: f64,
        growth: f64,
        lost_gate: f64,
        widest_gate: f64,
        unexplained: f64,
        ambiguity: f64,
    ) -> Self {
        let arm = |site: &String| {
            let side: String = site.chars().take(1).collect();
            let [shoulder, elbow, hand] = ["shoulder", "elbow", "hand"].map(|joint| format!("{side}_{joint}"));
            [site.clone(), shoulder, elbow, hand]
        };
        let arms = Arc::new(sites.iter().map(arm).collect());
        let settings = SkinSettings { sites, gate, growth, lost_gate, widest_gate, unexplained, ambiguity };
        Self { cue: SkinCue::new(settings), arms }
    }

    fn __copy__(&self) -> Self {
        Self { cue: self.cue.twin(), arms: Arc::clone(&self.arms) }
    }

    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<bool>>>> {
        let picture = &self.cue.picture;
        if picture.skin.is_empty() {
            return Ok(None);
        }
        let pixels = picture.skin.iter().map(|pixel| *pixel != 0).collect();
        PyArray1::from_vec(py, pixels).reshape(picture.size).map(Some)
    }

    #[getter]
    fn candidates(&self) -> Vec<CandidatePlace> {
        self.cue.candidates.iter().map(row_of).collect()
    }

    #[getter]
    fn assigned(&self) -> Vec<(usize, usize)> {
        self.cue.assigned.clone()
    }

    /// Detects, tracks and assigns skin regions of an image. Returns for each detected site its index, a point and the direction
    /// of its ray, its position, and its predicted depth.
    #[pyo3(signature = (teacher, image, predicted, *, stamp, world_from_sensor, camera, body, settled, arm_lost, upper_arm_visible, tracker, others))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn observe<'py>(
        &mut self,
        py: Python<'py>,
        teacher: &PySkinTeacher,
        image: PyReadonlyArray3<'py, u8>,
        predicted: &Bound<'py, PyAny>,
        stamp: f64,
        world_from_sensor: PyReadonlyArray2<'py, f64>,
        camera: &Bound<'py, PyAny>,
        body: Option<&PyBodyView>,
        settled: bool,
        arm_lost: Vec<bool>,
        upper_arm_visible: Vec<bool>,
        tracker: Option<TrackedBody<'py>>,
        others: Vec<TrackedBody<'py>>,
    ) -> PyResult<Vec<Ray<'py>>> {
        let count = self.arms.len();
        if arm_lost.len() != count || upper_arm_visible.len() != count {
            let found = [arm_lost.len(), upper_arm_visible.len()];
            return Err(exception(
                py,
                "MeasurementError",
                format!("arms: expected {count} marks each, found {found:?}"),
            ));
        }
        let mut expected = Vec::new();
        for (site, names) in self.arms.iter().enumerate() {
            let places = places_of(predicted, names.iter().map(String::as_str))?;
            let [here, shoulder, elbow, hand] = [0, 1, 2, 3].map(|index| places[index].filter(|place| !place.is_nan()));
            let Some(place) = here else { continue };
            expected.push(Expected {
                site,
                head: self.cue.settings.is_head(site),
                place,
                arm: [shoulder, elbow, hand],
                arm_lost: arm_lost[site],
                upper_arm_visible: upper_arm_visible[site],
            });
        }
        let (image, size) = image_of(&image)?;
        let others = others.iter().map(TrackedBody::tracker).collect::<PyResult<Vec<_>>>()?;
        let camera = camera_of(camera)?;
        let input = SkinInput {
            image,
            size,
            stamp,
            eye: Eye { world_from_sensor: rows_of("world_from_sensor", &world_from_sensor)?, camera: &camera },
            body: body.map(|body| &body.0),
            teacher: &teacher.0,
            settled,
            expected: &expected,
            tracker: tracker.as_ref().map(TrackedBody::tracker).transpose()?,
            others: &others,
        };
        let cue = &mut self.cue;
        let found = py.detach(|| cue.observe(&input)).map_err(|error| error.into_py(py))?;
        let row = |place: Vec3| PyArray1::from_slice(py, &place.to_array());
        let rows = found.iter();
        Ok(rows
            .map(|site| (site.site, row(site.origin), row(site.direction), site.place.map(row), site.depth))
            .collect())
    }
}
