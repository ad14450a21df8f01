//! Tracks a person through a stream of depth images. The images are rendered here; a camera's take their place.
//!
//!     cargo run --release -p voodoo-core --example track_depth

use voodoo_core::math::{Mat3, Pose, Quat, Vec3};
use voodoo_core::{
    Body, Camera, Config, DepthImage, DepthPixels, Estimate, Frame, HumanModel, Rendering, Tracker, Viewpoint,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let body = Body::human(1.75, HumanModel::Measured)?;
    let camera = Camera::pinhole(320, 240, [290.0, 290.0, 159.5, 119.5])?;
    // The camera stands 3 m before the person at the height of the hips and looks along -x of the world.
    let rotation = Quat::from_mat3(&Mat3::from_cols(Vec3::Y, -Vec3::Z, -Vec3::X));
    let world_from_sensor = Pose::from_parts(Vec3::new(3.0, 0.0, 0.0), rotation);

    let mut tracker = Tracker::new(body.clone(), Config::default())?;
    tracker.reset_pose(&standing(&body, 0.0))?;
    let mut rendering = Rendering::default();
    let root = body.site_index("humanoid_root")?;
    for index in 0..30 {
        // The person walks sideways at 0.3 m/s.
        let truth = standing(&body, 0.01 * f64::from(index));
        rendering.render(&body, &truth, &Viewpoint { camera: &camera, world_from_sensor })?;
        let image = DepthImage {
            pixels: DepthPixels::F32(rendering.depth()),
            camera: &camera,
            meters_per_unit: 1.0,
            world_from_sensor,
            weight: 1.0,
            source: 0,
        };
        let estimate: &Estimate = tracker.step(&Frame { images: &[image], ..Frame::empty(f64::from(index) / 30.0) })?;
        let error = estimate.sites[root].distance(body.site_position(&truth, root));
        println!(
            "{:.3} s: {}, root at {:.3}, {:.1} mm off",
            estimate.stamp,
            estimate.status.name(),
            estimate.sites[root],
            1000.0 * error
        );
    }
    Ok(())
}

/// A person who stands upright, `aside` meters to the left of the origin.
fn standing(body: &Body, aside: f64) -> Vec<Pose> {
    body.rest_pose(Pose::from_translation(Vec3::new(0.0, aside, 0.0)))
}
