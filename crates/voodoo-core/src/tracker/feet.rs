//! Where the feet stand, and for how long.

use super::Tracker;
use crate::geometry::Vec3;
use crate::terms::Foot;

/// A foot that is farther from its place has made a step, metres.
const STEP: f64 = 0.03;
/// It is sure to stand after so many seconds: one that swings is slow at times, too.
const SURE_AFTER: f64 = 0.67;
/// Time in which the place of one that stands follows it, seconds.
const FOLLOWS: f64 = 0.33;

impl Tracker {
    /// The feet are where they are, and nothing is known of how long they will be.
    pub(super) fn set_feet(&mut self) {
        self.feet.clear();
        for chain in self.chains.iter().filter(|chain| chain.leg) {
            let mut foot = Foot { limb: chain.lower, place: Vec3::ZERO, sure: 0.0 };
            foot.place = foot.at(&self.body, &self.poses);
            self.feet.push(foot);
        }
    }

    /// What the frame tells of where they stand.
    pub(super) fn follow_feet(&mut self) {
        let passed = self.interval.unwrap_or(0.0);
        for foot in &mut self.feet {
            let moved = foot.at(&self.body, &self.poses) - foot.place;
            if moved.length() < STEP {
                foot.place += (passed / FOLLOWS).min(1.0) * moved;
                foot.sure = (foot.sure + passed / SURE_AFTER).min(1.0);
            } else {
                foot.place += moved;
                foot.sure = 0.0;
            }
        }
    }
}
