//! The skin cue of one camera (K06 III-A): regions of skin color as candidates for head and hands.

use std::f64::consts::PI;
use std::ops::Range;

use crate::eye::Eye;
use crate::registration::FEWEST_POINTS;
use crate::skin::colors::SkinColors;
use crate::skin::depth::DepthBeside;
use crate::skin::regions::{opened, regions, smoothed};
use voodoo_core::math::Vec3;
use voodoo_core::{BodyTracker, LimbRole, PointSlice, Side, TrackError};

/// Radius of a palm, meters.
const PALM: f64 = 0.045;
/// Radius of a face, meters.
const FACE: f64 = 0.085;
/// Least area of a region, as a fraction of a palm's disc: beside a depth camera, and without one.
const SMALLEST: [f64; 2] = [0.2, 0.4];
/// Regions with fewer pixels are noise at any distance.
const FEWEST_PIXELS: usize = 6;
/// Greatest area of a region, in discs of faces: two joined arms.
const MOST_FACES: f64 = 4.0;
/// Length of a hand with stretched fingers, in palm radii; what is longer is a forearm with its hand.
const LONGEST_HAND: f64 = 4.6;
/// Extent of the hand from the end of such a region, in palm radii.
const HAND_AT_END: f64 = 3.2;
/// Distance of the center of head and hand behind the surface, meters.
const BEHIND: [f64; 2] = [0.075, 0.04];
/// Least and greatest distance of a hand from its elbow: fraction of the forearm, and meters beyond it.
const FROM_ELBOW: (f64, f64) = (0.6, 0.2);
/// A region within this distance of a limb is on it if the hand's own arm is [`OFF_ARM`] farther away, meters.
const ON_LIMB: f32 = 0.05;
/// See [`ON_LIMB`].
const OFF_ARM: f32 = 0.03;
/// The body is searched for within this distance of the predicted joints, in the image and along the optical axis, meters.
const SEARCHED: f64 = 0.4;
/// Enlargement around them of the part of the image whose colors are learned as surroundings, meters.
const LEARNED: f64 = 0.2;
/// Colors are learned within this fraction of a face's radius, and none as surroundings within that many of any site's radius.
const TAUGHT: (f64, f64) = (0.8, 2.5);
/// A region this near to where its site was last found, extrapolated, remains its candidate, meters...
const SAME_REGION: f64 = 0.10;
/// ... for this time, seconds, and up to this distance from the predicted site, meters.
const KEPT: (f64, f64) = (0.25, 0.35);
/// Least distance from the camera, meters.
const NEAREST: f64 = 0.1;

/// Parameters that turn skin regions into rays.
#[derive(Clone, Debug, Default)]
pub struct SkinSettings {
    /// Names of the sites; those of hands start with `l_` or `r_`.
    pub sites: Vec<String>,
    /// Gate of a region around the predicted site, meters.
    pub gate: f64,
    /// Growth of the gate while its site is not detected, meters per second.
    pub growth: f64,
    /// Largest gate, meters.
    pub lost_gate: f64,
    /// Largest gate of a hand beside a depth camera, meters.
    pub widest_gate: f64,
}

/// A site that is searched for.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    /// Index of the site.
    pub site: usize,
    /// Predicted position, meters.
    pub place: Vec3,
    /// That of the elbow of its side.
    pub elbow: Option<Vec3>,
}

/// A color image, and what is known of the body at its time.
#[derive(Clone, Copy, Debug)]
pub struct SkinInput<'a> {
    /// Blue, green, red, row by row.
    pub image: &'a [[u8; 3]],
    /// Time, seconds.
    pub stamp: f64,
    /// The camera.
    pub eye: Eye<'a>,
    /// The image of a depth camera beside it.
    pub depth: Option<DepthBeside<'a>>,
    /// Predicted positions of the body, meters.
    pub joints: &'a [Vec3],
    /// The sites that are searched for.
    pub expected: &'a [Expected],
    /// The tracked body in its last pose; `None` if it is not known.
    pub tracker: Option<&'a BodyTracker>,
    /// Other persons; a region nearer to them than to the body belongs to them.
    pub others: &'a [&'a BodyTracker],
}

/// A pixel where a head or hand may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SkinCandidate {
    /// Column and row.
    pub pixel: [f64; 2],
    /// Number of its region.
    pub region: usize,
    /// Area of that region, pixels.
    pub area: usize,
    /// The only site that it may be; `None`: any.
    only: Option<usize>,
    /// Unit direction through the pixel, world frame.
    direction: Vec3,
    /// Position on the surface, if a depth camera measured it, meters.
    surface: Option<Vec3>,
}

