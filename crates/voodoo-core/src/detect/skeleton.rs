//! Joints at the distances that a person's sizes demand: every joint by itself is drawn towards the mean of where it may be,
//! which makes limbs short.

use super::names::JOINTS;
use crate::math::Vec3;

/// Sides of the body, the person's own.
const SIDES: [&str; 2] = ["l_", "r_"];

/// Gives the limbs of joints as in [`JOINTS`] the lengths of [`LENGTHS`](super::names::LENGTHS), in directions that stay. The trunk's
/// middle stays where it is.
pub fn take_lengths(joints: &mut [Vec3], lengths: &[f64]) {
    Skeleton { joints }.take_lengths(lengths);
}

/// What [`take_lengths`] takes, of joints: the mean of both sides.
pub(super) fn lengths(joints: &[Vec3]) -> Vec<f64> {
    let at = |name: &str| index(name).map_or(Vec3::ZERO, |index| joints[index]);
    let bone = |from: &str, to: &str| {
        0.5 * SIDES.iter().map(|side| at(&format!("{side}{from}")).distance(at(&format!("{side}{to}")))).sum::<f64>()
    };
    let across = |name: &str| at(&format!("l_{name}")).distance(at(&format!("r_{name}")));
    vec![
        bone("shoulder", "elbow"),
        bone("elbow", "wrist"),
        bone("hip", "knee"),
        bone("knee", "ankle"),
        across("shoulder"),
        across("hip"),
        at("humanoid_root").distance(at("vc7")),
        at("vc7").distance(at("head_center")),
    ]
}

/// Where joints were seen, by name.
#[derive(Debug)]
struct Skeleton<'a> {
    joints: &'a mut [Vec3],
}

impl Skeleton<'_> {
    fn get(&self, name: &str) -> Vec3 {
        index(name).map_or(Vec3::ZERO, |index| self.joints[index])
    }

    fn set(&mut self, name: &str, position: Vec3) {
        if let Some(index) = index(name) {
            self.joints[index] = position;
        }
    }

    fn take_lengths(&mut self, lengths: &[f64]) {
        let [upper_arm, forearm, thigh, shank, shoulders, hips, trunk, neck, ..] = *lengths else { return };
        let (root, top) = (self.get("humanoid_root"), self.get("vc7"));
        let (middle, along) = (0.5 * (root + top), (top - root).normalize_or_zero());
        let up = middle + 0.5 * trunk * along - top;
        let down = middle - 0.5 * trunk * along - root;
        let head = self.get("head_center") - top;
        self.set("humanoid_root", root + down);
        self.set("vc7", top + up);
        self.set("head_center", top + up + neck * head.normalize_or_zero());
        self.limbs(["shoulder", "elbow", "wrist", "hand"], shoulders, [upper_arm, forearm], up);
        self.limbs(["hip", "knee", "ankle", ""], hips, [thigh, shank], down);
    }

    /// Two arms or legs: the distance of their roots, their lengths, and by how much the trunk's end was moved.
    fn limbs(&mut self, names: [&str; 4], width: f64, lengths: [f64; 2], moved: Vec3) {
        let [roots, bends, ends, tips] = names.map(|name| SIDES.map(|side| format!("{side}{name}")));
        let [left, right] = [self.get(&roots[0]), self.get(&roots[1])];
        let (middle, half) = (0.5 * (left + right) + moved, 0.5 * width * (left - right).normalize_or_zero());
        for (side, place) in [middle + half, middle - half].into_iter().enumerate() {
            let [root, bend, end] = [&roots, &bends, &ends].map(|names| self.get(&names[side]));
            let bend_now = place + lengths[0] * (bend - root).normalize_or_zero();
            let end_now = bend_now + lengths[1] * (end - bend).normalize_or_zero();
            let tip = self.get(&tips[side]);
            self.set(&tips[side], tip + end_now - end);
            self.set(&roots[side], place);
            self.set(&bends[side], bend_now);
            self.set(&ends[side], end_now);
        }
    }
}

fn index(name: &str) -> Option<usize> {
    JOINTS.iter().position(|joint| *joint == name)
}
