//! Moves a person's joints to the distances that their sizes require. A detector that regresses each joint independently reports
//! the mean of its possible positions, which makes limbs too short.

use crate::body::{JointRole, Side};
use crate::math::Vec3;

/// Names of the lengths that constrain joints, in this order. [`Skeleton::new`] maps them to pairs of joints.
const LENGTHS: [&str; COUNT] =
    ["upper_arm", "forearm", "thigh", "shank", "shoulder_width", "hip_width", "trunk", "neck"];
const COUNT: usize = 8;

/// A value for each of [`LENGTHS`], meters; `None` where unknown.
pub(super) type OptionalLengths = [Option<f64>; COUNT];

/// Indices of a detector's joints and lengths; `None` for those that the detector does not report.
#[derive(Clone, Debug, Default)]
pub(super) struct Skeleton {
    pub(super) root: Option<usize>,
    top: Option<usize>,
    head: Option<usize>,
    /// Shoulder, elbow, wrist and hand of the left and the right arm.
    pub(super) arms: [[Option<usize>; 4]; 2],
    /// Hip, knee and ankle.
    pub(super) legs: [[Option<usize>; 3]; 2],
    lengths: [Option<usize>; COUNT],
}

impl Skeleton {
    /// Resolves the indices from the joints' roles and from names of lengths.
    pub(super) fn new(joint: impl Fn(JointRole) -> Option<usize>, length: impl Fn(&str) -> Option<usize>) -> Self {
        use JointRole::{Ankle, Elbow, Hand, HeadCenter, Hip, Knee, NeckBase, Root, Shoulder, Wrist};
        Self {
            root: joint(Root),
            top: joint(NeckBase),
            head: joint(HeadCenter),
            arms: Side::BOTH.map(|side| [Shoulder, Elbow, Wrist, Hand].map(|of| joint(of(side)))),
            legs: Side::BOTH.map(|side| [Hip, Knee, Ankle].map(|of| joint(of(side)))),
            lengths: LENGTHS.map(length),
        }
    }

    /// Reorders the reported lengths from the detector's order into that of [`LENGTHS`].
    pub(super) fn reported<T: Copy>(&self, lengths: &[T]) -> [Option<T>; COUNT] {
        self.lengths.map(|index| lengths.get(index?).copied())
    }

    /// Measures the lengths between joints: the mean of both sides, or the one side that is known.
    pub(super) fn measure(&self, joints: &[Option<Vec3>]) -> OptionalLengths {
        let apart = |from: Option<usize>, to: Option<usize>| Some(at(joints, from)?.distance(at(joints, to)?));
        let mean = |sides: [Option<f64>; 2]| match sides {
            [Some(left), Some(right)] => Some(0.5 * (left + right)),
            [left, right] => left.or(right),
        };
        let of_arms = |bone: usize| mean(self.arms.map(|arm| apart(arm[bone], arm[bone + 1])));
        let of_legs = |bone: usize| mean(self.legs.map(|leg| apart(leg[bone], leg[bone + 1])));
        [
            of_arms(0),
            of_arms(1),
            of_legs(0),
            of_legs(1),
            apart(self.arms[0][0], self.arms[1][0]),
            apart(self.legs[0][0], self.legs[1][0]),
            apart(self.root, self.top),
            apart(self.top, self.head),
        ]
    }

    /// Sets the limbs to these lengths. Limb directions and the middle of the trunk stay.
    pub(super) fn take_lengths(&self, joints: &mut [Option<Vec3>], lengths: &OptionalLengths) {
        let [upper_arm, forearm, thigh, shank, shoulders, hips, trunk, neck] = *lengths;
        let [root, top, head] = [self.root, self.top, self.head].map(|index| at(joints, index));
        let [mut up, mut down] = [Vec3::ZERO; 2];
        if let (Some(root), Some(top), Some(trunk)) = (root, top, trunk) {
            let (middle, along) = (0.5 * (root + top), (top - root).normalize_or_zero());
            up = middle + 0.5 * trunk * along - top;
            down = middle - 0.5 * trunk * along - root;
        }
        let head = head.map(|head| match (top, neck) {
            (Some(top), Some(neck)) => top + up + neck * (head - top).normalize_or_zero(),
            _ => head + up,
        });
        set(joints, self.root, root.map(|root| root + down));
        set(joints, self.top, top.map(|top| top + up));
        set(joints, self.head, head);
        limbs(joints, &self.arms, shoulders, [upper_arm, forearm], up);
        limbs(joints, &self.legs, hips, [thigh, shank], down);
    }
}

