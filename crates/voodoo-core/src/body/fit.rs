//! Fits pose and sizes of a body to named positions in the world.

use super::{Body, Joint, JointKind};
use crate::body::kinematics::{hinge_axis, joint_turn};
use crate::error::{TrackError, Unexpected};
use crate::math::{Aabb, Mat3, Moments, PLACE, Pose, Quat, Vec3, is_place};

/// A hinge bent by less than this does not determine its axis: sine of the angle between its limbs.
const BENT: f64 = 0.3;
/// Squares of coordinates up to this many meters leave enough digits for a body; those of map coordinates (UTM) do not.
const NEAR_ORIGIN: f64 = 1e4;
/// Maximum plausible scale relative to the reference body, up or down. Beyond it, the positions are probably not in meters.
const LARGEST: f64 = 10.0;
/// A landmark at least this fraction of a limb's length from its joint determines the limb's direction.
const FAR_END: f64 = 0.5;
/// A joint whose ranges are all narrower than this (radians) belongs to the trunk: spine and neck, but not shoulder and hip.
const STEADY: f64 = 2.5;
/// A limb whose joint rotates by less than this about every axis counts as rigid on its parent, so its landmarks also determine
/// the parent: a clavicle for the chest.
const RIGID: f64 = 1.0;
/// Minimum plausible length of a limb relative to the other limb of its pair. A shorter one was foreshortened, or one of its
/// joints was placed wrongly along it.
const UNEQUAL: f64 = 0.75;
/// Limbs whose axes differ by at most 30 degrees (cosine) are in line: the position of their joint along the line is hard to see.
const STRAIGHT: f64 = 0.866;
/// Weight of the prior orientation relative to landmarks of weight one: it determines only what they leave open.
const PRIOR_WEIGHT: f64 = 0.01;
/// Lever of the prior orientation, meters: approximately the distance between landmarks on a limb.
const PRIOR_LEVER: f64 = 0.1;

/// Landmarks that are at least this fraction of a limb's length apart along its axis determine its length.
const SPREAD_ALONG: f64 = 0.3;
/// Maximum factor by which a limb is stretched or shrunk, by landmarks or by all frames together. A larger factor indicates another
/// person or a wrong landmark.
pub(crate) const MOST_STRETCH: f64 = 2.0;
/// Points are collinear when the sum of pairwise products of their scatter's eigenvalues is below this fraction of its squared
/// trace: their width is then a hundredth of their length.
const ON_A_LINE: f64 = 1e-4;
/// Points whose scatter has a trace of at most this, square meters, count as one point.
const ON_A_POINT: f64 = 1e-8;

impl Body {
    /// Returns world poses of all limbs, and the body with the sizes that the positions determine, from positions of sites.
    ///
    /// Any subset of sites that contains three non-collinear positions is sufficient. Limbs without position information keep
    /// their rest orientation relative to their parent. With `fit_sizes` the body is first scaled as a whole by the distances
    /// between known landmarks of the same limb; then every limb is stretched and its landmarks are moved to the measured
    /// positions. Positions that require a scale above ten or below a tenth are rejected.
    pub fn fit(&self, positions: &[(usize, Vec3)], fit_sizes: bool) -> Result<(Self, Vec<Pose>), TrackError> {
        for (index, position) in positions {
            let unknown = || Unexpected::new("joints", "the index of a site", index);
            let site = self.sites.get(*index).ok_or_else(unknown)?;
            let (what, found) = (format_args!("joints[{}]", site.name), format_args!("{position:?}"));
            Unexpected::unless(is_place(*position), what, PLACE, found)?;
        }
        let farthest = positions.iter().map(|(_, position)| position.abs().max_element()).fold(0.0, f64::max);
        if farthest <= NEAR_ORIGIN {
            return self.fit_near(positions, fit_sizes);
        }
        let origin = positions[0].1;
        let near: Vec<_> = positions.iter().map(|(site, position)| (*site, *position - origin)).collect();
        let (body, mut poses) = self.fit_near(&near, fit_sizes)?;
        for pose in &mut poses {
            pose.translation += origin;
        }
        Ok((body, poses))
    }

