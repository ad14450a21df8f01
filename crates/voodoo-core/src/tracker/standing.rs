//! Which ends of arms and legs stand still.

use super::Tracker;
use crate::geometry::Vec3;
use crate::terms::Stand;

/// A joint that is farther from where it stood has moved on, metres.
const LEFT: f64 = 0.04;
/// A joint is sure to stand after this many frames, about.
const SETTLED: f64 = 0.2;
/// Share of the new place in where it stood.
const FOLLOWED: f64 = 0.1;

impl Tracker {
    /// Follows the places that stand.
    pub(super) fn stand(&mut self) {
        if self.stands.len() != self.chains.len() {
            self.stands.clear();
            self.stands.extend(self.chains.iter().map(|chain| {
                let place = Vec3::new(0.0, 0.0, self.body.limbs()[chain.lower].shape.length());
                Stand { limb: chain.lower, place, stood: self.poses[chain.lower] * place, weight: 0.0 }
            }));
        }
        for stand in &mut self.stands {
            stand.place.z = self.body.limbs()[stand.limb].shape.length();
            let now = self.poses[stand.limb] * stand.place;
            if (now - stand.stood).length() > LEFT {
                (stand.stood, stand.weight) = (now, 0.0);
            } else {
                stand.stood += FOLLOWED * (now - stand.stood);
                stand.weight += SETTLED * (1.0 - stand.weight);
            }
            if std::env::var("ARMS").is_err() && !self.body.limbs()[stand.limb].name.contains("calf") { stand.weight = 0.0; }
        }
    }
}