fn at(joints: &[Option<Vec3>], index: Option<usize>) -> Option<Vec3> {
    joints.get(index?).copied().flatten()
}

fn set(joints: &mut [Option<Vec3>], index: Option<usize>, position: Option<Vec3>) {
    if let Some(joint) = index.and_then(|index| joints.get_mut(index)) {
        *joint = position;
    }
}

/// Places two arms or legs from the distance of their roots, the lengths of their bones and the displacement of their end of the
/// trunk.
fn limbs<const N: usize>(
    joints: &mut [Option<Vec3>],
    sides: &[[Option<usize>; N]; 2],
    width: Option<f64>,
    lengths: [Option<f64>; 2],
    moved: Vec3,
) {
    let before = sides.map(|side| side.map(|index| at(joints, index)));
    let mut roots = before.map(|side| side[0].map(|root| root + moved));
    if let ([Some(left), Some(right)], Some(width)) = (before.map(|side| side[0]), width) {
        let (middle, half) = (0.5 * (left + right) + moved, 0.5 * width * (left - right).normalize_or_zero());
        roots = [Some(middle + half), Some(middle - half)];
    }
    for ((side, before), root) in sides.iter().zip(&before).zip(roots) {
        set(joints, side[0], root);
        // The last joint before this one that is known: its old and its new position.
        let mut last = before[0].zip(root);
        for number in 1..N {
            let Some(old) = before[number] else { continue };
            let bone = lengths.get(number - 1).copied().flatten().filter(|_| before[number - 1].is_some());
            let new = match (last, bone) {
                (Some((from, now)), Some(length)) => now + length * (old - from).normalize_or_zero(),
                (Some((from, now)), None) => old + now - from,
                (None, _) => old + moved,
            };
            set(joints, side[number], Some(new));
            last = Some((old, new));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAMES: [&str; 10] = [
        "humanoid_root",
        "vc7",
        "head_center",
        "l_shoulder",
        "r_shoulder",
        "l_elbow",
        "l_wrist",
        "l_hand",
        "r_wrist",
        "l_knee",
    ];

    fn skeleton(names: &[&str]) -> Skeleton {
        let joint = |role| names.iter().position(|name| JointRole::from_name(name) == Some(role));
        Skeleton::new(joint, |_| None)
    }

    fn joints() -> Vec<Option<Vec3>> {
        [
            [0.0, 0.0, 0.9],
            [0.0, 0.0, 1.5],
            [0.0, 0.0, 1.7],
            [0.0, 0.2, 1.4],
            [0.0, -0.2, 1.4],
            [0.0, 0.5, 1.4],
            [0.0, 0.7, 1.4],
            [0.0, 0.8, 1.4],
            [0.0, -0.7, 1.4],
            [0.0, 0.1, 0.5],
        ]
        .map(|place| Some(Vec3::from_array(place)))
        .to_vec()
    }

    #[test]
    fn joints_are_put_at_the_lengths_that_are_given_and_what_hangs_on_them_moves_along() {
        let skeleton = skeleton(&NAMES);
        let mut joints = joints();
        let mut lengths = skeleton.measure(&joints);
        assert_eq!(lengths.map(|length| length.is_some()), [true, true, false, false, true, false, true, true]);
        lengths[0] = Some(0.35);
        lengths[4] = Some(0.5);
        skeleton.take_lengths(&mut joints, &lengths);
        let place = |index: usize| joints[index].unwrap_or(Vec3::NAN);
        assert!((place(3) - Vec3::new(0.0, 0.25, 1.4)).length() < 1e-12, "the left shoulder is farther out");
        assert!((place(5) - Vec3::new(0.0, 0.6, 1.4)).length() < 1e-12, "its elbow is farther still");
        assert!((place(7) - Vec3::new(0.0, 0.9, 1.4)).length() < 1e-12, "the hand goes with the wrist");
        // The right elbow is not reported: the wrist moves with the shoulder.
        assert!((place(8) - Vec3::new(0.0, -0.75, 1.4)).length() < 1e-12);
        assert!((place(9) - Vec3::new(0.0, 0.1, 0.5)).length() < 1e-12, "nothing is known of a leg without its hip");
    }

    #[test]
    fn of_few_joints_few_lengths_are_known_and_all_others_stay() {
        let skeleton = skeleton(&["l_wrist", "r_wrist", "head_center"]);
        let mut joints = joints()[..3].to_vec();
        let before = joints.clone();
        assert_eq!(skeleton.measure(&joints), [None; COUNT]);
        skeleton.take_lengths(&mut joints, &[Some(0.3); COUNT]);
        assert_eq!(joints, before);
    }
}