    /// `fit` in a frame whose origin is near the body.
    fn fit_near(&self, positions: &[(usize, Vec3)], fit_sizes: bool) -> Result<(Self, Vec<Pose>), TrackError> {
        let scale = if fit_sizes { self.scale_to(positions) } else { 1.0 };
        let mut body = self.scaled(scale)?;
        let world_from_rest = body.overall_orientation(positions)?;
        let expected = "meters, between a tenth and ten times the body's own distances";
        let plausible = (1.0 / LARGEST..=LARGEST).contains(&scale);
        Unexpected::unless(plausible, "joints", expected, format_args!("{scale:.4} times"))?;
        let rest = body.rest_pose(Pose::IDENTITY);
        let mut poses: Vec<Pose> = Vec::with_capacity(rest.len());
        for limb in 0..rest.len() {
            let (prior, anchor) = match &body.limbs()[limb].parent {
                None => (world_from_rest * rest[0], None),
                Some((parent, joint)) => {
                    let prior = poses[*parent] * joint.parent_from_limb_at_rest();
                    let center = measured(body.roles.joint_site(limb), positions)
                        .unwrap_or_else(|| poses[*parent] * joint.parent_from_joint.translation);
                    (prior, Some((joint.limb_from_joint.translation, center)))
                }
            };
            let pairs = body.known_landmarks(limb, positions);
            let pose = body.orient_limb(limb, &pairs, prior, anchor, positions);
            poses.push(pose);
            if fit_sizes {
                let mut pairs = pairs;
                if body.carried(limb) {
                    pairs.extend(anchor);
                }
                body.stretch_limb(limb, &pairs, &pose);
                body.align_hinge(limb, &poses);
            }
        }
        if fit_sizes {
            body.even_out(self, &poses);
        }
        // The last limbs may have been stretched after their parents were placed; all joints are closed once more.
        body.close_joints(&mut poses);
        Ok((body, poses))
    }

    /// Landmarks of a limb, in its frame, whose positions are known, with their measured positions.
    fn known_landmarks(&self, limb: usize, positions: &[(usize, Vec3)]) -> Vec<(Vec3, Vec3)> {
        let mut pairs: Vec<(Vec3, Vec3)> = Vec::new();
        let mut add = |site: Option<usize>, local: Vec3| {
            if let Some(position) = measured(site, positions)
                && !pairs.iter().any(|(known, _)| (*known - local).length() < 1e-9)
            {
                pairs.push((local, position));
            }
        };
        for (index, site) in self.sites().iter().enumerate().filter(|(_, site)| site.limb == limb) {
            add(Some(index), site.position);
        }
        for (index, parent, joint) in self.joints() {
            let center = self.roles.joint_site(index);
            if parent == limb {
                add(center, joint.parent_from_joint.translation);
            } else if index == limb {
                add(center, joint.limb_from_joint.translation);
            } else if let Some((grandparent, carrier)) = &self.limbs()[parent].parent
                && *grandparent == limb
                && self.carried(parent)
            {
                let limb_from_parent = carrier.parent_from_limb_at_rest();
                add(center, limb_from_parent * joint.parent_from_joint.translation);
            }
        }
        pairs
    }

    /// Whether the limb moves little relative to its parent, so that its landmarks also determine the parent: a clavicle on the
    /// chest.
    fn carried(&self, limb: usize) -> bool {
        self.limbs()[limb].parent.as_ref().is_some_and(|(_, joint)| turns_less(joint, RIGID))
    }

