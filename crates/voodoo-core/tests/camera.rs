//! The camera: rays against projections, derivatives against differences, windows against what they must hold, refusals.
#![allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]

use crate::scene::Noise;
use voodoo_core::Unexpected;
use voodoo_core::math::Vec3;
use voodoo_core::{Camera, Lens};

/// An Azure Kinect's depth camera.
const AZURE: [f64; 8] = [
    0.5479397774,
    -0.0209713709,
    2.0557534e-5,
    -7.2104158e-5,
    -0.0026522316,
    0.8896790743,
    0.0861302093,
    -0.0139103848,
];

/// Lenses as they are sold.
fn lenses() -> Vec<Lens> {
    vec![
        Lens::Pinhole,
        Lens::PlumbBob([-0.25, 0.08, 0.001, -0.002, 0.01]),
        Lens::PlumbBob([0.15, -0.1, -0.002, 0.001, 0.03]),
        Lens::from_model("rational_polynomial", &AZURE).unwrap(),
        Lens::Rational([0.3, -0.1, 0.001, 0.0005, 0.02, 0.4, -0.05, 0.03, 0.002, -0.001, 0.001, 0.003, 0.02, -0.03]),
        Lens::Fisheye([0.02, -0.01, 0.003, -0.001]),
        Lens::Fisheye([0.0; 4]),
        Lens::InversePlumbBob([0.2, 0.05, -0.001, 0.001, 0.02]),
    ]
}

fn through(lens: Lens) -> Camera {
    Camera::new(320, 240, [210.0, 212.0, 158.3, 121.7], lens).unwrap()
}

fn within(noise: &mut Noise, low: f64, high: f64) -> f64 {
    low + (high - low) * (0.5 + noise.normal() / 12.0).clamp(0.0, 1.0)
}

#[test]
fn projection_inverts_the_ray_of_a_pixel_and_the_ray_inverts_projection() {
    let mut noise = Noise(5);
    for lens in lenses() {
        let camera = through(lens);
        for _ in 0..4000 {
            let pixel = [within(&mut noise, -20.0, 340.0), within(&mut noise, -20.0, 260.0)];
            let [x, y] = camera.ray(pixel).unwrap_or_else(|| panic!("no ray at {pixel:?} through {lens:?}"));
            let z = within(&mut noise, 0.1, 6.0);
            let [u, v] = camera.project(Vec3::new(x * z, y * z, z)).unwrap();
            assert!((u - pixel[0]).abs().max((v - pixel[1]).abs()) < 1e-9, "{pixel:?} {u} {v} {lens:?}");
            let [again, too] = camera.ray([u, v]).unwrap();
            assert!((again - x).abs().max((too - y).abs()) < 1e-9, "{lens:?}");
        }
    }
}

#[test]
fn a_fisheye_sees_nearly_to_its_plane() {
    let camera = Camera::new(640, 640, [200.0, 200.0, 319.5, 319.5], Lens::Fisheye([0.0; 4])).unwrap();
    for degrees in [10.0_f64, 60.0, 85.0, 89.9] {
        let angle = degrees.to_radians();
        let [u, _] = camera.project(Vec3::new(angle.sin(), 0.0, angle.cos())).unwrap();
        assert!((u - (319.5 + 200.0 * angle)).abs() < 1e-9, "{degrees}");
        let [x, _] = camera.ray([u, 319.5]).unwrap();
        assert!((x.atan() - angle).abs() < 1e-12, "{degrees}");
    }
    assert_eq!(camera.project(Vec3::new(1.0, 0.0, -0.01)), None);
    assert_eq!(camera.ray([319.5 + 200.0 * 1.6, 319.5]), None, "behind the camera's plane");
}

#[test]
fn beyond_the_radius_at_which_a_lens_folds_nothing_is_visible() {
    // r (1 - 0.25 r^2) is greatest at r = sqrt(4 / 3).
    let camera = through(Lens::PlumbBob([-0.25, 0.0, 0.0, 0.0, 0.0]));
    assert!(camera.project(Vec3::new(1.15, 0.0, 1.0)).is_some());
    assert_eq!(camera.project(Vec3::new(1.16, 0.0, 1.0)), None);
    assert_eq!(camera.project(Vec3::new(30.0, 0.0, 1.0)), None, "it would come back into the image");
    assert_eq!(camera.ray([158.3 + 0.78 * 210.0, 121.7]), None);
}