/// A site that was detected in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundSite {
    /// Index of the site.
    pub site: usize,
    /// The ray's unit direction.
    pub direction: Vec3,
    /// Position of the site, if a depth camera measured it, meters.
    pub place: Option<Vec3>,
    /// Predicted depth of the site along the optical axis, meters.
    pub depth: f64,
}

/// Rows and columns of an image.
type Window = [Range<usize>; 2];

/// The state of the skin cue of one camera.
#[derive(Clone, Debug, Default)]
pub struct SkinCue {
    /// Parameters.
    pub settings: SkinSettings,
    /// The learned colors.
    pub colors: SkinColors,
    /// Height and width of the last image.
    pub size: [usize; 2],
    /// The part of the last image that was searched, and its pixels of skin.
    pub mask: (Window, Vec<u8>),
    /// The candidates in the last image.
    pub candidates: Vec<SkinCandidate>,
    /// Pairs of site index and candidate index.
    pub assigned: Vec<(usize, usize)>,
    /// For each site where it was last found, and its velocity.
    traces: Vec<Option<(Vec3, Vec3)>>,
    /// For each site the time of its last detection, or when it was first expected.
    missed: Vec<Option<f64>>,
}

impl SkinCue {
    /// Returns a cue without any image.
    pub fn new(settings: SkinSettings) -> Self {
        let count = settings.sites.len();
        Self { settings, traces: vec![None; count], missed: vec![None; count], ..Self::default() }
    }

    fn side(&self, site: usize) -> Option<Side> {
        self.settings.sites.get(site).and_then(|name| Side::of(name))
    }

    /// Finds the skin regions of an image; returns a ray for each detected site.
    ///
    /// # Errors
    /// [`TrackError`] when an image is not of its camera's size, or a tracker has no pose.
    pub fn observe(&mut self, input: &SkinInput) -> Result<Vec<FoundSite>, TrackError> {
        input.eye.check("image", "a color for every pixel of the camera", input.image.len())?;
        if let Some(depth) = &input.depth {
            depth.eye.check("depth", "a depth for every pixel of the camera", depth.image.len())?;
        }
        let depth = |site: &Expected| input.eye.in_sensor(site.place).z;
        let sites: Vec<Expected> = input.expected.iter().filter(|site| depth(site) > NEAREST).copied().collect();
        self.size = [input.eye.camera.height(), input.eye.camera.width()];
        self.candidates.clear();
        self.assigned.clear();
        self.mask.1.clear();
        let nearest = sites.iter().map(depth).fold(f64::INFINITY, f64::min);
        let farthest = sites.iter().map(depth).fold(0.0, f64::max);
        if !(nearest.is_finite() && farthest.is_finite()) {
            return Ok(Vec::new());
        }
        let ranges = self.segment(input, [nearest - SEARCHED, farthest + SEARCHED]);
        self.find_candidates(input, &sites, &ranges, PALM * input.eye.focal() / nearest);
        let costs = self.costs(input, &sites)?;
        let mut found = Vec::new();
        for (row, column) in one_to_one(&costs, self.candidates.len(), |column| self.candidates[column].region) {
            let (site, candidate) = (&sites[row], self.candidates[column]);
            let place = self.inside(site.site, &candidate);
            let origin = input.eye.origin();
            let on_ray = (site.place - origin).dot(candidate.direction).max(NEAREST);
            self.remember(site.site, place.unwrap_or(origin + on_ray * candidate.direction), input.stamp);
            self.assigned.push((site.site, column));
            found.push(FoundSite { site: site.site, direction: candidate.direction, place, depth: depth(site) });
        }
        found.sort_by_key(|found| found.site);
        Ok(found)
    }

