//! A sensor of one's own: radio tags on both wrists, each of which reports its position with a standard deviation.
//!
//!     cargo run --release -p voodoo-core --example own_sensor

use voodoo_core::math::{Pose, Vec3};
use voodoo_core::{Body, BodyError, Config, Frame, HumanModel, PositionRelation, Tracker};

/// Standard deviation of a position whose weight is 1, meters.
const UNIT_SIGMA: f64 = 0.01;

/// What a tag reports.
struct Reading {
    site: &'static str,
    position: Vec3,
    sigma: f64,
}

/// A weight is the precision of a position.
fn measurement(body: &Body, reading: &Reading) -> Result<PositionRelation, BodyError> {
    Ok(PositionRelation {
        site: body.site_index(reading.site)?,
        position: reading.position,
        weight: (UNIT_SIGMA / reading.sigma).powi(2),
        bias: 0.0,
        source: 0,
    })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let body = Body::human(1.75, HumanModel::Measured)?;
    let standing = body.rest_pose(Pose::IDENTITY);
    let wrists = ["l_wrist", "r_wrist"];
    let mut tracker = Tracker::new(body.clone(), Config::default())?;
    tracker.reset_pose(&standing)?;
    for index in 0..20 {
        // Both hands rise by 2 cm a frame.
        let up = Vec3::Z * 0.02 * f64::from(index);
        let mut positions = Vec::new();
        for site in wrists {
            let position = body.site_position(&standing, body.site_index(site)?) + up;
            positions.push(measurement(&body, &Reading { site, position, sigma: 0.02 })?);
        }
        let estimate = tracker.step(&Frame { positions: &positions, ..Frame::empty(f64::from(index) / 30.0) })?;
        for (site, measured) in wrists.iter().zip(&positions) {
            let error = estimate.sites[measured.site].distance(measured.position);
            println!("{:.3} s: {site} {:.1} mm from its tag", estimate.stamp, 1000.0 * error);
        }
    }
    Ok(())
}
