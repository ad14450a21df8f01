//! Named sites from frame to frame: gating of their measurements.

use std::collections::BTreeMap;

/// Accepts measurements near predicted sites. The gate widens slowly while no measurement is accepted.
#[derive(Clone, Debug, PartialEq)]
pub struct SiteGate {
    /// Initial radius, meters.
    pub radius: f64,
    /// Growth of the radius while no measurement is accepted, meters per second.
    pub growth: f64,
    /// Maximum radius, meters.
    pub widest: f64,
    /// For each source and site, the time when a measurement was last accepted, or else first expected, seconds.
    last: BTreeMap<String, BTreeMap<String, f64>>,
}

impl SiteGate {
    /// Resets the gates: no measurement accepted yet.
    pub fn new(radius: f64, growth: f64, widest: f64) -> Self {
        Self { radius, growth, widest, last: BTreeMap::new() }
    }

    /// Radius of a site's gate at a given time, meters.
    pub fn limit(&mut self, site: &str, source: &str, stamp: f64) -> f64 {
        let waited = (stamp - *self.last(site, source, stamp)).max(0.0);
        (self.radius + self.growth * waited).min(self.widest)
    }

    /// Whether a measurement at this distance from the predicted site is inside the gate.
    pub fn accepts(&mut self, site: &str, distance: f64, stamp: f64, source: &str) -> bool {
        let near = distance <= self.limit(site, source, stamp);
        if near {
            *self.last(site, source, stamp) = stamp;
        }
        near
    }

    /// The time from which the gate of a site widens; `stamp` if the site was not expected before.
    fn last(&mut self, site: &str, source: &str, stamp: f64) -> &mut f64 {
        self.last.entry(source.to_owned()).or_default().entry(site.to_owned()).or_insert(stamp)
    }
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
}
