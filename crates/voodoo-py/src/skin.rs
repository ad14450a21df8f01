//! The skin cue of one camera: what is learnt, and what is followed.

use numpy::{
    PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use voodoo_core::math::Vec3;
use voodoo_core::observation::chroma::{CHROMA_BINS, LUMA_BINS};
use voodoo_core::observation::eye::Eye;
use voodoo_core::skin::candidates::{Candidate, candidates};
use voodoo_core::skin::cue::{Look, SkinCue, SkinSettings};
use voodoo_core::skin::rules::{Expected, LimbDistances};
use voodoo_core::skin::teacher::{Pace, Shown, Teacher};

use crate::body_view::{PyBodyView, rows_of};
use crate::errors::{IntoPy, exception};

type Row<'py> = Bound<'py, PyArray1<f64>>;
type Place = ((f64, f64), i32, usize, bool);
type Ray<'py> = (usize, Row<'py>, Row<'py>, Option<Row<'py>>, f64);
type Names = (Option<usize>, usize, f64, Vec<f64>, Vec<f64>, Vec<f64>);

fn told(candidate: &Candidate) -> Place {
    let [u, v] = candidate.pixel;
    ((u, v), candidate.region, candidate.area, candidate.hand)
}

/// Where in a mask a head or a hand may be, and the number of its region in each pixel.
#[pyfunction]
pub fn skin_candidates<'py>(
    py: Python<'py>,
    mask: PyReadonlyArray2<'py, bool>,
    palm_px: f64,
) -> PyResult<(Vec<Place>, Bound<'py, PyArray2<i32>>)> {
    let (size, pixels) = ([mask.dims()[0], mask.dims()[1]], mask.as_slice()?);
    let pixels: Vec<u8> = pixels.iter().map(|pixel| u8::from(*pixel)).collect();
    let (found, part) = py.detach(|| candidates(&pixels, size[1], palm_px));
    let mut labels = vec![0; pixels.len()];
    for (row, values) in part.values.chunks_exact(part.size[1].max(1)).enumerate() {
        labels[(part.first[0] + row) * size[1] + part.first[1]..][..values.len()].copy_from_slice(values);
    }
    Ok((found.iter().map(told).collect(), PyArray1::from_vec(py, labels).reshape(size)?))
}

fn eye(world_from_sensor: &PyReadonlyArray2<'_, f64>, intrinsics: [f64; 4]) -> PyResult<Eye> {
    Ok(Eye { world_from_sensor: rows_of("world_from_sensor", world_from_sensor)?, intrinsics })
}

/// Two columns of what a function of Python makes of some rows.
pub fn pairs<'py, const N: usize>(function: &Bound<'py, PyAny>, rows: &[[f64; N]]) -> PyResult<Vec<[f64; 2]>> {
    let py = function.py();
    let array = PyArray1::from_slice(py, rows.as_flattened()).reshape([rows.len(), N])?;
    let found: PyReadonlyArray2<'py, f64> = function.call1((array,))?.extract()?;
    if found.dims() != numpy::Ix2(rows.len(), 2) {
        let text = format!("lens: expected two columns of {} rows, found {:?}", rows.len(), found.shape());
        return Err(exception(py, "MeasurementError", text));
    }
    Ok(found.as_array().rows().into_iter().map(|row| [row[0], row[1]]).collect())
}

fn image_of<'a>(image: &'a PyReadonlyArray3<'_, u8>) -> PyResult<(&'a [[u8; 3]], [usize; 2])> {
    let size = image.dims();
    if size[2] != 3 {
        let text = format!("image: expected shape (height, width, 3), found {:?}", image.shape());
        return Err(exception(image.py(), "MeasurementError", text));
    }
    Ok((image.as_slice()?.as_chunks().0, [size[0], size[1]]))
}

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
    fn learnt(&self) -> u32 {
        self.0.learnt
    }

    #[getter]
    fn skin<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let shape = [CHROMA_BINS, CHROMA_BINS, LUMA_BINS];
        Ok(PyArray1::from_slice(py, &self.0.colors.skin).reshape(shape)?.into_any())
    }

    /// Learns colours and background from a picture.
    #[pyo3(signature = (cue, image, places, *, world_from_sensor, intrinsics, project, half_life, every, settled))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn learn<'py>(
        &mut self,
        py: Python<'py>,
        cue: &PySkinCue,
        image: Option<PyReadonlyArray3<'py, u8>>,
        places: PyReadonlyArray2<'py, f64>,
        world_from_sensor: PyReadonlyArray2<'py, f64>,
        intrinsics: [f64; 4],
        project: Option<&Bound<'py, PyAny>>,
        half_life: f64,
        every: u32,
        settled: u32,
    ) -> PyResult<()> {
        let eye = eye(&world_from_sensor, intrinsics)?;
        let inside: Vec<[f64; 3]> = places
            .as_array()
            .rows()
            .into_iter()
            .map(|row| eye.in_sensor(Vec3::new(row[0], row[1], row[2])).into())
            .collect();
        let pixels = match project {
            Some(project) => pairs(project, &inside)?,
            None => inside.iter().map(|place| eye.pixel(Vec3::from_array(*place))).collect(),
        };
        let shown = |(site, (place, pixel)): (usize, (&[f64; 3], &[f64; 2]))| {
            let seen = place[2] > 0.1 && pixel.iter().all(|value| value.is_finite());
            let found = cue.0.assigned.iter().any(|(other, _)| *other == site);
            seen.then_some(Shown { pixel: *pixel, depth: place[2], head: cue.0.settings.is_head(site), found })
        };
        let sites: Vec<Shown> = inside.iter().zip(&pixels).enumerate().filter_map(shown).collect();
        let image = image.as_ref().map(image_of).transpose()?;
        let pace = Pace { focal: eye.focal(), half_life, every, settled };
        py.detach(|| self.0.learn(&cue.0.picture, image, &sites, &pace));
        Ok(())
    }
}