    /// Finds the skin pixels near the body; returns the depth of each pixel of the window, NaN where it is not known.
    fn segment(&mut self, input: &SkinInput, [near, far]: [f64; 2]) -> Vec<f64> {
        let window = window(&input.eye, input.joints, SEARCHED);
        let (width, columns) = (input.eye.camera.width(), window[1].len());
        let index = |(row, column): (usize, usize)| row * width + column;
        let rows = window[0].clone().flat_map(|row| &input.image[row * width..][window[1].clone()]);
        let colored: Vec<u8> = rows.map(|color| u8::from(self.colors.contains(*color))).collect();
        let mut mask = smoothed(&colored, columns.max(1));
        let mut ranges = vec![f64::NAN; mask.len()];
        if let Some(depth) = &input.depth {
            let rays = input.eye.camera.rays();
            let marked = pixels(&window).zip(mask.iter_mut().zip(&mut ranges)).filter(|(_, (mask, _))| **mask != 0);
            for (pixel, (mask, range)) in marked {
                if let Some(z) = depth.at(&input.eye, rays[index(pixel)].map(f64::from), 0.5 * (near + far)) {
                    (*mask, *range) = (u8::from(near < z && z < far), z);
                }
            }
        }
        self.mask = (window, opened(&mask, columns.max(1)));
        ranges
    }

    /// Finds the pixels where head and hands may be, for a palm of this radius in pixels. A region longer than a hand is a
    /// forearm whose hand is at the end far from the elbow.
    fn find_candidates(&mut self, input: &SkinInput, sites: &[Expected], ranges: &[f64], palm: f64) {
        let ([rows, columns], mask) = &self.mask;
        let width = columns.len().max(1);
        let at = |index: usize| [(columns.start + index % width) as f64, (rows.start + index / width) as f64];
        let smallest = sites.iter().map(|site| smallest(input, site)).fold(f64::INFINITY, f64::min);
        let largest = MOST_FACES * PI * (FACE / PALM * palm).powi(2);
        let mut found = Vec::new();
        for (region, members) in regions(mask, width).iter().enumerate() {
            let area = members.len();
            if area < FEWEST_PIXELS || !(smallest..=largest).contains(&(area as f64)) {
                continue;
            }
            let mut add = |only: Option<usize>, pixel: [f64; 2]| {
                let mut near: Vec<f64> = members
                    .iter()
                    .filter(|index| apart(at(**index), pixel) < palm && ranges[**index].is_finite())
                    .map(|index| ranges[*index])
                    .collect();
                near.sort_unstable_by(f64::total_cmp);
                let direction = input.eye.direction(pixel);
                let range =
                    (near.len() >= FEWEST_POINTS).then(|| near[near.len() / 2] / direction.dot(input.eye.axis()));
                let surface = range.map(|range| input.eye.origin() + range * direction);
                if direction.is_finite() {
                    found.push(SkinCandidate { pixel, region, area, only, direction, surface });
                }
            };
            let (middle, length) = extent(members.iter().map(|index| at(*index)));
            if length <= LONGEST_HAND * palm {
                add(None, middle);
                continue;
            }
            for site in sites {
                if self.side(site.site).is_none() {
                    add(Some(site.site), middle);
                    continue;
                }
                let Some(elbow) = site.elbow else { continue };
                let elbow = input.eye.pixel(input.eye.in_sensor(elbow));
                let farther = |a: &&usize, b: &&usize| apart(at(**a), elbow).total_cmp(&apart(at(**b), elbow));
                if let Some(end) = members.iter().max_by(farther).filter(|_| elbow[0].is_finite()) {
                    let hand = members.iter().map(|index| at(*index));
                    add(Some(site.site), extent(hand.filter(|pixel| apart(*pixel, at(*end)) < HAND_AT_END * palm)).0);
                }
            }
        }
        self.candidates = found;
    }

