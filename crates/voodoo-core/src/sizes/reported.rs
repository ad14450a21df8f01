//! Lengths of limbs and stature that a detector reports, averaged over detections. They are less precise for a sitting person
//! than for a standing one.

use crate::detect::{Detected, JointMap};

/// Relative standard deviation of the stature below which the sizes count as known. The detector reports 4 to 6 % for persons who
/// sit or bend, 2 % for others.
const KNOWN: f64 = 0.03;

/// Running estimates of the logarithms of lengths, in the detector's order.
#[derive(Debug, Default)]
pub(crate) struct ReportedLengths(Vec<LengthEstimate>);

/// Estimate of the logarithm of one length. Errors of detections of one person are correlated, so all detections together have only
/// the information of the most precise one.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct LengthEstimate {
    /// Value of the first detection, from which the sizes were set.
    set: f64,
    /// Mean over all detections.
    pub(crate) mean: f64,
    /// Information of the most precise detection; 0 before the first one.
    pub(crate) information: f64,
}

impl LengthEstimate {
    /// Updates the estimate with a length, meters, and its relative standard deviation.
    pub(crate) fn update(&mut self, [length, sigma]: [f64; 2]) {
        let (length, information, before) = (length.ln(), 1.0 / (sigma * sigma), self.information);
        if before == 0.0 {
            (self.set, self.mean) = (length, length);
        }
        self.mean += (length - self.mean) * information / (information + before);
        self.information = information.max(before);
    }
}

impl ReportedLengths {
    /// Updates the estimates with the lengths of a detection and their relative standard deviations.
    pub(crate) fn update(&mut self, detected: Detected) {
        let (Self(lengths), reported) = (self, &detected.detection.lengths);
        lengths.resize(lengths.len().max(reported.len()), LengthEstimate::default());
        lengths.iter_mut().zip(reported).for_each(|(known, reported)| known.update(*reported));
    }

    /// Whether the stature was reported, but with a standard deviation above `KNOWN`.
    pub(crate) fn is_uncertain(&self, map: &JointMap) -> bool {
        let stature = map.stature.and_then(|stature| self.0.get(stature));
        stature.is_some_and(|stature| stature.information > 0.0 && stature.information < 1.0 / (KNOWN * KNOWN))
    }

    /// Returns the ratio of a limb's mean reported length to the length from which the sizes were set, and the standard
    /// deviation of that ratio. `None` if the length was not reported.
    pub(super) fn factor(&self, map: &JointMap, limb: usize) -> Option<(f64, f64)> {
        let known = self.0.get(map.length_of_limb(limb)?)?;
        (known.information > 0.0).then(|| ((known.mean - known.set).exp(), known.information.powf(-0.5)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{Body, HumanModel};
    use crate::detect::Detection;

    /// Factor of the thigh and its standard deviation after detections of one person, and whether the sizes are uncertain.
    fn reported(detections: &[[f64; 2]]) -> (f64, f64, bool) {
        let body = Body::human(1.75, HumanModel::Full).unwrap_or_else(|error| unreachable!("{error}"));
        let names = ["stature", "thigh", "trunk"].map(String::from);
        let map = JointMap::new(&body, &[], &names);
        let mut lengths = ReportedLengths::default();
        assert!(!lengths.is_uncertain(&map), "nobody was found");
        for given in detections {
            let detection = Detection { lengths: vec![*given; names.len()], ..Detection::default() };
            lengths.update(Detected { detection: &detection, map: &map });
        }
        let factor_of = |limb| body.limb_index(limb).ok().and_then(|limb| lengths.factor(&map, limb));
        let (factor, sigma) = factor_of("l_thigh").unwrap_or((f64::NAN, f64::NAN));
        assert_eq!(factor_of("pelvis"), factor_of("thorax"));
        assert_eq!(factor_of("l_calf"), None, "no shank is reported");
        (factor, sigma, lengths.is_uncertain(&map))
    }

    #[test]
    fn who_stands_up_is_as_tall_as_the_surer_detections_report_and_later_ones_that_follow_are_worth_no_more() {
        let (sitting, standing) = ([1.0, 0.05], [0.9, 0.02]);
        let (factor, sigma, uncertain) = reported(&[sitting; 9]);
        assert!((factor - 1.0).abs() < 1e-12 && (sigma - 0.05).abs() < 1e-9 && uncertain);
        let mut detections = vec![sitting; 9];
        detections.extend([standing; 2]);
        let (factor, sigma, uncertain) = reported(&detections);
        assert!((0.9..0.91).contains(&factor) && (sigma - 0.02).abs() < 1e-9 && !uncertain, "{factor}");
        detections.push(sitting);
        let (again, after, uncertain) = reported(&detections);
        assert!(again - factor < 0.02 && after == sigma && !uncertain, "{again} after {factor}");
    }

    #[test]
    fn of_what_was_not_reported_nothing_is_known() {
        let (factor, ..) = reported(&[]);
        assert!(factor.is_nan());
    }
}