#[pyclass(name = "SkinCue", module = "voodoo._core")]
pub struct PySkinCue(SkinCue);

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
        Self(SkinCue::new(SkinSettings { sites, gate, growth, lost_gate, widest_gate, unexplained, ambiguity }))
    }

    fn __copy__(&self) -> Self {
        Self(self.0.twin())
    }

    #[getter]
    fn mask<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<bool>>>> {
        let picture = &self.0.picture;
        if picture.skin.is_empty() {
            return Ok(None);
        }
        let pixels = picture.skin.iter().map(|pixel| *pixel != 0).collect();
        PyArray1::from_vec(py, pixels).reshape(picture.size).map(Some)
    }

    #[getter]
    fn candidates(&self) -> Vec<Place> {
        self.0.candidates().iter().map(told).collect()
    }

    #[getter]
    fn assigned(&self) -> Vec<(usize, usize)> {
        self.0.assigned.clone()
    }

    /// Of all regions that are followed: site, pictures, stamp, velocity, how far from each site and how long in doubt.
    #[getter]
    fn followed(&self) -> Vec<Names> {
        let blobs = self.0.blobs.items.iter();
        blobs
            .map(|blob| {
                let velocity = blob.velocity.to_array().to_vec();
                (blob.label, blob.count, blob.stamp, velocity, blob.far.clone(), blob.doubt.clone())
            })
            .collect()
    }

    /// Looks for regions of skin and follows them; where their candidates are, none without any.
    #[pyo3(signature = (teacher, image, joints, *, stamp, world_from_sensor, intrinsics, lens, body, settled, arm_lost, upper_arm_visible))]
    #[allow(clippy::too_many_arguments, reason = "keywords in Python")]
    fn look<'py>(
        &mut self,
        py: Python<'py>,
        teacher: &PySkinTeacher,
        image: PyReadonlyArray3<'py, u8>,
        joints: PyReadonlyArray3<'py, f64>,
        stamp: f64,
        world_from_sensor: PyReadonlyArray2<'py, f64>,
        intrinsics: [f64; 4],
        lens: Option<&Bound<'py, PyAny>>,
        body: Option<&PyBodyView>,
        settled: bool,
        arm_lost: Vec<bool>,
        upper_arm_visible: Vec<bool>,
    ) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let eye = eye(&world_from_sensor, intrinsics)?;
        let joints = joints.as_array();
        let count = self.0.settings.sites.len();
        if joints.shape() != [count, 4, 3] || arm_lost.len() != count || upper_arm_visible.len() != count {
            let text = format!("joints: expected shape ({count}, 4, 3), found {:?}", joints.shape());
            return Err(exception(py, "MeasurementError", text));
        }
        let mut expected = Vec::new();
        for site in 0..count {
            let place = |row: usize| {
                let place = Vec3::from_array([0, 1, 2].map(|axis| joints[[site, row, axis]]));
                (!place.is_nan()).then_some(place)
            };
            let Some(here) = place(0) else { continue };
            let inside = eye.in_sensor(here);
            if inside.is_finite() && inside.z > 0.1 {
                expected.push(Expected {
                    site,
                    head: self.0.settings.is_head(site),
                    place: here,
                    depth: inside.z,
                    arm: [place(1), place(2), place(3)],
                    arm_lost: arm_lost[site],
                    upper_arm_visible: upper_arm_visible[site],
                });
            }
        }
        let (image, size) = image_of(&image)?;
        let look = Look {
            image,
            size,
            stamp,
            focal: eye.focal(),
            body: body.map(|body| &body.0),
            teacher: &teacher.0,
            expected: &expected,
            settled,
        };
        py.detach(|| self.0.look(&look)).map_err(|error| error.into_py(py))?;
        if self.0.candidates().is_empty() {
            return Ok(None);
        }
        let pixels: Vec<[f64; 2]> = self.0.candidates().iter().map(|item| item.pixel).collect();
        let flat = match lens {
            Some(lens) => pairs(lens, &pixels)?,
            None => pixels.iter().map(|pixel| eye.undistorted(*pixel)).collect(),
        };
        let directions: Vec<Vec3> = flat.into_iter().map(|xy| eye.direction(xy)).collect();
        let sights = self.0.place(&directions, eye.origin(), eye.axis()).map_err(|error| error.into_py(py))?;
        let places = sights.iter().flat_map(|sight| sight.place.to_array()).collect();
        PyArray1::from_vec(py, places).reshape([sights.len(), 3]).map(Some)
    }

    /// Which candidate each site is: its number, a point and the direction of its ray, its place, and its expected depth.
    #[pyo3(signature = (limbs, away, strangers=None))]
    fn name<'py>(
        &mut self,
        py: Python<'py>,
        limbs: Vec<String>,
        away: PyReadonlyArray2<'py, f32>,
        strangers: Option<PyReadonlyArray1<'py, f32>>,
    ) -> PyResult<Vec<Ray<'py>>> {
        let limbs = LimbDistances { names: limbs, away: away.as_slice()?.to_vec() };
        let strangers = strangers.as_ref().map(|away| away.as_slice()).transpose()?;
        let found = self.0.name(&limbs, strangers).map_err(|error| error.into_py(py))?;
        let row = |place: Vec3| PyArray1::from_slice(py, &place.to_array());
        let told = found.iter();
        Ok(told
            .map(|site| (site.site, row(site.origin), row(site.direction), site.place.map(row), site.depth))
            .collect())
    }
}