    /// For each site and candidate the distance, meters; infinite where the candidate cannot be the site.
    fn costs(&mut self, input: &SkinInput, sites: &[Expected]) -> Result<Vec<f64>, TrackError> {
        let surfaces: Vec<[f64; 3]> =
            self.candidates.iter().map(|candidate| candidate.surface.unwrap_or_default().to_array()).collect();
        let points = PointSlice::F64(&surfaces);
        let (mut roles, mut limbs) = (Vec::new(), Vec::new());
        if let Some(tracker) = input.tracker.filter(|_| !surfaces.is_empty()) {
            let body = tracker.body();
            roles = (0..body.limbs().len()).map(|limb| body.roles().limb(limb)).collect();
            limbs = tracker.limb_distances(points)?;
        }
        let mut others = vec![f32::INFINITY; surfaces.len()];
        for other in input.others.iter().filter(|_| !surfaces.is_empty()) {
            others.iter_mut().zip(other.distance(points)?).for_each(|(least, away)| *least = least.min(away));
        }
        let least = |column: usize, chosen: &dyn Fn(Option<LimbRole>) -> bool| {
            let chosen = roles.iter().zip(&limbs).filter(|(role, _)| chosen(**role));
            chosen.fold(f32::INFINITY, |least, (_, away)| least.min(away[column]))
        };
        let mut costs = Vec::with_capacity(sites.len() * surfaces.len());
        for site in sites {
            let side = self.side(site.site);
            let since = *self.missed[site.site].get_or_insert(input.stamp);
            let beside = input.depth.is_some() && side.is_some();
            let widest = if beside { self.settings.widest_gate } else { self.settings.lost_gate };
            let gate = (self.settings.gate + self.settings.growth * (input.stamp - since).max(0.0)).min(widest);
            let smallest = smallest(input, site);
            let own_arm =
                |role| matches!(role, Some(LimbRole::Forearm(own) | LimbRole::Hand(own)) if Some(own) == side);
            for (column, candidate) in self.candidates.iter().enumerate() {
                let elsewhere = candidate.surface.is_some() && {
                    let other = least(column, &|role| !own_arm(role));
                    let on_limb = side.is_some() && other < ON_LIMB && least(column, &own_arm) > other + OFF_ARM;
                    on_limb || (!roles.is_empty() && others[column] < least(column, &|_| true))
                };
                let ruled_out = elsewhere
                    || (candidate.area as f64) < smallest
                    || candidate.only.is_some_and(|only| only != site.site);
                let distance = (!ruled_out && self.within_arm(site, candidate))
                    .then(|| self.distance(site, candidate, input, gate))
                    .flatten();
                costs.push(distance.unwrap_or(f64::INFINITY));
            }
        }
        Ok(costs)
    }

    /// Distance of a candidate from a site, if that is within the gate, or from where the site was last found.
    fn distance(&self, site: &Expected, candidate: &SkinCandidate, input: &SkinInput, gate: f64) -> Option<f64> {
        let from = |target: Vec3| match self.inside(site.site, candidate) {
            Some(place) => place.distance(target),
            None => input.eye.distance_from_ray(target, candidate.direction),
        };
        let distance = from(site.place);
        let trace = self.traces[site.site].zip(self.missed[site.site]).filter(|_| input.depth.is_some());
        let kept = trace.and_then(|((place, velocity), since)| {
            let elapsed = input.stamp - since;
            let away = from(place + elapsed * velocity);
            (elapsed < KEPT.0 && away < SAME_REGION && distance < KEPT.1).then_some(away)
        });
        kept.map(|away| away.min(distance)).or((distance < gate).then_some(distance))
    }

    /// Position of a site whose surface the candidate is.
    fn inside(&self, site: usize, candidate: &SkinCandidate) -> Option<Vec3> {
        candidate.surface.map(|surface| surface + BEHIND[usize::from(self.side(site).is_some())] * candidate.direction)
    }

    /// Whether a candidate is as far from the elbow as a hand; true for a head, and without depth.
    fn within_arm(&self, site: &Expected, candidate: &SkinCandidate) -> bool {
        let Some((elbow, place)) = site.elbow.zip(self.inside(site.site, candidate)) else { return true };
        let (forearm, apart) = (site.place.distance(elbow), place.distance(elbow));
        self.side(site.site).is_none() || (FROM_ELBOW.0 * forearm < apart && apart < forearm + FROM_ELBOW.1)
    }

    fn remember(&mut self, site: usize, place: Vec3, stamp: f64) {
        let moved = |((before, velocity), since): ((Vec3, Vec3), f64)| {
            let elapsed = stamp - since;
            let fresh = 0.0 < elapsed && elapsed < KEPT.0;
            if fresh { 0.5 * velocity + 0.5 / elapsed * (place - before) } else { Vec3::ZERO }
        };
        let velocity = self.traces[site].zip(self.missed[site]).map_or(Vec3::ZERO, moved);
        self.traces[site] = Some((place, velocity));
        self.missed[site] = Some(stamp);
    }

