//! What a solver requires of the loop around it.

use crate::config::{Config, SolverKind};

/// Factor by which gates and kernels narrow from step to step: far points may pull only while the pose is inaccurate.
const NARROWING: f64 = 0.7;
/// From this step on, only every second step assigns points and searches for edges: once the gate has narrowed, few change.
const EVERY_SECOND_FROM: usize = 2;

/// A length that narrows from `start` to `end`, in the given step of a frame.
pub(crate) fn narrowed(start: f64, end: f64, step: usize) -> f64 {
    (start * NARROWING.powi(step.min(1000) as i32)).max(end)
}

/// Which points may be matched in one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Gate {
    /// Enlargement of the limb boxes, meters.
    pub box_margin: f64,
    /// Greatest distance of a point from its limb's surface, meters.
    pub distance: f64,
}

impl Gate {
    /// The points up to this distance.
    pub(crate) const fn within(distance: f64) -> Self {
        Self { box_margin: distance, distance }
    }

    /// Which points may be matched in a step of a frame.
    pub(crate) fn new(config: &Config, step: usize) -> Self {
        if !config.solver.is_whole_body() {
            return Self { box_margin: config.limb_box_margin, distance: config.max_distance };
        }
        Self::within(narrowed(config.gate_start, config.gate_end, step))
    }
}

impl SolverKind {
    /// Whether all limbs are solved at once. Then steps start from the predicted pose, and the stages that evaluate whole bodies
    /// (hypotheses, girths, relocalization) run after them. Otherwise, as published (K06 IV-B, K07 4.3), elastic bands hold the
    /// limbs together, every step reassigns the points, depth pixels match the closest point anywhere on a limb, and the warm start
    /// uses the points in frames with sites.
    pub(crate) fn is_whole_body(self) -> bool {
        self != Self::Limbwise
    }

    /// Whether points are reassigned in a step of a frame.
    pub(crate) fn reassociates(self, step: usize) -> bool {
        !self.is_whole_body() || step < EVERY_SECOND_FROM || (step - EVERY_SECOND_FROM).is_multiple_of(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_published_solver_asks_for_the_published_loop() {
        let config = Config { solver: SolverKind::Limbwise, ..Config::default() };
        for step in 0..20 {
            let gate = Gate::new(&config, step);
            assert_eq!([gate.box_margin, gate.distance], [config.limb_box_margin, config.max_distance]);
            assert!(config.solver.reassociates(step));
        }
    }

    #[test]
    fn whole_body_solvers_narrow_their_gate_and_assign_less_often() {
        for solver in [SolverKind::Chain, SolverKind::Tree] {
            let config = Config { solver, ..Config::default() };
            let distance = |step| Gate::new(&config, step).distance;
            assert_eq!(distance(0), config.gate_start);
            assert!((1..40).all(|step| distance(step) <= distance(step - 1)));
            assert_eq!(distance(40), config.gate_end);
            let anew: Vec<bool> = (0..7).map(|step| solver.reassociates(step)).collect();
            assert_eq!(anew, [true, true, true, false, true, false, true]);
        }
    }

    #[test]
    fn no_number_of_steps_overflows() {
        assert_eq!(narrowed(0.3, 0.1, usize::MAX), 0.1);
    }
}