    /// Scale of the whole body: measured distances divided by model distances between landmarks of the same limb.
    fn scale_to(&self, positions: &[(usize, Vec3)]) -> f64 {
        let (mut measured, mut modeled) = (0.0, 0.0);
        for limb in 0..self.limbs().len() {
            let pairs = self.known_landmarks(limb, positions);
            for (index, first) in pairs.iter().enumerate() {
                for second in &pairs[..index] {
                    modeled += (first.0 - second.0).length();
                    measured += (first.1 - second.1).length();
                }
            }
        }
        if modeled > 0.0 && measured > 0.0 { measured / modeled } else { 1.0 }
    }

    /// Orientation of the whole body. It uses the landmarks of the trunk (the root and limbs that move little on it) if they
    /// determine it, else all sites, against the rest pose.
    fn overall_orientation(&self, positions: &[(usize, Vec3)]) -> Result<Pose, TrackError> {
        let rest = self.rest_pose(Pose::IDENTITY);
        let mut trunk = vec![true];
        for (_, parent, joint) in self.joints() {
            trunk.push(trunk[parent] && turns_less(joint, STEADY));
        }
        let mut central: Vec<(Vec3, Vec3)> = Vec::new();
        for limb in (0..trunk.len()).filter(|limb| trunk[*limb]) {
            central.extend(self.known_landmarks(limb, positions).into_iter().map(|(local, p)| (rest[limb] * local, p)));
        }
        let all: Vec<_> = positions.iter().map(|(site, p)| (self.site_position(&rest, *site), *p)).collect();
        for pairs in [central, all] {
            if spans_a_plane(pairs.iter().map(|pair| pair.0)) && spans_a_plane(pairs.iter().map(|pair| pair.1)) {
                let mut moments = Moments::default();
                pairs.iter().for_each(|(x, p)| moments.add(1.0, *x, *p));
                if let Some(pose) = moments.absolute_orientation(0.0) {
                    return Ok(pose);
                }
            }
        }
        let expected = "at least three positions that do not lie on a line";
        Err(Unexpected::new("joints", expected, format_args!("{} position(s)", positions.len())).into())
    }

    fn orient_limb(
        &self,
        limb: usize,
        pairs: &[(Vec3, Vec3)],
        prior: Pose,
        anchor: Option<(Vec3, Vec3)>,
        positions: &[(usize, Vec3)],
    ) -> Pose {
        let mut moments = Moments::default();
        for (local, position) in
            pairs.iter().copied().chain(anchor.filter(|(local, _)| !pairs.iter().any(|(known, _)| known == local)))
        {
            moments.add(1.0, prior * local, position);
        }
        // Weak prior orientation: nearly collinear landmarks must not determine the rotation about their line.
        let mean = if moments.weight > 0.0 { moments.p / moments.weight } else { prior.translation };
        let middle = if moments.weight > 0.0 { moments.x / moments.weight } else { prior.translation };
        for axis in Vec3::AXES.into_iter().flat_map(|axis| [axis, -axis]) {
            moments.add(PRIOR_WEIGHT, middle + PRIOR_LEVER * axis, mean + PRIOR_LEVER * axis);
        }
        let turn = moments.absolute_orientation(PRIOR_LEVER).map_or(Quat::IDENTITY, |pose| pose.rotation);
        let mut rotation = turn * prior.rotation;
        if let Some((axis, hinge)) = self.hinge_axis(limb, positions) {
            rotation = twist_towards(rotation, axis, hinge);
        }
        // A root, which no joint holds, is held by the middle of its landmarks.
        let own_middle = || pairs.iter().map(|pair| pair.0).sum::<Vec3>() / pairs.len().max(1) as f64;
        let (local, center) = anchor.unwrap_or_else(|| (own_middle(), mean));
        Pose::from_parts(center - rotation * local, rotation.normalize())
    }

