//! Extrapolates points that were measured before the frame to its time: each moves with the limb that it lies on.

use crate::eye::Matrix;
use voodoo_core::BodyTracker;
use voodoo_core::PointSlice;
use voodoo_core::TrackError;
use voodoo_core::math::matrix;

/// Points farther than this from every limb belong to the scene and are not moved, meters.
const NEAR: f64 = 0.20;
/// A limb with a greater speed has jumped, meters per second; its points are not moved.
const FASTEST_LIMB: f64 = 8.0;
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
    world_from_sensor: Option<&Matrix>,
) -> Result<Option<Vec<[f64; 3]>>, TrackError> {
    let Some(motion) = tracker.limb_motion().filter(|_| elapsed.abs() >= SAME_TIME) else { return Ok(None) };
    let [poses, before] = [motion.now, motion.before].map(|poses| poses.iter().map(matrix).collect::<Vec<_>>());
    let carrying = Carrying {
        poses: &poses,
        before: &before,
        interval: motion.interval,
        elapsed: elapsed.clamp(-LONGEST, LONGEST),
        near: NEAR,
        fraction: tracker.config().prediction,
        max_speed: FASTEST_LIMB,
    };
    let mut moved: Vec<[f64; 3]> = (0..points.len()).map(|index| points.get(index).to_array()).collect();
    world_from_sensor.iter().for_each(|pose| in_world(&mut moved, pose));
    let around = carrying.around(&moved);
    if !around.is_empty() {
        let chosen: Vec<[f64; 3]> = around.iter().map(|index| moved[*index]).collect();
        let away = tracker.limb_distances(PointSlice::F64(&chosen))?.concat();
        carrying.carry(&mut moved, &around, &away);
    }
    world_from_sensor.iter().for_each(|pose| in_sensor(&mut moved, pose));
    Ok(Some(moved))
}

/// World positions of points in a sensor frame, meters.
fn in_world(points: &mut [[f64; 3]], pose: &Matrix) {
    for point in points {
        let [x, y, z] = *point;
        *point = [0, 1, 2].map(|axis| pose[axis][0] * x + pose[axis][1] * y + pose[axis][2] * z + pose[axis][3]);
    }
}

/// Inverse of the transform to the world frame.
fn in_sensor(points: &mut [[f64; 3]], pose: &Matrix) {
    for point in points {
        let offset = [0, 1, 2].map(|axis| point[axis] - pose[axis][3]);
        // The inverse of a rigid pose.
        *point = [0, 1, 2].map(|axis| (0..3).map(|row| offset[row] * pose[row][axis]).sum());
    }
}

/// Motion of the limbs, and the parameters of the extrapolation.
#[derive(Clone, Copy, Debug)]
struct Carrying<'a> {
    /// Poses of all limbs.
    poses: &'a [Matrix],
    /// Poses of all limbs in an earlier estimate.
    before: &'a [Matrix],
    /// Time between the two estimates, seconds.
    interval: f64,
    /// Time of extrapolation, seconds.
    elapsed: f64,
    /// Points farther than this from every limb belong to the scene and are not moved, meters.
    near: f64,
    /// Factor applied to the limbs' velocity.
    fraction: f64,
    /// A limb with a greater speed has jumped, meters per second; its points are not moved.
    max_speed: f64,
}

