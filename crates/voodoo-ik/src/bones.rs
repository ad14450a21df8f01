//! The segments that represent a chain in the images, from joint to joint (J10 eq. 6), and the trunk, which they must not enter.

use super::image::Bone;
use super::model::ChainModel;
use super::trunk::Trunk;
use voodoo_core::Body;
use voodoo_core::math::{Pose, Vec3};

/// A limb attached to the trunk starts inside it; beyond this fraction of its length it must be outside.
const FREE_OF_TRUNK: f64 = 0.5;

/// Returns one segment from the joint of every limb to each joint of its children in the chain. The segment of a last limb ends
/// at its farthest site, else at its distal end. A root limb without a joint has none. The radius is the smaller semi-axes times
/// `margin`, because a limb is at least that wide however it is rotated about its axis. With a margin of 0 the criterion is that
/// of J10.
pub fn bones(body: &Body, model: &ChainModel, margin: f64) -> Vec<Bone> {
    let mut segments = Vec::new();
    for (index, link) in model.links().iter().enumerate() {
        let limb = &body.limbs()[link.limb];
        let Some((parent, joint)) = &limb.parent else { continue };
        let start = joint.limb_from_joint.translation;
        let shape = &limb.shape;
        let radius = [margin * shape.a0().min(shape.b0()), margin * shape.a1().min(shape.b1())];
        let children = model.links().iter().filter(|child| child.parent == Some(index));
        let mut ends: Vec<Vec3> = children.map(|child| child.parent_from_joint.translation).collect();
        if ends.is_empty() {
            let sites = body.sites().iter().filter(|site| site.limb == link.limb).map(|site| site.position);
            let farthest = sites.max_by(|a, b| (*a - start).length().total_cmp(&(*b - start).length()));
            ends.push(farthest.filter(|end| (*end - start).length() > 1e-6).unwrap_or(Vec3::Z * shape.length()));
        }
        // Limbs start inside the trunk that carries them; the trunk's own limbs lie in it.
        let apart = if branches(body, link.limb) {
            1.0
        } else if branches(body, *parent) {
            FREE_OF_TRUNK
        } else {
            0.0
        };
        segments.extend(ends.into_iter().map(|end| Bone { ends: [(index, start), (index, end)], radius, apart }));
    }
    segments
}

/// The trunk: limbs of the chain, and its base, from which several other limbs branch.
pub fn trunk(body: &Body, model: &ChainModel, world_from_base: &Pose) -> Vec<Trunk> {
    let base = model.links().first().and_then(|link| body.parent(link.limb));
    let links = model.links().iter().enumerate().map(|(index, link)| (Some(index), Pose::IDENTITY, link.limb));
    let limbs = base.map(|limb| (None, *world_from_base, limb)).into_iter().chain(links);
    let trunk = limbs.filter(|(_, _, limb)| branches(body, *limb));
    trunk.map(|(link, pose, limb)| Trunk { link, pose, shape: body.limbs()[limb].shape }).collect()
}

fn branches(body: &Body, limb: usize) -> bool {
    body.children(limb).count() > 2
}