    /// The axis of a hinge at the distal end of a limb: in the limb frame, and in the world as the bent child determines it.
    fn hinge_axis(&self, limb: usize, positions: &[(usize, Vec3)]) -> Option<(Vec3, Vec3)> {
        let is_at_end =
            |(_, parent, joint): &(usize, usize, &Joint)| *parent == limb && joint.kind() == JointKind::Hinge;
        let (index, _, joint) = self.joints().find(is_at_end)?;
        let center = self.roles.joint_site(index);
        let (start, bend) = (measured(self.roles.joint_site(limb), positions)?, measured(center, positions)?);
        let own = |site: &usize| self.sites()[*site].limb == index && Some(*site) != center;
        let end = (0..self.sites().len()).filter(own).find_map(|site| measured(Some(site), positions));
        // If the child has no site of its own, the joint of its own child gives its direction: a hand's wrist.
        let end = end.or_else(|| {
            let away = |local: Vec3| (local - joint.limb_from_joint.translation).length();
            let landmarks = self.known_landmarks(index, positions).into_iter();
            let far = landmarks.filter(|(local, _)| away(*local) > FAR_END * self.limbs[index].shape.length());
            far.max_by(|a, b| away(a.0).total_cmp(&away(b.0))).map(|(_, position)| position)
        })?;
        let normal = (bend - start).normalize_or_zero().cross((end - bend).normalize_or_zero());
        (normal.length() > BENT).then(|| (joint.parent_from_joint.rotation * hinge_axis(joint), normal.normalize()))
    }

    /// Moves the landmarks of a limb to their measured positions and stretches its shape accordingly.
    fn stretch_limb(&mut self, limb: usize, pairs: &[(Vec3, Vec3)], pose: &Pose) {
        if pairs.len() < 2 {
            return;
        }
        let local: Vec<(Vec3, Vec3)> = pairs.iter().map(|(x, p)| (*x, pose.inverse_transform_point(*p))).collect();
        let modeled = Aabb::from_points(local.iter().map(|pair| pair.0)).extents();
        let measured = Aabb::from_points(local.iter().map(|pair| pair.1)).extents();
        let shape = self.limbs[limb].shape;
        let ratio = |axis: usize, enough: f64| {
            if modeled[axis] > enough && measured[axis] > 0.0 {
                (measured[axis] / modeled[axis]).clamp(1.0 / MOST_STRETCH, MOST_STRETCH)
            } else {
                1.0
            }
        };
        let stretch = Vec3::new(1.0, ratio(1, shape.local_aabb().maxs.y), ratio(2, SPREAD_ALONG * shape.length()));
        if let Ok(stretched) = shape.stretched(stretch.z, [1.0, stretch.y, 1.0, stretch.y]) {
            self.limbs[limb].shape = stretched;
        }
        self.map_landmarks(limb, |position| {
            local
                .iter()
                .find(|(known, _)| (*known - position).length() < 1e-9)
                .map_or(position * stretch, |(_, measured)| *measured)
        });
    }

    /// Lengthens a limb that is far shorter than the other one of its pair. If the adjacent limb of the same arm or leg is longer
    /// than its own pair instead, their common joint was placed wrongly along the line of both. The side that is less like
    /// `reference` then keeps its total length, if it is straight, and divides it in the proportion of the other side.
    fn even_out(&mut self, reference: &Self, poses: &[Pose]) {
        let pairs = self.pairs();
        let length = |limb: usize| self.limbs[limb].shape.length();
        let twin = |limb: usize| {
            let pair = pairs.iter().find(|pair| pair.len() == 2 && pair.contains(&limb));
            pair.and_then(|pair| pair.iter().copied().find(|one| *one != limb))
        };
        let sum = |bones: [usize; 2]| bones.map(length).iter().sum::<f64>();
        let is_unequal = |bones: [usize; 2]| {
            let [first, second] = bones.map(|limb| (length(limb) / reference.limbs[limb].shape.length()).ln());
            (first - second).abs()
        };
        let straight = |bones: [usize; 2]| {
            let [first, second] = bones.map(|limb| poses[limb].rotation * Vec3::Z);
            first.dot(second) > STRAIGHT
        };
        let mut factors: Vec<(usize, f64)> = Vec::new();
        for limb in 0..self.limbs.len() {
            let Some(other) = twin(limb).filter(|other| length(*other) * UNEQUAL > length(limb)) else { continue };
            let next =
                self.parent(limb).into_iter().chain(self.children(limb)).find_map(|next| Some((next, twin(next)?)));
            let sides = next.filter(|(next, beside)| length(*next) > length(*beside)).map(|(next, beside)| {
                let (own, opposite) = ([limb, next], [other, beside]);
                if is_unequal(own) < is_unequal(opposite) { (opposite, own) } else { (own, opposite) }
            });
            match sides.filter(|(wrong, _)| straight(*wrong)) {
                // Both limbs of a side may lead to the same correction.
                Some((wrong, _)) if factors.iter().any(|(limb, _)| wrong.contains(limb)) => {}
                Some((wrong, right)) => {
                    let ratio = sum(wrong) / sum(right);
                    factors.extend(wrong.into_iter().zip(right).map(|(a, b)| (a, ratio * length(b) / length(a))));
                }
                None => factors.push((limb, length(other) / length(limb))),
            }
        }
        for (limb, factor) in factors {
            self.change_length(limb, factor);
        }
    }

