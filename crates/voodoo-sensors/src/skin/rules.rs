//! Which skin regions can be which site: anatomical constraints, regardless of the nearest region.

use crate::skin::blobs::{Blob, Sight};
use voodoo_core::math::Vec3;
use voodoo_core::{LimbRole, Side};

/// A region within this distance of the bare limbs may belong to them, meters.
const BARE: f32 = 0.08;
/// A hand before the trunk or the legs is at least this far in front of them, meters; a stripe of a shirt is not.
const STANDS_OUT: f32 = 0.02;
/// Least distance of a hand from a visible elbow, as a fraction of the forearm.
const NEAREST_HAND: f64 = 0.6;
/// Greatest distance beyond the forearm's length, meters.
const FARTHEST_HAND: f64 = 0.10;
/// A region within this distance of a limb may be its surface, meters.
const ON_LIMB: f32 = 0.03;
/// It is the limb's surface if another limb is this much farther away, meters.
const OFF_LIMB: f32 = 0.06;
/// Greatest distance of a hand from its shoulder, as a fraction of the arm's length...
const ARM_FRACTION: f64 = 1.2;
/// ... plus this margin for an error of the estimated pose, meters.
const ARM_ROOM: f64 = 0.15;
/// Length from the wrist to the fingertips, meters.
const HAND_LENGTH: f64 = 0.18;
/// Distance from the center of the palm to the center of a hand with its fingers, meters.
const FINGERS: f64 = 0.015;

/// A site that is searched for, at its predicted position.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Index of the site.
    pub site: usize,
    /// Whether it is the head rather than a hand.
    pub head: bool,
    /// Predicted position, meters.
    pub place: Vec3,
    /// Positions of shoulder, elbow and hand of its side.
    pub arm: [Option<Vec3>; 3],
    /// Whether other sensors do not support the estimated pose of its limb.
    pub arm_lost: bool,
    /// Whether other sensors support the estimated pose of its upper arm.
    pub upper_arm_visible: bool,
}

impl Expected {
    fn elbow(&self) -> Option<Vec3> {
        self.arm[1]
    }

    /// Greatest distance of a hand from its shoulder, meters.
    fn reach(&self) -> f64 {
        match self.arm {
            [Some(shoulder), Some(elbow), Some(hand)] => {
                ARM_FRACTION * (elbow.distance(shoulder) + hand.distance(elbow)) + ARM_ROOM
            }
            _ => f64::INFINITY,
        }
    }

    /// Offset from the center of a hand with its fingers to the hand's site, meters; zero for a head or without an elbow.
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

/// Distances of all candidates from the surfaces of limbs, meters.
#[derive(Clone, Debug, Default)]
pub struct LimbDistances {
    /// Roles of the limbs on a human.
    pub roles: Vec<Option<LimbRole>>,
    /// For each limb one distance per candidate.
    pub away: Vec<f32>,
}

impl LimbDistances {
    /// Distance of a candidate from the nearest of the chosen limbs; infinite if none is chosen.
    pub(super) fn least(&self, sight: usize, chosen: impl Fn(Option<LimbRole>) -> bool) -> f32 {
        let count = self.away.len() / self.roles.len().max(1);
        let limbs = self.roles.iter().enumerate().filter(|(_, role)| chosen(**role));
        limbs.fold(f32::INFINITY, |least, (limb, _)| least.min(self.away[limb * count + sight]))
    }

    /// Distance of a candidate from the nearest of all limbs; zero if no distances are known.
    pub(super) fn nearest(&self, sight: usize) -> f32 {
        if self.roles.is_empty() { 0.0 } else { self.least(sight, |_| true) }
    }
}

/// Whether the skin of a limb may be bare.
fn is_bare(limb: Option<LimbRole>) -> bool {
    use LimbRole::{Forearm, Hand, Head, Neck, UpperArm};
    matches!(limb, Some(Head | Neck | UpperArm(_) | Forearm(_) | Hand(_)))
}

/// Whether a limb carries the hand of this side.
fn carries_hand(limb: Option<LimbRole>, side: Side) -> bool {
    matches!(limb, Some(LimbRole::Forearm(own) | LimbRole::Hand(own)) if own == side)
}

/// The candidates of a frame and what is known of them.
#[derive(Clone, Copy, Debug)]
pub(super) struct SightContext<'a> {
    pub sights: &'a [Sight],
    /// Distances of the candidates from the limbs.
    pub blobs: &'a [Blob],
    /// Which candidates are too small for a hand.
    pub specks: &'a [bool],
    pub limbs: &'a LimbDistances,
    /// The body does not explain candidates farther from it than this, meters.
    pub unexplained: f32,
}

