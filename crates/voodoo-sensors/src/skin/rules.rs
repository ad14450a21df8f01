//! Which skin regions can be which site: what a body allows, whatever lies nearest.

use crate::skin::blobs::{Blob, Sight};
use voodoo_core::math::Vec3;

/// Endings of the names of limbs that show skin.
const BARE_LIMBS: [&str; 5] = ["head", "neck", "upperarm", "forearm", "hand"];
/// Endings of the names of limbs that a hand is on.
const OWN_LIMBS: [&str; 2] = ["forearm", "hand"];
/// What is nearer to the bare limbs than this may be theirs, meters.
const BARE: f32 = 0.08;
/// A hand before trunk or legs stands out from them by as much, meters; a stripe of a shirt does not.
const STANDS_OUT: f32 = 0.02;
/// A hand is no nearer to an elbow that is seen than this share of its forearm.
const NEAREST_HAND: f64 = 0.6;
/// And not this much farther, meters.
const FARTHEST_HAND: f64 = 0.10;
/// What is no farther than this from a limb may be its surface, meters.
const ON_LIMB: f32 = 0.03;
/// And is, if it is this much farther from another limb, meters.
const OFF_LIMB: f32 = 0.06;
/// A hand is no farther from its shoulder than this share of its arm...
const ARM_FRACTION: f64 = 1.2;
/// ... and so much more, meters: room for a model that is not where the person is.
const ARM_ROOM: f64 = 0.15;
/// From the wrist to the fingertips, meters.
const HAND_LENGTH: f64 = 0.18;
/// How far the middle of a hand with its fingers is beyond the middle of the palm, meters.
const FINGERS: f64 = 0.015;

/// A site that skin is looked for at, where the body is expected.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Its number.
    pub site: usize,
    /// Whether it is the head's, not a hand's.
    pub head: bool,
    /// Where it is expected, meters.
    pub place: Vec3,
    /// Shoulder, elbow and hand of its side.
    pub arm: [Option<Vec3>; 3],
    /// Other sensors do not show its limb where the body has it.
    pub arm_lost: bool,
    /// They show its upper arm there.
    pub upper_arm_visible: bool,
}

impl Expected {
    fn elbow(&self) -> Option<Vec3> {
        self.arm[1]
    }

    /// How far a hand can be from its shoulder, meters.
    fn reach(&self) -> f64 {
        match self.arm {
            [Some(shoulder), Some(elbow), Some(hand)] => {
                ARM_FRACTION * (elbow.distance(shoulder) + hand.distance(elbow)) + ARM_ROOM
            }
            _ => f64::INFINITY,
        }
    }

    /// From the middle of a hand with its fingers to the hand's site, meters; zero for a head or without an elbow.
    pub(super) fn to_palm(self) -> Vec3 {
        match self.elbow() {
            Some(elbow) if !self.head => {
                let forearm = self.place - elbow;
                -FINGERS * forearm / forearm.length().max(FINGERS)
            }
            _ => Vec3::ZERO,
        }
    }
}

/// Distances of all sights from the surfaces of limbs, by the limbs' names, meters.
#[derive(Clone, Debug, Default)]
pub struct LimbDistances {
    /// Names, such as `l_forearm`.
    pub names: Vec<String>,
    /// Limb by limb, a sight each.
    pub away: Vec<f32>,
}

impl LimbDistances {
    /// Of a sight from the nearest of the limbs that are chosen; infinite without any.
    pub(super) fn least(&self, sight: usize, chosen: impl Fn(&str) -> bool) -> f32 {
        let count = self.away.len() / self.names.len().max(1);
        let limbs = self.names.iter().enumerate().filter(|(_, name)| chosen(name));
        limbs.fold(f32::INFINITY, |least, (limb, _)| least.min(self.away[limb * count + sight]))
    }

    /// The same of all limbs; zero where nothing is known of any.
    pub(super) fn nearest(&self, sight: usize) -> f32 {
        if self.names.is_empty() { 0.0 } else { self.least(sight, |_| true) }
    }
}

fn is_bare(limb: &str) -> bool {
    BARE_LIMBS.iter().any(|ending| limb.ends_with(ending))
}

