//! A fast approximate distance, used to choose the limb of a point.

use super::TaperedEllipticCylinder;
use crate::math::{Mat3, Points, Pose, Vec3, vectorized};

impl TaperedEllipticCylinder {
    /// An approximate signed distance from `q` to the closed surface, limb frame, meters, negative inside.
    ///
    /// To the side it is the first-order distance `(ρ - 1) / |∇ρ|` of the level function `ρ = sqrt((x/a(z))² + (y/b(z))²)`, with
    /// an error of approximately 1 mm (95 % of points within 5 cm of limb-like shapes). Beyond a cap it is combined with the
    /// height above the cap. It needs no iteration. Use it only to rank limbs.
    pub fn approximate_distance(&self, q: Vec3) -> f64 {
        let (a, b) = self.semi_axes(q.z);
        let tiny = 1e-9;
        let (inv_a, inv_b) = (1.0 / a.max(tiny), 1.0 / b.max(tiny));
        let (u, v) = (q.x * inv_a, q.y * inv_b);
        let rho = (u * u + v * v).sqrt();
        let above = (-q.z).max(q.z - self.length);
        // ρ ∇ρ = (x/a², y/b², -(u² a'/a + v² b'/b)); beyond a cap the slice no longer depends on z.
        let climb = if above > 0.0 {
            0.0
        } else {
            let rate = 1.0 / self.length;
            -(u * u * (self.a1 - self.a0) * inv_a + v * v * (self.b1 - self.b0) * inv_b) * rate
        };
        let gradient = Vec3::new(u * inv_a, v * inv_b, climb).length();
        // The level function has a cusp on the axis, where the distance is the smaller semi-axis.
        let side = if gradient > 0.0 { ((rho - 1.0) * rho / gradient).max(-a.min(b)) } else { -a.min(b) };
        if above <= 0.0 {
            side.max(above)
        } else {
            let side = side.max(0.0);
            (side * side + above * above).sqrt()
        }
    }

    /// [`Self::approximate_distance`] for every query in the frame `world`, in single precision, into `out`.
    pub(crate) fn approximate_distances(&self, world_from_limb: &Pose, queries: &Points, out: &mut Vec<f32>) {
        out.resize(queries.len(), 0.0);
        let limb_from_world = world_from_limb.inverse();
        let rotation = Mat3::from_quat(limb_from_world.rotation);
        // Rows of the rotation and the translation into the limb frame.
        let rows = [0, 1, 2].map(|axis| {
            let row = rotation.row(axis);
            [row.x, row.y, row.z, limb_from_world.translation[axis]].map(|value| value as f32)
        });
        // Semi-axes at the proximal end, and their change per meter.
        let (length, rate) = (self.length as f32, 1.0 / self.length);
        let start = [self.a0, self.b0].map(|value| value as f32);
        let growth = [(self.a1 - self.a0) * rate, (self.b1 - self.b0) * rate].map(|value| value as f32);
        let max = |a: f32, b: f32| if a > b { a } else { b };
        let min = |a: f32, b: f32| if a < b { a } else { b };
        vectorized!({
            let places = queries.x.iter().zip(&queries.y).zip(&queries.z);
            for (((x, y), z), out) in places.zip(out.iter_mut()) {
                let [x, y, z] = rows.map(|row| row[0] * x + row[1] * y + row[2] * z + row[3]);
                let within = min(max(z, 0.0), length);
                let [a, b] = [0, 1].map(|i| max(start[i] + growth[i] * within, 1e-9));
                let (inv_a, inv_b) = (1.0 / a, 1.0 / b);
                let (u, v) = (x * inv_a, y * inv_b);
                let rho_square = u * u + v * v;
                let above = max(-z, z - length);
                let climb = u * u * growth[0] * inv_a + v * v * growth[1] * inv_b;
                let climb = if above > 0.0 { 0.0 } else { climb };
                let (gx, gy) = (u * inv_a, v * inv_b);
                let gradient = (gx * gx + gy * gy + climb * climb).sqrt();
                let side = max((rho_square - rho_square.sqrt()) / max(gradient, 1e-12), -min(a, b));
                let outside = max(side, 0.0);
                let beyond = (outside * outside + above * above).sqrt();
                *out = if above <= 0.0 { max(side, above) } else { beyond };
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn single_precision_agrees_with_double() -> Result<(), crate::error::Unexpected> {
        let shape = TaperedEllipticCylinder::new(0.4, 0.10, 0.06, 0.05, 0.04)?;
        let pose = Pose::new(Vec3::new(0.3, -0.2, 0.5), Vec3::new(0.4, 1.1, -0.7));
        let mut queries = Points::default();
        for n in 0..4000 {
            let part = |step: usize| (n * step % 997) as f32 / 997.0 - 0.5;
            queries.push([0.3 + part(3), -0.2 + part(71), 0.5 + part(401)]);
        }
        let mut found = Vec::new();
        shape.approximate_distances(&pose, &queries, &mut found);
        for (index, found) in found.iter().enumerate() {
            let expected = shape.approximate_distance(pose.inverse_transform_point(queries.get(index)));
            assert!((f64::from(*found) - expected).abs() < 2e-6, "{found} is not {expected}");
        }
        Ok(())
    }
}
