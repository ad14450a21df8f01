//! What a solver requires of the loop around it.

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

/// What a solver requires of the loop: constant for one configuration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Schedule {
    /// Gate of the first step, and the one it narrows to.
    pub gates: [Gate; 2],
    /// Whether depth pixels match only surfaces that face their camera; the published method takes the closest point anywhere.
    pub visible_side: bool,
    /// Whether all limbs are solved at once. Then steps start from the predicted pose, and the stages that evaluate whole bodies
    /// (hypotheses, girths, relocalization) run after them. Otherwise, as published (K06 IV-B, K07 4.3), elastic bands hold the
    /// limbs together, every step reassigns the points, and the warm start uses them in frames with sites.
    pub whole_body: bool,
}

impl Schedule {
    /// Which points may be matched in a step of a frame.
    pub(crate) fn gate(&self, step: usize) -> Gate {
        let [start, end] = self.gates;
        Gate {
            box_margin: narrowed(start.box_margin, end.box_margin, step),
            distance: narrowed(start.distance, end.distance, step),
        }
    }

    /// Whether points are reassigned in a step of a frame.
    pub(crate) fn reassociates(&self, step: usize) -> bool {
        !self.whole_body || step < EVERY_SECOND_FROM || (step - EVERY_SECOND_FROM).is_multiple_of(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Config, SolverKind};
    use crate::solver::solver;

    #[test]
    fn the_published_solver_asks_for_the_published_loop() {
        let config = Config::default();
        let schedule = solver(SolverKind::Limbwise).schedule(&config);
        assert!(!schedule.visible_side && !schedule.whole_body);
        for step in 0..20 {
            let gate = schedule.gate(step);
            assert_eq!([gate.box_margin, gate.distance], [config.limb_box_margin, config.max_distance]);
            assert!(schedule.reassociates(step));
        }
    }

    #[test]
    fn whole_body_solvers_narrow_their_gate_and_assign_less_often() {
        let config = Config::default();
        for kind in [SolverKind::Chain, SolverKind::Tree] {
            let schedule = solver(kind).schedule(&config);
            assert!(schedule.whole_body);
            assert_eq!(schedule.gate(0).distance, config.gate_start);
            assert!((1..40).all(|step| schedule.gate(step).distance <= schedule.gate(step - 1).distance));
            assert_eq!(schedule.gate(40).distance, config.gate_end);
            let anew: Vec<bool> = (0..7).map(|step| schedule.reassociates(step)).collect();
            assert_eq!(anew, [true, true, true, false, true, false, true]);
        }
    }

    #[test]
    fn no_number_of_steps_overflows() {
        assert_eq!(narrowed(0.3, 0.1, usize::MAX), 0.1);
    }
}
