//! Lengths that a detector reports of a body it found, look by look: of a sitter it knows less than of who stands.

use super::girth::ALIKE;
use crate::detect::{Detected, JointMap};

/// The sizes are known when the stature is, to this share of it: of sitters and who bend it is known to 4 to 6 %, of others to 2.
const KNOWN: f64 = 0.03;

/// Logarithms of lengths, numbered as the detector does.
#[derive(Debug, Default)]
pub(super) struct ReportedLengths {
    lengths: Vec<LengthEstimate>,
    /// The length of every limb, and which one is the stature.
    of_limb: Vec<Option<usize>>,
    stature: Option<usize>,
}

/// One of them.
#[derive(Clone, Copy, Debug, Default)]
struct LengthEstimate {
    /// Of the look that set the sizes.
    set: f64,
    /// Of all looks, and the information of the surest of them.
    mean: f64,
    information: f64,
}

impl ReportedLengths {
    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Takes a detection in: lengths, and their relative standard deviations. Looks at one person err alike, so that all before count
    /// as much as the surest of them.
    pub(super) fn update(&mut self, detected: Detected) {
        let reported = &detected.detection.lengths;
        self.lengths.resize(self.lengths.len().max(reported.len()), LengthEstimate::default());
        for ([length, sigma], known) in reported.iter().zip(&mut self.lengths) {
            let (length, information, before) = (length.ln(), 1.0 / (sigma * sigma), known.information);
            if before == 0.0 {
                (known.set, known.mean) = (length, length);
            }
            known.mean += (length - known.mean) * information / (information + before);
            known.information = information.max(before);
        }
        self.bind(detected.map);
    }

    /// The body's limbs are numbered anew.
    pub(super) fn bind(&mut self, map: &JointMap) {
        self.of_limb.clear();
        self.of_limb.extend_from_slice(map.length_of_limb());
        self.stature = map.stature();
    }

    /// Whether the stature was reported, but not so that it can be relied on.
    pub(super) fn is_uncertain(&self) -> bool {
        let stature = self.stature.and_then(|stature| self.lengths.get(stature));
        stature.is_some_and(|stature| stature.information > 0.0 && stature.information < 1.0 / (KNOWN * KNOWN))
    }

    /// By how much longer a limb is than the sizes were set, as all looks report, and the information of that against a frame's, whose
    /// points err alike; none of what was not reported.
    pub(super) fn factor(&self, limb: usize) -> Option<(f64, f64)> {
        let known = self.lengths.get(self.of_limb.get(limb).copied().flatten()?)?;
        (known.information > 0.0).then(|| ((known.mean - known.set).exp(), ALIKE * known.information))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, HumanModel};
    use crate::detect::Detection;

    /// What is reported of the thigh after looks at somebody: factor and information, and whether the sizes are uncertain.
    fn reported(detections: &[[f64; 2]]) -> (f64, f64, bool) {
        let body = Body::human(1.75, HumanModel::Full).unwrap_or_else(|error| unreachable!("{error}"));
        let names = ["stature", "thigh", "trunk"].map(String::from);
        let map = JointMap::new(&body, &[], &names);
        let mut lengths = ReportedLengths::default();
        assert!(!lengths.is_uncertain(), "nobody was found");
        for given in detections {
            let detection = Detection { lengths: vec![*given; names.len()], ..Detection::default() };
            lengths.update(Detected { detection: &detection, map: &map });
        }
        let factor_of = |limb| body.limb_index(limb).ok().and_then(|limb| lengths.factor(limb));
        let (factor, information) = factor_of("l_thigh").unwrap_or((f64::NAN, f64::NAN));
        assert_eq!(factor_of("pelvis"), factor_of("thorax"));
        assert_eq!(factor_of("l_calf"), None, "no shank is reported");
        (factor, information, lengths.is_uncertain())
    }

    #[test]
    fn who_stands_up_is_as_tall_as_the_surer_detections_report_and_later_ones_that_follow_are_worth_no_more() {
        let (sitting, standing) = ([1.0, 0.05], [0.9, 0.02]);
        let (factor, information, uncertain) = reported(&[sitting; 9]);
        assert!((factor - 1.0).abs() < 1e-12 && (information - ALIKE / 0.0025).abs() < 1e-6 && uncertain);
        let mut detections = vec![sitting; 9];
        detections.extend([standing; 2]);
        let (factor, information, uncertain) = reported(&detections);
        assert!((0.9..0.91).contains(&factor) && (information - ALIKE / 0.0004).abs() < 1e-6 && !uncertain, "{factor}");
        detections.push(sitting);
        let (again, after, uncertain) = reported(&detections);
        assert!(again - factor < 0.02 && after == information && !uncertain, "{again} after {factor}");
    }

    #[test]
    fn of_what_was_not_reported_nothing_is_known() {
        let (factor, ..) = reported(&[]);
        assert!(factor.is_nan());
    }
}