impl SightContext<'_> {
    /// For each candidate: 0 if it cannot be the site, 1 if only near the predicted position, 2 wherever the limb can reach.
    /// `inside` is the position of the site if the candidate is on its surface.
    ///
    /// A site that was lost is reassigned far from its predicted position only to a region that no other site has, that is not
    /// too small, and that the estimated pose does not explain. A hand whose forearm is lost may also lie before the trunk or the
    /// legs, because they show no skin.
    pub(super) fn allowed(&self, site: &Expected, inside: &[Vec3]) -> Vec<u8> {
        let owned = |region| self.blobs.iter().any(|blob| blob.label.is_some() && blob.sight.region == region);
        let has_bare = self.limbs.roles.iter().any(|role| is_bare(*role));
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

    /// Returns two flags per candidate, for an assignment near the predicted position and, if the arm is lost, for one anywhere.
    /// A flag is false for an end of a bare forearm that is nearer to the elbow than another end of the same region.
    fn ends(&self, site: &Expected) -> Vec<bool> {
        let Some(elbow) = site.elbow() else { return vec![true; self.sights.len()] };
        let far = |sight: &Sight| -sight.place.distance(elbow);
        let mut ends = self.hand_ends(|sight| sight.place.distance(site.place) + far(sight));
        if site.arm_lost {
            // No evidence supports the predicted position, but the hand may still be there.
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

    /// For each candidate, whether it is the surface of a limb other than the hand's own forearm, or of a bare one if the arm is
    /// lost. `side` is the hand's side.
    pub(super) fn elsewhere(&self, site: &Expected, side: Option<Side>) -> Vec<bool> {
        let own = |limb| side.is_some_and(|side| carries_hand(limb, side));
        if site.head || !self.limbs.roles.iter().any(|role| own(*role)) {
            return vec![false; self.sights.len()];
        }
        let other = |limb| !own(limb) && (!site.arm_lost || is_bare(limb));
        let judge = |(index, sight): (usize, &Sight)| {
            let others = self.limbs.least(index, other);
            sight.deep && others < ON_LIMB && self.limbs.least(index, own) > others + OFF_LIMB
        };
        self.sights.iter().enumerate().map(judge).collect()
    }
}

/// Whether the distances from shoulder and elbow allow a hand at the candidate; true without depth.
fn within_arm(site: &Expected, sight: &Sight, inside: Vec3) -> bool {
    if !sight.deep {
        return true;
    }
    let reaches = site.arm[0].is_none_or(|shoulder| sight.place.distance(shoulder) < site.reach());
    let elbow = site.elbow().filter(|_| site.upper_arm_visible);
    reaches
        && elbow.is_none_or(|elbow| {
            // A region much nearer is the middle of the forearm; the hand is in the shade or cut off.
            let (apart, forearm) = (inside.distance(elbow), site.place.distance(elbow));
            let most = if site.arm_lost { f64::INFINITY } else { forearm + FARTHEST_HAND };
            NEAREST_HAND * forearm < apart && apart < most
        })
}

/// Center of a hand whose region is at `place` and which may be split by something across it, or behind it and of its color. The
/// center then lies between two pieces no farther apart than a hand is long; returned is the point there that is nearest to the
/// predicted position.
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
        let roles = [LimbRole::Thorax, LimbRole::Forearm(Side::Left), LimbRole::Head].map(Some).to_vec();
        let limbs = LimbDistances { roles, away: vec![0.0, 0.5, 0.2, 0.01, 0.4, 0.0] };
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
        assert_eq!(sight_context.elsewhere(&site, Some(Side::Left)), [true, false]);
        assert_eq!(sight_context.elsewhere(&site, Some(Side::Right)), [false, false], "it has no forearm");
        let lost = Expected { arm_lost: true, ..site };
        assert_eq!(sight_context.elsewhere(&lost, Some(Side::Left)), [false, false], "a thorax shows no skin");
        assert_eq!(sight_context.allowed(&site, &[Vec3::X; 2]), [1, 1]);
        assert_eq!(SightContext { unexplained: -0.1, ..sight_context }.allowed(&site, &[Vec3::X; 2]), [2, 2]);
    }
}
