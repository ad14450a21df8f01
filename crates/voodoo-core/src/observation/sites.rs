//! Named sites from frame to frame: where they will be, which measurements of them are believed, and rays on which they were seen.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::math::Vec3;

/// Where sites will be: the last estimate moved on by a share of its velocity.
#[derive(Clone, Debug, PartialEq)]
pub struct SiteMotion {
    /// 0 predicts rest, 1 constant velocity.
    pub share: f64,
    /// A faster estimate is a jump and predicts rest, metres a second.
    pub max_speed: f64,
    /// Shared by all frames of a body.
    names: Arc<[String]>,
    stamp: f64,
    positions: Vec<[f64; 3]>,
    velocity: Vec<[f64; 3]>,
}

impl SiteMotion {
    /// No estimate yet.
    pub fn new(share: f64, max_speed: f64) -> Self {
        let (positions, velocity) = Default::default();
        Self { share, max_speed, names: Arc::new([]), stamp: f64::NAN, positions, velocity }
    }

    /// Names of the sites of the last estimate.
    pub fn names(&self) -> &Arc<[String]> {
        &self.names
    }

    /// Takes up an estimate's positions, metres; a stamp that is NaN forgets the velocity.
    pub fn update(&mut self, stamp: f64, names: Arc<[String]>, positions: Vec<[f64; 3]>) {
        let interval = stamp - self.stamp;
        let before = |index: usize, name: &String| {
            let same = self.names.get(index) == Some(name);
            let known = if same { Some(index) } else { self.names.iter().position(|other| other == name) };
            known.and_then(|known| self.positions.get(known))
        };
        let velocity = |(index, (name, place)): (usize, (&String, &[f64; 3]))| {
            // A site that is new has none.
            let before = before(index, name).filter(|_| interval > 0.0)?;
            let velocity = Vec3::from_array([0, 1, 2].map(|axis| (place[axis] - before[axis]) / interval));
            (velocity.length() <= self.max_speed).then_some(velocity.to_array())
        };
        let sites = names.iter().zip(&positions).enumerate();
        self.velocity = sites.map(|site| velocity(site).unwrap_or_default()).collect();
        (self.stamp, self.names, self.positions) = (stamp, names, positions);
    }

    /// All positions at a time, metres.
    pub fn at(&self, stamp: f64) -> Vec<[f64; 3]> {
        let elapsed = if self.stamp.is_finite() { self.share * (stamp - self.stamp) } else { 0.0 };
        let moved =
            |(place, velocity): (&[f64; 3], &[f64; 3])| [0, 1, 2].map(|axis| place[axis] + elapsed * velocity[axis]);
        self.positions.iter().zip(&self.velocity).map(moved).collect()
    }
}

/// Accepts measurements near predicted sites, and opens slowly while nothing is accepted.
#[derive(Clone, Debug, PartialEq)]
pub struct SiteGate {
    /// Metres.
    pub radius: f64,
    /// Of the radius while nothing is accepted, metres a second.
    pub growth: f64,
    /// It grows up to this, metres.
    pub widest: f64,
    /// Of each source and site when something was accepted last, or first looked for, seconds.
    last: BTreeMap<String, BTreeMap<String, f64>>,
}

impl SiteGate {
    /// Nothing accepted yet.
    pub fn new(radius: f64, growth: f64, widest: f64) -> Self {
        Self { radius, growth, widest, last: BTreeMap::new() }
    }

    /// Radius of a site's gate at a time, metres.
    pub fn limit(&mut self, site: &str, source: &str, stamp: f64) -> f64 {
        let known = self.last.get(source).and_then(|sites| sites.get(site)).copied();
        let waited = match known {
            Some(last) => (stamp - last).max(0.0),
            None => {
                self.remember(site, source, stamp);
                0.0
            }
        };
        (self.radius + self.growth * waited).min(self.widest)
    }

    /// Whether a measurement so far from the predicted site, metres, is near enough.
    pub fn accepts(&mut self, site: &str, distance: f64, stamp: f64, source: &str) -> bool {
        let near = distance <= self.limit(site, source, stamp);
        if near {
            self.remember(site, source, stamp);
        }
        near
    }

    fn remember(&mut self, site: &str, source: &str, stamp: f64) {
        match self.last.get_mut(source).and_then(|sites| sites.get_mut(site)) {
            Some(last) => *last = stamp,
            None => {
                self.last.entry(source.to_owned()).or_default().insert(site.to_owned(), stamp);
            }
        }
    }
}

/// A site was seen on a ray.
#[derive(Clone, Debug, PartialEq)]
pub struct SiteRay {
    /// Its name.
    pub site: String,
    /// Focal point in the world, metres.
    pub origin: Vec3,
    /// Unit vector in the world.
    pub direction: Vec3,
    /// Standard deviation across the ray at the site, metres.
    pub sigma: f64,
    /// Name of what saw it.
    pub source: String,
    /// Factor of its weight, in [0, 1].
    pub trust: f64,
    /// It may always be this far off, metres.
    pub bias: f64,
    /// Where on the ray the site is, if a depth camera saw it, metres.
    pub place: Option<Vec3>,
    /// Standard deviation of that along the ray, metres.
    pub place_sigma: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_gate_opens_while_nothing_passes_and_closes_again() {
        let mut gate = SiteGate::new(0.1, 1.0, 0.25);
        assert!(!gate.accepts("l_wrist", 0.15, 0.0, "camera"));
        assert!(gate.accepts("l_wrist", 0.15, 0.1, "camera") && !gate.accepts("l_wrist", 0.15, 0.11, "camera"));
        assert!(!gate.accepts("l_wrist", f64::NAN, 0.1, "camera"));
        assert_eq!(gate.limit("l_wrist", "camera", 100.0), 0.25);
        assert_eq!(gate.limit("r_wrist", "camera", 0.1), 0.1, "each site has its own");
        let opened = |gate: &mut SiteGate, site| gate.limit(site, "camera", 0.2);
        assert!((opened(&mut gate, "l_wrist") - 0.2).abs() < 1e-12, "from the last one accepted");
        assert!((opened(&mut gate, "r_wrist") - 0.2).abs() < 1e-12, "from the first one looked for");
    }

    #[test]
    fn sites_move_on_by_name_and_jumps_are_forgotten() {
        let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Arc<[_]>>();
        let mut motion = SiteMotion::new(0.5, 8.0);
        motion.update(f64::NAN, names(&["hand"]), vec![[0.0; 3]]);
        assert_eq!(motion.at(5.0), [[0.0; 3]]);
        motion.update(0.0, names(&["hand"]), vec![[0.0; 3]]);
        motion.update(0.1, names(&["foot", "hand"]), vec![[1.0; 3], [0.1, 0.0, 0.0]]);
        let [foot, hand] = motion.at(0.2)[..] else { panic!("two sites") };
        assert!(foot == [1.0; 3] && (hand[0] - 0.15).abs() < 1e-12);
        motion.update(0.2, names(&["foot", "hand"]), vec![[1.0; 3], [2.0, 0.0, 0.0]]);
        assert_eq!(motion.at(0.3), [[1.0; 3], [2.0, 0.0, 0.0]]);
    }
}
