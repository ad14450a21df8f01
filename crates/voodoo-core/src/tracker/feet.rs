//! Where the feet stand.

use super::Tracker;
use crate::terms::Foot;

/// A foot that is farther from its place has made a step, metres.
const STEP: f64 = 0.03;
/// The place of one that stands follows it by this share in a frame.
const FOLLOWS: f64 = 0.1;

impl Tracker {
    /// All feet stand where they are.
    pub(super) fn set_feet(&mut self) {
        self.feet.clear();
        for chain in self.chains.iter().filter(|chain| chain.leg) {
            let mut foot = Foot { limb: chain.lower, place: Default::default() };
            foot.place = foot.at(&self.body, &self.poses);
            self.feet.push(foot);
        }
    }

    /// What the frame tells of where they stand.
    pub(super) fn follow_feet(&mut self) {
        for foot in &mut self.feet {
            let moved = foot.at(&self.body, &self.poses) - foot.place;
            foot.place += if moved.length() > STEP { moved } else { FOLLOWS * moved };
        }
    }
}
