//! History of each arm and leg over frames.

use super::objective::MARGIN;

/// Time in which the unexplained patches of a refused test lose half of their weight, seconds.
const HALF_LIFE: f64 = 0.3;

/// History of one arm or leg.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    /// Cost of the unexplained patches near it in this frame; 0 where it does not suffice for a test.
    unexplained: f64,
    /// Cost of the patches that the proposals of earlier frames left unexplained, halved every `HALF_LIFE`. They belong to
    /// something else.
    refused: f64,
}

impl History {
    /// Updates with the cost of the unexplained patches near the arm or leg, `elapsed` seconds after the last frame.
    /// Returns whether to test alternatives: enough is unexplained, and twice what was refused. To be called in every frame.
    pub(super) fn observe(&mut self, unexplained: f64, elapsed: f64) -> bool {
        self.refused *= (-elapsed / HALF_LIFE).exp2();
        self.unexplained = if unexplained < MARGIN { 0.0 } else { unexplained };
        self.unexplained > 2.0 * self.refused
    }

    /// Records that no alternative explains what is unexplained in this frame.
    pub(super) fn refuse(&mut self) {
        self.refused = self.unexplained;
    }

    /// Forgets what was refused, because there is new evidence.
    pub(super) fn reconsider(&mut self) {
        self.refused = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_refused_is_tested_again_when_twice_as_much_is_unexplained_or_after_its_half_life() {
        let mut history = History::default();
        assert!(!history.observe(MARGIN - 1.0, 0.03));
        assert!(history.observe(MARGIN, 0.03));
        history.refuse();
        assert!(!history.observe(MARGIN, 0.03), "nothing has changed");
        assert!(history.observe(2.0 * MARGIN, 0.03), "more is unexplained");
        history.refuse();
        let tested = (0..10).position(|_| history.observe(2.0 * MARGIN, 0.25 * HALF_LIFE + 1e-6));
        assert_eq!(tested, Some(3), "a half-life has passed");
        history.refuse();
        history.reconsider();
        assert!(history.observe(MARGIN, 0.0));
    }
}
