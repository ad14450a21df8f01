//! Places a body at a detected person.

use super::Detected;
use crate::body::Body;
use crate::math::{Pose, Vec3};

/// Returns a body like `reference` with a detected person's sizes (equal on both sides), and the pose that fits the joints best,
/// world frame.
pub(crate) fn fit_body(reference: &Body, detected: Detected) -> Option<(Body, Vec<Pose>)> {
    let body = with_sizes(reference, detected)?;
    let poses = fit_pose(&body, detected)?;
    Some((body, poses))
}

/// Returns the pose of a body that fits a detected person's joints best, world frame.
pub(crate) fn fit_pose(body: &Body, detected: Detected) -> Option<Vec<Pose>> {
    let mut joints = positions_of(detected);
    let skeleton = &detected.map.skeleton;
    skeleton.take_lengths(&mut joints, &skeleton.measure(&at_rest(body, &detected.map.sites)));
    body.fit(&positions(&detected.map.sites, &joints), false).ok().map(|(_, poses)| poses)
}

/// Position of a detected person's root, world frame: the detected root joint, else the root of the fitted body.
pub(crate) fn place(body: &Body, detected: Detected) -> Option<Vec3> {
    match detected.map.skeleton.root.and_then(|root| detected.joint(root)) {
        Some(root) => Some(root.position),
        None => fit_pose(body, detected).and_then(|poses| poses.first().map(|root| root.translation)),
    }
}

/// Whether a body has the sizes of a detected person, each within `sigmas` of its standard deviations.
pub(crate) fn is_sized_like(body: &Body, detected: Detected, sigmas: f64) -> bool {
    let skeleton = &detected.map.skeleton;
    let own = skeleton.measure(&at_rest(body, &detected.map.sites));
    let both = own
        .into_iter()
        .zip(skeleton.reported(&detected.detection.lengths))
        .filter_map(|(own, observed)| own.zip(observed));
    both.into_iter().all(|(own, [length, sigma])| (own / length).ln().abs() <= sigmas * sigma)
}

/// Whether the sites with these names fix the pose of a body.
pub(super) fn fixes_pose(body: &Body, names: &[String]) -> bool {
    let sites: Vec<Option<usize>> = names.iter().map(|name| body.site_index(name).ok()).collect();
    body.fit(&positions(&sites, &at_rest(body, &sites)), false).is_ok()
}

/// Returns the body with a detected person's lengths, equal on both sides: the reported lengths, or else the distances between
/// joints.
fn with_sizes(reference: &Body, detected: Detected) -> Option<Body> {
    let Detected { detection, map } = detected;
    let lengths = match map.lengths {
        0 => map.skeleton.measure(&positions_of(detected)),
        _ => map.skeleton.reported(&detection.lengths).map(|length| length.map(|[length, _]| length)),
    };
    if lengths.iter().all(Option::is_none) {
        return Some(reference.clone());
    }
    let grown = detected.stature().map(|[stature, _]| reference.with_proportions_of(stature));
    let reference = grown.as_ref().unwrap_or(reference);
    let mut joints = at_rest(reference, &map.sites);
    map.skeleton.take_lengths(&mut joints, &lengths);
    reference.fit(&positions(&map.sites, &joints), true).ok().map(|(body, _)| body)
}

/// Detected positions of the joints that the body has.
fn positions_of(detected: Detected) -> Vec<Option<Vec3>> {
    let sites = detected.map.sites.iter().enumerate();
    sites.map(|(index, site)| site.and_then(|_| detected.joint(index)).map(|joint| joint.position)).collect()
}

/// Positions of a body's sites at rest.
fn at_rest(body: &Body, sites: &[Option<usize>]) -> Vec<Option<Vec3>> {
    let rest = body.rest_pose(Pose::IDENTITY);
    sites.iter().map(|site| site.map(|site| body.site_position(&rest, site))).collect()
}

/// Pairs sites with their positions.
fn positions(sites: &[Option<usize>], joints: &[Option<Vec3>]) -> Vec<(usize, Vec3)> {
    sites.iter().zip(joints).filter_map(|(site, joint)| site.zip(*joint)).collect()
}