    /// Rotates the hinge on a limb so that the hinge can reach the measured pose: real elbow and knee axes are not exactly
    /// perpendicular to the limbs (carrying angle). The axis on the parent stays.
    fn align_hinge(&mut self, limb: usize, poses: &[Pose]) {
        let Some((parent, joint)) = &mut self.limbs[limb].parent else { return };
        if joint.kind() == JointKind::Hinge {
            let twist = joint_turn(joint, &poses[*parent], &poses[limb]);
            let world_from_joint = poses[*parent].rotation * joint.parent_from_joint.rotation * twist;
            joint.limb_from_joint.rotation = (poses[limb].rotation.inverse() * world_from_joint).normalize();
        }
    }

    /// Moves every limb so that the two centers of its joint coincide.
    pub(crate) fn close_joints(&self, poses: &mut [Pose]) {
        for (limb, parent, joint) in self.joints() {
            let center = poses[parent] * joint.parent_from_joint.translation;
            poses[limb].translation = center - poses[limb].rotation * joint.limb_from_joint.translation;
        }
    }
}

/// Whether all ranges of a joint are narrower than this, radians.
fn turns_less(joint: &Joint, range: f64) -> bool {
    joint.limits.is_some_and(|limits| limits.iter().all(|[low, high]| high - low < range))
}

/// The measured position of a site.
fn measured(site: Option<usize>, positions: &[(usize, Vec3)]) -> Option<Vec3> {
    positions.iter().find(|(measured, _)| Some(*measured) == site).map(|(_, position)| *position)
}

/// Rotates about the limb's own z axis so that `local` points towards `world` as closely as possible.
fn twist_towards(rotation: Quat, local: Vec3, world: Vec3) -> Quat {
    let target = rotation.inverse() * world;
    let angle = target.y.atan2(target.x) - local.y.atan2(local.x);
    rotation * Quat::from_axis_angle(Vec3::Z, angle)
}

/// Whether the points are not collinear: the middle eigenvalue of their scatter is above zero.
fn spans_a_plane(points: impl Iterator<Item = Vec3> + Clone) -> bool {
    let mean = points.clone().sum::<Vec3>() / points.clone().count() as f64;
    let scatter = points.fold(Mat3::ZERO, |sum, point| {
        let d = point - mean;
        sum + Mat3::from_cols(d * d.x, d * d.y, d * d.z)
    });
    let trace = scatter.x_axis.x + scatter.y_axis.y + scatter.z_axis.z;
    let square = scatter * scatter;
    // Sum of the products of pairs of eigenvalues: zero exactly on a line.
    let pairs = 0.5 * (trace * trace - (square.x_axis.x + square.y_axis.y + square.z_axis.z));
    pairs > ON_A_LINE * trace * trace && trace > ON_A_POINT
}
