//! Lengths that a detector tells of a body it found, look by look: of a sitter it knows less than of who stands.

use super::girth::ALIKE;
use crate::body::Body;
use crate::detect::LENGTHS;

/// Joints by which limbs of those lengths hang on their parents; the trunk is made of what hangs elsewhere.
const HANGS_BY: [(&str, &str); 6] = [
    ("sternoclavicular", "shoulder_width"),
    ("shoulder", "upper_arm"),
    ("elbow", "forearm"),
    ("hip", "thigh"),
    ("knee", "shank"),
    ("vc7", "neck"),
];
const TRUNK: &str = "trunk";
/// The sizes are known when the stature is, to this share of it: of sitters and who bend it is known to 4 to 6 %, of others to 2.
const KNOWN: f64 = 0.03;
/// Logarithms of lengths, as in [`LENGTHS`].
#[derive(Debug, Default)]
pub(super) struct Told {
    /// Of the look that set the sizes.
    set: [f64; LENGTHS.len()],
    /// Of all looks, and the information of the surest of them.
    mean: [f64; LENGTHS.len()],
    information: [f64; LENGTHS.len()],
}

impl Told {
    /// Forgets everything.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }

    /// Takes a look in: lengths, and their relative standard deviations. Looks at one person err alike, so that all before count
    /// as much as the surest of them.
    pub(super) fn hear(&mut self, lengths: &[[f64; 2]]) {
        for (index, [length, sigma]) in lengths.iter().enumerate().take(LENGTHS.len()) {
            let (length, information, before) = (length.ln(), 1.0 / (sigma * sigma), self.information[index]);
            if before == 0.0 {
                (self.set[index], self.mean[index]) = (length, length);
            }
            self.mean[index] += (length - self.mean[index]) * information / (information + before);
            self.information[index] = information.max(before);
        }
    }

    /// Whether something was told, but nothing that can be relied on.
    pub(super) fn unsure(&self) -> bool {
        let stature = self.information[LENGTHS.len() - 1];
        stature > 0.0 && stature < 1.0 / (KNOWN * KNOWN)
    }

    /// By how much longer a limb is than the sizes were set, as all looks tell, and the information of that against a frame's, whose
    /// points err alike; none of what was not told.
    pub(super) fn of(&self, body: &Body, limb: usize) -> Option<(f64, f64)> {
        let joint = body.limbs()[limb].parent.as_ref().map_or("", |(_, joint)| joint.name.as_str());
        let stem = joint.trim_start_matches("l_").trim_start_matches("r_");
        let name = HANGS_BY.iter().find(|(by, _)| *by == stem).map_or(TRUNK, |(_, name)| name);
        let index = LENGTHS.iter().position(|length| *length == name).filter(|index| self.information[*index] > 0.0)?;
        Some(((self.mean[index] - self.set[index]).exp(), ALIKE * self.information[index]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::HumanModel;

    /// What is told of the thigh after looks at somebody: factor and information, and whether it is unsure.
    fn heard(looks: &[[f64; 2]]) -> (f64, f64, bool) {
        let body = Body::human(1.75, HumanModel::Full).unwrap_or_else(|error| unreachable!("{error}"));
        let mut told = Told::default();
        assert!(!told.unsure(), "nobody was found");
        looks.iter().for_each(|look| told.hear(&[*look; LENGTHS.len()]));
        let of = |limb| body.limb_index(limb).ok().and_then(|limb| told.of(&body, limb));
        let (factor, information) = of("l_thigh").unwrap_or((f64::NAN, f64::NAN));
        assert_eq!(of("pelvis"), of("thorax"));
        (factor, information, told.unsure())
    }

    #[test]
    fn who_stands_up_is_as_tall_as_the_surer_looks_say_and_looks_that_follow_are_worth_no_more() {
        let (sitting, standing) = ([1.0, 0.05], [0.9, 0.02]);
        let (factor, information, unsure) = heard(&[sitting; 9]);
        assert!((factor - 1.0).abs() < 1e-12 && (information - ALIKE / 0.0025).abs() < 1e-6 && unsure);
        let mut looks = vec![sitting; 9];
        looks.extend([standing; 2]);
        let (factor, information, unsure) = heard(&looks);
        assert!((0.9..0.91).contains(&factor) && (information - ALIKE / 0.0004).abs() < 1e-6 && !unsure, "{factor}");
        looks.push(sitting);
        let (again, after, unsure) = heard(&looks);
        assert!(again - factor < 0.02 && after == information && !unsure, "{again} after {factor}");
    }

    #[test]
    fn of_what_was_not_told_nothing_is_known() {
        let (factor, ..) = heard(&[]);
        assert!(factor.is_nan());
    }
}