/// What is known of the sights of a picture.
#[derive(Clone, Copy, Debug)]
pub(super) struct SightContext<'a> {
    pub sights: &'a [Sight],
    /// Theirs.
    pub blobs: &'a [Blob],
    /// Which are too small for a hand.
    pub specks: &'a [bool],
    pub limbs: &'a LimbDistances,
    /// What is farther from the body than this, meters, it does not explain.
    pub unexplained: f32,
}

impl SightContext<'_> {
    /// Of every sight: 0 it cannot be the site, 1 only near to where it is expected, 2 wherever it can reach. `inside` is where the
    /// site is if a sight is its surface.
    ///
    /// A site that was not seen is taken up far from where it is expected only in a region that no other site has, which is no
    /// speck, and which the body does not explain where it is thought to be. A hand whose forearm is lost may also hang before trunk
    /// or legs: those have no skin to show.
    pub(super) fn allowed(&self, site: &Expected, inside: &[Vec3]) -> Vec<u8> {
        let owned = |region| self.blobs.iter().any(|blob| blob.label.is_some() && blob.sight.region == region);
        let has_bare = self.limbs.names.iter().any(|name| is_bare(name));
        let mut allowed: Vec<u8> = Vec::with_capacity(self.sights.len());
        for (index, sight) in self.sights.iter().enumerate() {
            let away = self.limbs.nearest(index);
            let outside = away > self.unexplained;
            let bare = if has_bare { self.limbs.least(index, is_bare) } else { away };
            let dressed = bare > BARE && away > STANDS_OUT;
            let free = !self.specks[index] && sight.deep && !owned(sight.region);
            let far = free && (outside || (dressed && site.arm_lost));
            allowed.push(if sight.still && outside { 0 } else { 1 + u8::from(far) });
        }
        if !site.head {
            let ends = self.ends(site);
            for (index, sight) in self.sights.iter().enumerate() {
                if !(sight.hand && within_arm(site, sight, inside[index]) && ends[index]) {
                    allowed[index] = 0;
                }
            }
        }
        allowed
    }

    /// False for those ends of a bare forearm that are nearer to its elbow than another end of the same region, both for where the
    /// hand is expected, and, if its arm is lost, for anywhere.
    fn ends(&self, site: &Expected) -> Vec<bool> {
        let Some(elbow) = site.elbow() else { return vec![true; self.sights.len()] };
        let far = |sight: &Sight| -sight.place.distance(elbow);
        let mut ends = self.hand_ends(|sight| sight.place.distance(site.place) + far(sight));
        if site.arm_lost {
            // Nothing speaks for where the hand is expected, but it may be there all the same.
            ends.iter_mut().zip(self.hand_ends(far)).for_each(|(end, other)| *end |= other);
        }
        ends
    }

    fn hand_ends(&self, towards: impl Fn(&Sight) -> f64) -> Vec<bool> {
        let least = |region: i32| {
            let others = self.sights.iter().filter(|other| other.hand && other.region == region);
            others.map(&towards).fold(f64::INFINITY, f64::min)
        };
        self.sights.iter().map(|sight| towards(sight) <= least(sight.region)).collect()
    }

    /// Of every sight whether it is the surface of a limb other than a hand's own forearm, of a bare one if that is lost. `side` is
    /// what the names of the hand's limbs begin with.
    pub(super) fn elsewhere(&self, site: &Expected, side: &str) -> Vec<bool> {
        let own = |name: &str| name.starts_with(side) && OWN_LIMBS.iter().any(|ending| name.ends_with(ending));
        if site.head || !self.limbs.names.iter().any(|name| own(name)) {
            return vec![false; self.sights.len()];
        }
        let other = |name: &str| !own(name) && (!site.arm_lost || is_bare(name));
        let judge = |(index, sight): (usize, &Sight)| {
            let others = self.limbs.least(index, other);
            sight.deep && others < ON_LIMB && self.limbs.least(index, own) > others + OFF_LIMB
        };
        self.sights.iter().enumerate().map(judge).collect()
    }
}