    /// Learns the colors of the face and of what is around the body. `joints` are the positions of the body, and `sites` those of
    /// head and hands, meters, NaN where they are not known. The head must have been found, unless nothing was learned yet.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when the image is not of the camera's size.
    pub fn learn(&mut self, image: &[[u8; 3]], eye: &Eye, joints: &[Vec3], sites: &[Vec3]) -> Result<(), TrackError> {
        eye.check("image", "a color for every pixel of the camera", image.len())?;
        let (mut faces, mut discs) = (Vec::new(), Vec::new());
        let inside = sites.iter().map(|place| eye.in_sensor(*place)).enumerate();
        for (site, inside) in inside.filter(|(_, inside)| inside.z > NEAREST) {
            let head = self.side(site).is_none();
            let (pixel, radius) = (eye.pixel(inside), if head { FACE } else { PALM } * eye.focal() / inside.z);
            discs.push((pixel, TAUGHT.1 * radius));
            if head && (self.colors.learned == 0 || self.assigned.iter().any(|(found, _)| *found == site)) {
                faces.push((pixel, TAUGHT.0 * radius));
            }
        }
        let within = |discs: &[([f64; 2], f64)], (row, column): (usize, usize)| {
            let off = |middle: &[f64; 2]| (middle[0] - column as f64).powi(2) + (middle[1] - row as f64).powi(2);
            discs.iter().any(|(middle, radius)| off(middle) <= radius * radius)
        };
        let window = window(eye, joints, LEARNED);
        let color = |(row, column): (usize, usize)| image[row * eye.camera.width() + column];
        let face = pixels(&window).filter(|pixel| within(&faces, *pixel)).map(color);
        self.colors.learn(face, pixels(&window).filter(|pixel| !within(&discs, *pixel)).map(color));
        Ok(())
    }
}

/// Least area of a region that is a site, pixels.
fn smallest(input: &SkinInput, site: &Expected) -> f64 {
    let palm = PALM * input.eye.focal() / input.eye.in_sensor(site.place).z;
    SMALLEST[usize::from(input.depth.is_none())] * PI * palm * palm
}

/// Rows and columns of the image that show the surroundings of positions in front of the camera, to this distance in meters.
fn window(eye: &Eye, joints: &[Vec3], around: f64) -> Window {
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for inside in joints.iter().map(|place| eye.in_sensor(*place)).filter(|inside| inside.z > NEAREST) {
        let (pixel, margin) = (eye.pixel(inside), around * eye.focal() / inside.z);
        for axis in 0..2 {
            low[axis] = low[axis].min(pixel[1 - axis] - margin);
            high[axis] = high[axis].max(pixel[1 - axis] + margin);
        }
    }
    let span = |axis: usize, size: usize| {
        let [first, end] = [low[axis].floor(), high[axis].ceil()].map(|value| value.clamp(0.0, size as f64) as usize);
        first..end.max(first)
    };
    [span(0, eye.camera.height()), span(1, eye.camera.width())]
}

/// The pixels (row, column) of a part of an image, row by row.
fn pixels([rows, columns]: &Window) -> impl Iterator<Item = (usize, usize)> {
    let columns = columns.clone();
    rows.clone().flat_map(move |row| columns.clone().map(move |column| (row, column)))
}

fn apart(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

/// Center of pixels, and the length of an ellipse with the same second moments.
fn extent(pixels: impl Iterator<Item = [f64; 2]> + Clone) -> ([f64; 2], f64) {
    let count = pixels.clone().count().max(1) as f64;
    let middle = [0, 1].map(|axis| pixels.clone().map(|pixel| pixel[axis]).sum::<f64>() / count);
    let moment = |a: usize, b: usize| {
        pixels.clone().map(|pixel| (pixel[a] - middle[a]) * (pixel[b] - middle[b])).sum::<f64>() / count
    };
    let (uu, vv, uv) = (moment(0, 0), moment(1, 1), moment(0, 1));
    // The greater eigenvalue, with the variance within a pixel.
    let spread = 0.5 * (uu + vv) + (0.25 * (uu - vv).powi(2) + uv * uv).sqrt() + 1.0 / 12.0;
    (middle, 4.0 * spread.sqrt())
}

/// Pairs of row and column with the least costs, in that order: a row has one column, and a region, of which a column is a part,
/// one row.
fn one_to_one(costs: &[f64], columns: usize, region: impl Fn(usize) -> usize) -> Vec<(usize, usize)> {
    let mut open: Vec<usize> = (0..costs.len()).filter(|index| costs[*index].is_finite()).collect();
    open.sort_by(|a, b| costs[*a].total_cmp(&costs[*b]));
    let mut pairs: Vec<(usize, usize)> = Vec::new();
    for (row, column) in open.into_iter().map(|index| (index / columns, index % columns)) {
        if pairs.iter().all(|pair| pair.0 != row && region(pair.1) != region(column)) {
            pairs.push((row, column));
        }
    }
    pairs
}