impl Carrying<'_> {
    /// Which points may be on a limb.
    fn around(&self, points: &[[f64; 3]]) -> Vec<usize> {
        let origins = || self.poses.iter().map(|pose| [0, 1, 2].map(|axis| pose[axis][3]));
        let low = origins().fold([f64::INFINITY; 3], |low, place| [0, 1, 2].map(|axis| place[axis].min(low[axis])));
        let high =
            origins().fold([f64::NEG_INFINITY; 3], |high, place| [0, 1, 2].map(|axis| place[axis].max(high[axis])));
        let within = |place: &[f64; 3]| {
            (0..3).all(|axis| place[axis] > low[axis] - LONGEST_LIMB && place[axis] < high[axis] + LONGEST_LIMB)
        };
        points.iter().enumerate().filter(|(_, place)| within(place)).map(|(index, _)| index).collect()
    }

    /// Moves the points that may be on a limb, given their distances from each limb, limb by limb, meters.
    fn carry(&self, points: &mut [[f64; 3]], around: &[usize], away: &[f32]) {
        let count = around.len();
        if self.poses.len() != self.before.len() || away.len() != count * self.poses.len() {
            return;
        }
        let mut moves: Vec<Option<Matrix>> = vec![None; self.poses.len()];
        for (column, &index) in around.iter().enumerate() {
            let mut nearest = (0, f32::INFINITY);
            for limb in 0..self.poses.len() {
                let distance = away[limb * count + column];
                nearest = if distance < nearest.1 { (limb, distance) } else { nearest };
            }
            if f64::from(nearest.1) >= self.near {
                continue;
            }
            let limb = nearest.0;
            let change = *moves[limb].get_or_insert_with(|| self.change(limb));
            let place = points[index];
            let velocity = [0, 1, 2].map(|axis| {
                let row = &change[axis];
                row[0] * place[0] + row[1] * place[1] + row[2] * place[2] + row[3]
            });
            let speed = velocity.iter().map(|value| value * value).sum::<f64>().sqrt();
            if speed < self.max_speed * self.fraction {
                points[index] = [0, 1, 2].map(|axis| place[axis] + self.elapsed * velocity[axis]);
            }
        }
    }

    /// Rate of change of a limb's transform over the last interval (world from world), per second.
    fn change(&self, limb: usize) -> Matrix {
        let (now, then) = (&self.poses[limb], &self.before[limb]);
        // The inverse of a rigid pose.
        let turn = |row: usize, column: usize| (0..3).map(|axis| now[row][axis] * then[column][axis]).sum::<f64>();
        let mut change = [[0.0; 4]; 4];
        for row in 0..3 {
            let turned = [0, 1, 2].map(|column| turn(row, column));
            let shift = now[row][3] - (0..3).map(|column| turned[column] * then[column][3]).sum::<f64>();
            for column in 0..3 {
                let still = f64::from(u8::from(row == column));
                change[row][column] = (turned[column] - still) / self.interval * self.fraction;
            }
            change[row][3] = shift / self.interval * self.fraction;
        }
        change
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_go_on_with_their_limb_and_the_scene_stays() {
        let pose = |angle: f64, x: f64| {
            let (sine, cosine) = angle.sin_cos();
            [[cosine, -sine, 0.0, x], [sine, cosine, 0.0, 1.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
        };
        let (poses, before) = ([pose(0.3, 0.03)], [pose(0.3, 0.0)]);
        let carrying = Carrying {
            poses: &poses,
            before: &before,
            interval: 0.1,
            elapsed: 0.05,
            near: 0.2,
            fraction: 1.0,
            max_speed: 8.0,
        };
        let points = [[0.1, 1.0, 0.0], [0.0, 0.2, 0.0], [5.0, 5.0, 5.0]];
        assert_eq!(carrying.around(&points), [0, 1]);
        let mut moved = points;
        carrying.carry(&mut moved, &[0, 1], &[0.1, 0.3]);
        assert!((moved[0][0] - 0.115).abs() < 1e-12 && moved[1..] == points[1..]);
        let turning = Carrying { poses: &[pose(0.35, 0.0)], ..carrying };
        let mut moved = points;
        turning.carry(&mut moved, &[0], &[0.1]);
        assert!((moved[0][1] - 1.0 - 0.5 * 0.1 * 0.05_f64.sin()).abs() < 1e-12);
        let mut jumped = points;
        Carrying { max_speed: 0.1, ..carrying }.carry(&mut jumped, &[0], &[0.1]);
        assert_eq!(jumped, points);
        let mut there = points;
        in_world(&mut there, &poses[0]);
        in_sensor(&mut there, &poses[0]);
        assert!(there.iter().flatten().zip(points.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-12));
    }
}