/// Whether a hand can be at a sight by how far it is from shoulder and elbow; without depth that is not known.
fn within_arm(site: &Expected, sight: &Sight, inside: Vec3) -> bool {
    if !sight.deep {
        return true;
    }
    let reaches = site.arm[0].is_none_or(|shoulder| sight.place.distance(shoulder) < site.reach());
    let elbow = site.elbow().filter(|_| site.upper_arm_visible);
    reaches
        && elbow.is_none_or(|elbow| {
            // What is much nearer is the forearm's middle, with the hand in the shade or cut off.
            let (apart, forearm) = (inside.distance(elbow), site.place.distance(elbow));
            let most = if site.arm_lost { f64::INFINITY } else { forearm + FARTHEST_HAND };
            NEAREST_HAND * forearm < apart && apart < most
        })
}

/// Where the middle of a hand is whose region is at `place` and which may be in pieces: something lies across it, or is behind it and
/// of its color. It is then anywhere between two pieces that are no farther apart than a hand is long: of those places, the one
/// nearest to where it is expected.
pub(super) fn of_pieces(place: Vec3, pieces: impl Iterator<Item = Vec3>, expected: Vec3) -> Vec3 {
    let mut nearest = place;
    for piece in pieces {
        let across = piece - place;
        let span = across.length_squared();
        if 0.0 < span && span < HAND_LENGTH * HAND_LENGTH {
            let fraction = ((expected - place).dot(across) / span).clamp(0.0, 1.0);
            let between = place + fraction * across;
            if between.distance(expected) < nearest.distance(expected) {
                nearest = between;
            }
        }
    }
    nearest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_in_pieces_is_where_it_is_expected_between_them() {
        let [fingers, palm, far] = [0.9, 1.0, 1.2].map(|z| Vec3::new(2.0, 0.0, z));
        let middle = of_pieces(fingers, [palm, far].into_iter(), Vec3::new(2.05, 0.0, 0.97));
        assert!((middle - Vec3::new(2.0, 0.0, 0.97)).length() < 1e-9);
        assert_eq!(of_pieces(fingers, [far].into_iter(), palm), fingers, "no hand is that long");
        assert_eq!(of_pieces(fingers, [palm].into_iter(), Vec3::new(2.0, 0.0, 0.5)), fingers, "not beyond the pieces");
    }

    #[test]
    fn a_hands_middle_lies_beyond_its_palm() {
        let (place, elbow) = (Vec3::new(2.0, 0.0, 1.0), Some(Vec3::new(2.0, 0.0, 1.3)));
        let hand = Expected {
            site: 1,
            head: false,
            place,
            arm: [None, elbow, Some(place)],
            arm_lost: false,
            upper_arm_visible: false,
        };
        assert!((hand.to_palm() - Vec3::new(0.0, 0.0, FINGERS)).length() < 1e-9);
        assert_eq!(Expected { head: true, ..hand }.to_palm(), Vec3::ZERO);
        assert_eq!(Expected { arm: [None; 3], ..hand }.to_palm(), Vec3::ZERO, "without an elbow");
    }

    #[test]
    fn what_lies_on_another_limb_is_no_hand() {
        let sight = Sight { direction: Vec3::X, place: Vec3::X, deep: true, hand: true, region: 1, still: false };
        let names = ["thorax", "l_forearm", "head"].map(String::from).to_vec();
        let limbs = LimbDistances { names, away: vec![0.0, 0.5, 0.2, 0.01, 0.4, 0.0] };
        let sight_context =
            SightContext { sights: &[sight; 2], blobs: &[], specks: &[false; 2], limbs: &limbs, unexplained: 0.06 };
        let site = Expected {
            site: 0,
            head: false,
            place: Vec3::X,
            arm: [None; 3],
            arm_lost: false,
            upper_arm_visible: false,
        };
        assert_eq!(sight_context.elsewhere(&site, "l"), [true, false]);
        assert_eq!(sight_context.elsewhere(&site, "r"), [false, false], "it has no forearm");
        let lost = Expected { arm_lost: true, ..site };
        assert_eq!(sight_context.elsewhere(&lost, "l"), [false, false], "a thorax shows no skin");
        assert_eq!(sight_context.allowed(&site, &[Vec3::X; 2]), [1, 1]);
        assert_eq!(SightContext { unexplained: -0.1, ..sight_context }.allowed(&site, &[Vec3::X; 2]), [2, 2]);
    }
}
