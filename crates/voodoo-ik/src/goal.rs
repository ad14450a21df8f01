//! Targets of sites: a position, or a line of sight.

use super::model::{ChainModel, Kinematics};
use voodoo_core::math::{Vec3, reset};

/// The target of a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aim {
    /// At a world position.
    Position(Vec3),
    /// On a line in Pluecker form (R07 eq. 11): unit direction `n` and moment `m = p x n` of any point `p` on it.
    Line {
        /// Unit direction.
        n: Vec3,
        /// Moment.
        m: Vec3,
    },
}

impl Aim {
    /// The residual of a point at `x`: its offset from the position, or `x x n - m` (R07 eq. 11), whose length is its distance
    /// from the line.
    pub fn residual(&self, x: Vec3) -> Vec3 {
        match self {
            Self::Position(p) => x - *p,
            Self::Line { n, m } => x.cross(*n) - *m,
        }
    }

    /// Derivative of the residual for a velocity of the point (R07 eq. 13).
    pub fn derivative(&self, velocity: Vec3) -> Vec3 {
        match self {
            Self::Position(_) => velocity,
            Self::Line { n, .. } => velocity.cross(*n),
        }
    }
}

/// A point on a link and its target.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// Index of the link.
    pub link: usize,
    /// The point in the limb's frame.
    pub point: Vec3,
    /// Its target.
    pub aim: Aim,
    /// Weight relative to the other goals of its level.
    pub weight: f64,
    /// Priority: a goal never disturbs goals of smaller levels.
    pub level: usize,
}

impl Goal {
    /// The residual at a pose of the chain, see [`Aim::residual`].
    pub fn residual(&self, at: &Kinematics) -> Vec3 {
        self.aim.residual(at.poses[self.link].transform_point(self.point))
    }
}

/// Weighted squared residual of the goals.
pub fn level_cost(goals: &[Goal], at: &Kinematics) -> f64 {
    goals.iter().map(|goal| goal.weight * goal.residual(at).length_squared()).sum()
}

/// Residuals and Jacobian (row-major, three rows per goal) of the goals, both multiplied by the square roots of the weights.
pub fn level_rows(
    model: &ChainModel,
    goals: &[Goal],
    at: &Kinematics,
    jacobian: &mut Vec<f64>,
    residual: &mut Vec<f64>,
) {
    let n = model.freedoms();
    reset(jacobian, 3 * goals.len() * n, 0.0);
    residual.clear();
    for (index, goal) in goals.iter().enumerate() {
        let x = at.poses[goal.link].transform_point(goal.point);
        let root = goal.weight.sqrt();
        residual.extend((root * goal.aim.residual(x)).to_array());
        let rows = &mut jacobian[3 * index * n..3 * (index + 1) * n];
        for &mover in &model.links()[goal.link].movers {
            let column = &at.columns[mover];
            let d = root * goal.aim.derivative(column.omega.cross(x) + column.v);
            rows[mover] = d.x;
            rows[n + mover] = d.y;
            rows[2 * n + mover] = d.z;
        }
    }
}