#[test]
fn gradients_are_the_differences_of_projections() {
    let mut noise = Noise(6);
    for lens in lenses() {
        let camera = through(lens);
        for _ in 0..300 {
            let z = within(&mut noise, 0.5, 5.0);
            let point = Vec3::new(within(&mut noise, -0.7, 0.7) * z, within(&mut noise, -0.5, 0.5) * z, z);
            for along in [[1.0, 0.0], [0.0, 1.0], [0.6, -0.8]] {
                let observed = |point: Vec3| camera.project(point).map(|[u, v]| along[0] * u + along[1] * v).unwrap();
                let gradient = camera.gradient(point, along).unwrap();
                for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                    let step = 1e-5;
                    let slope = (observed(point + axis * step) - observed(point - axis * step)) / (2.0 * step);
                    let found = gradient.dot(axis);
                    assert!((slope - found).abs() < 1e-4 * (1.0 + slope.abs()), "{slope} {found} {lens:?} {point}");
                }
            }
        }
        assert_eq!(camera.gradient(-Vec3::Z, [1.0, 0.0]), None);
    }
}

#[test]
fn rays_of_pixels_are_those_of_their_centers() {
    for lens in lenses() {
        let camera = through(lens);
        let rays = camera.rays();
        assert_eq!(rays.len(), 320 * 240);
        for (index, ray) in rays.iter().enumerate().step_by(777) {
            let (column, row) = (index % 320, index / 320);
            let exact = camera.ray([column as f64, row as f64]).unwrap();
            assert_eq!(*ray, exact.map(|value| value as f32));
            let [x, y] = camera.pixel_ray(column, row);
            assert!((x - exact[0]).abs().max((y - exact[1]).abs()) < 1e-6);
            assert_eq!(camera.index_of(Vec3::new(exact[0], exact[1], 1.0) * 1.7), Some(index));
        }
    }
}

#[test]
fn a_window_holds_all_that_is_visible_of_a_box() {
    let mut noise = Noise(7);
    for lens in lenses() {
        let camera = through(lens);
        let mut smaller = 0;
        for _ in 0..200 {
            let low =
                Vec3::new(within(&mut noise, -3.0, 2.0), within(&mut noise, -3.0, 2.0), within(&mut noise, 0.2, 3.0));
            let size = Vec3::new(0.7, 1.1, 0.5);
            let corner = |index: usize| {
                let fraction = |bit: usize| f64::from(u8::from(index & bit != 0));
                low + size * Vec3::new(fraction(1), fraction(2), fraction(4))
            };
            let [columns, rows] = camera.window((0..8).map(corner));
            smaller += usize::from(columns.len() * rows.len() < 320 * 240);
            for _ in 0..200 {
                let fraction =
                    Vec3::new(within(&mut noise, 0.0, 1.0), within(&mut noise, 0.0, 1.0), within(&mut noise, 0.0, 1.0));
                if let Some(index) = camera.index_of(low + size * fraction) {
                    assert!(columns.contains(&(index % 320)) && rows.contains(&(index / 320)), "{lens:?} {low}");
                }
            }
        }
        assert!(smaller > 100, "{smaller} of 200 windows are smaller than the image, {lens:?}");
        let [columns, rows] = camera.window([Vec3::Z, Vec3::new(0.0, 0.0, 0.01)]);
        assert_eq!((columns, rows), (0..320, 0..240), "a corner at the camera");
    }
}

#[test]
fn impossible_cameras_are_refused_with_what_is_wrong() {
    let good = [10.0, 12.0, 3.5, 2.5];
    let of = |width, height, intrinsics, lens| Camera::new(width, height, intrinsics, lens).unwrap_err();
    let about = |error: Unexpected, what: &str, words: &str| {
        assert_eq!(error.what, format!("camera {what}"));
        assert!(error.to_string().contains(words), "{error}");
    };
    about(of(0, 6, good, Lens::Pinhole), "size", "1 to 33554432 pixels, found 0x6");
    about(of(1 << 40, 1 << 40, good, Lens::Pinhole), "size", "pixels");
    about(of(8, 6, [0.0, 12.0, 3.5, 2.5], Lens::Pinhole), "fx, fy", "above zero, found 0, 12");
    about(of(8, 6, [10.0, f64::NAN, 3.5, 2.5], Lens::Pinhole), "fx, fy", "finite");
    about(of(8, 6, [10.0, 12.0, f64::INFINITY, 2.5], Lens::Pinhole), "cx, cy", "a finite principal point");
    about(of(8, 6, good, Lens::Fisheye([0.0, f64::NAN, 0.0, 0.0])), "distortion", "finite coefficients");
    about(Lens::from_model("plumb_bob", &[0.1; 3]).unwrap_err(), "distortion", "0, 4 or 5 coefficients, found 3");
    about(Lens::from_model("equidistant", &[0.1; 5]).unwrap_err(), "distortion", "0 or 4");
    about(Lens::from_model("ftheta", &[]).unwrap_err(), "model", "rational_polynomial");
    assert_eq!(Lens::from_model("plumb_bob", &[0.0; 5]), Ok(Lens::Pinhole));
    assert_eq!(Lens::from_model("equidistant", &[]), Ok(Lens::Fisheye([0.0; 4])));
    assert_eq!(Camera::pinhole(8, 6, good), Camera::new(8, 6, good, Lens::Pinhole));
}
