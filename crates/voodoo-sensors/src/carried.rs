//! Extrapolates points that were measured before the frame to its time: each moves with the limb that it lies on.

use voodoo_core::math::{Aabb, Affine3, Mat3, Vec3};
use voodoo_core::{BodyTracker, LimbMotion, PointSlice, TrackError};

/// Points farther than this from every limb belong to the scene and are not moved, meters.
const NEAR: f64 = 0.20;
/// Longest time of extrapolation, seconds...
const LONGEST: f64 = 0.1;
/// ... and shortest one; for shorter times points are not moved.
const SAME_TIME: f64 = 1e-3;
/// Upper bound of a limb's length, meters: a point farther from all limb origins is on no limb.
const LONGEST_LIMB: f64 = 1.0;

/// Extrapolates points that a sensor measured `elapsed` seconds before the tracker's next frame to that frame's time, in the
/// sensor frame (without its pose: in the world frame), meters. Points on a limb move with it, the others stay. Returns `None` if
/// no point moves.
///
/// # Errors
/// [`TrackError`] when points near the body are not finite.
pub fn carried(
    points: PointSlice,
    tracker: &BodyTracker,
    elapsed: f64,
    world_from_sensor: Option<&Affine3>,
) -> Result<Option<Vec<Vec3>>, TrackError> {
    let Some(motion) = tracker.limb_motion().filter(|_| elapsed.abs() >= SAME_TIME) else { return Ok(None) };
    let mut moved: Vec<Vec3> = (0..points.len()).map(|index| points.get(index)).collect();
    if let Some(pose) = world_from_sensor {
        moved.iter_mut().for_each(|point| *point = pose.transform_point3(*point));
    }
    let around = around(&moved, &motion);
    if !around.is_empty() {
        let chosen: Vec<[f64; 3]> = around.iter().map(|index| moved[*index].to_array()).collect();
        let away = tracker.limb_distances(PointSlice::F64(&chosen))?;
        if away.len() == motion.now.len() {
            carry(&mut moved, &around, &away, &motion, [elapsed.clamp(-LONGEST, LONGEST), tracker.config().prediction]);
        }
    }
    if let Some(pose) = world_from_sensor {
        moved.iter_mut().for_each(|point| *point = pose.matrix3.mul_transpose_vec3(*point - pose.translation));
    }
    Ok(Some(moved))
}

/// Which points may be on a limb.
fn around(points: &[Vec3], motion: &LimbMotion) -> Vec<usize> {
    let origins = Aabb::from_points(motion.now.iter().map(|pose| pose.translation));
    let within =
        |place: Vec3| place.cmpgt(origins.mins - LONGEST_LIMB).all() && place.cmplt(origins.maxs + LONGEST_LIMB).all();
    (0..points.len()).filter(|index| within(points[*index])).collect()
}

/// Moves the points that may be on a limb, given for each limb their distances from it, meters: for some time, in seconds, with a
/// fraction of the limb's velocity.
fn carry(points: &mut [Vec3], around: &[usize], away: &[Vec<f32>], motion: &LimbMotion, [elapsed, fraction]: [f64; 2]) {
    let changes: Vec<Affine3> = (0..away.len()).map(|limb| change(motion, limb, fraction)).collect();
    for (column, &index) in around.iter().enumerate() {
        let mut nearest = (0, f32::INFINITY);
        for (limb, away) in away.iter().enumerate() {
            nearest = if away[column] < nearest.1 { (limb, away[column]) } else { nearest };
        }
        if f64::from(nearest.1) >= NEAR {
            continue;
        }
        let velocity = changes[nearest.0].transform_point3(points[index]);
        if velocity.length() < LimbMotion::FASTEST * fraction {
            points[index] += elapsed * velocity;
        }
    }
}

/// Rate of change of a limb's transform over the last interval (world from world), per second, times a fraction.
fn change(motion: &LimbMotion, limb: usize, fraction: f64) -> Affine3 {
    let [now, then] = [motion.now, motion.before]
        .map(|poses| Affine3::from_rotation_translation(poses[limb].rotation, poses[limb].translation));
    let turned = now.matrix3 * then.matrix3.transpose();
    let shift = now.translation - turned * then.translation;
    let turn = turned - Mat3::IDENTITY;
    Affine3::from_mat3_translation(turn / motion.interval * fraction, shift / motion.interval * fraction)
}

#[cfg(test)]
mod tests {
    use super::*;
    use voodoo_core::math::Pose;

    #[test]
    fn points_go_on_with_their_limb_and_the_scene_stays() {
        let pose = |angle: f64, x: f64| Pose::new(Vec3::new(x, 1.0, 0.0), Vec3::Z * angle);
        let (now, before) = ([pose(0.3, 0.03)], [pose(0.3, 0.0)]);
        let motion = LimbMotion { now: &now, before: &before, interval: 0.1 };
        let how = [0.05, 1.0];
        let points = [Vec3::new(0.1, 1.0, 0.0), Vec3::new(0.0, 0.2, 0.0), Vec3::splat(5.0)];
        assert_eq!(around(&points, &motion), [0, 1]);
        let mut moved = points;
        carry(&mut moved, &[0, 1], &[vec![0.1, 0.3]], &motion, how);
        assert!((moved[0].x - 0.115).abs() < 1e-12 && moved[1..] == points[1..]);
        let turned = [pose(0.35, 0.0)];
        let turning = LimbMotion { now: &turned, ..motion };
        let mut moved = points;
        carry(&mut moved, &[0], &[vec![0.1]], &turning, how);
        assert!((moved[0].y - 1.0 - 0.5 * 0.1 * 0.05_f64.sin()).abs() < 1e-12);
        let far = [pose(0.3, 0.83)];
        let mut jumped = points;
        carry(&mut jumped, &[0], &[vec![0.1]], &LimbMotion { now: &far, ..motion }, how);
        assert_eq!(jumped, points);
    }
}
