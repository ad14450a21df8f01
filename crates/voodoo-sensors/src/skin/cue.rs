//! The skin cue of one camera (K06 III-A): adaptive segmentation, regions, and their assignment to sites.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::body_view::BodyView;
use crate::chroma::find_bins;
use crate::eye::Eye;
use crate::mask_regions::SkinPicture;
use crate::registration::RegionLabels;
use crate::skin::blobs::{Blobs, Sight};
use crate::skin::candidates::{PALM, SkinCandidate, candidates};
use crate::skin::naming::{Choice, Rules};
use crate::skin::picture::Picture;
use crate::skin::rules::{Expected, LimbDistances, SightContext, of_pieces};
use crate::skin::teacher::Teacher;
use voodoo_core::BodyTracker;
use voodoo_core::PointSlice;
use voodoo_core::Side;
use voodoo_core::TrackError;
use voodoo_core::math::Vec3;

/// Regions no longer than this, in palm radii, may be parts of one hand, so that a shadow between fingers and palm does not split
/// it. Arms near each other stay separate.
const LONGEST_JOINED: f64 = 3.0;
/// A region below this fraction of a palm's area is too small for a hand.
const SPECK: f64 = 0.7;
/// Distance of the head's center behind the surface of the face, meters.
const FACE_BEHIND: f64 = 0.075;
/// Distance of a hand's center behind its surface, meters.
const HAND_BEHIND: f64 = 0.04;
/// Depth is sampled within this many palm radii around a candidate.
const SURFACE_RADIUS: f64 = 1.5;
/// Least distance from the camera at which sites are searched for, meters.
const NEAREST_SITE: f64 = 0.1;

/// Parameters that turn skin regions into rays.
#[derive(Clone, Debug)]
pub struct SkinSettings {
    /// Names of the sites; those of hands start with `l_` or `r_`.
    pub sites: Vec<String>,
    /// Gate of a new region around the predicted site, meters.
    pub gate: f64,
    /// Growth of the gate while its site is not detected, meters per second.
    pub growth: f64,
    /// Largest gate, meters.
    pub lost_gate: f64,
    /// Largest gate of a hand whose distance a depth camera measures, meters.
    pub widest_gate: f64,
    /// A region far from the predicted site is accepted only if it is at least this far outside the body, meters.
    pub unexplained: f64,
    /// If the second-best candidate is less than this many times as far as the best one, neither is accepted.
    pub ambiguity: f64,
}

impl SkinSettings {
    /// Whether a site is the head.
    pub fn is_head(&self, site: usize) -> bool {
        self.sites.get(site).is_some_and(|name| name.starts_with("head"))
    }

    /// The side of a hand.
    fn side(&self, site: usize) -> Option<Side> {
        self.sites.get(site).and_then(|name| Side::of(name))
    }
}

/// A color image, and what is known of the body at its time.
#[derive(Clone, Copy)]
pub struct SkinInput<'a> {
    /// Blue, green, red, row by row.
    pub image: &'a [[u8; 3]],
    /// Height and width of the image.
    pub size: [usize; 2],
    /// Time, seconds.
    pub stamp: f64,
    /// The camera.
    pub eye: Eye<'a>,
    /// Depth measurements near the body, registered to the image.
    pub body: Option<&'a Arc<BodyView>>,
    /// The learned colors and background.
    pub teacher: &'a Teacher,
    /// Whether the colors were learned from enough images.
    pub settled: bool,
    /// The sites that are searched for.
    pub expected: &'a [Expected],
    /// The tracked body in its last pose; `None` if it is not known.
    pub tracker: Option<&'a BodyTracker>,
    /// Other persons; a region nearer to them than to the body belongs to them.
    pub others: &'a [&'a BodyTracker],
}

impl SkinInput<'_> {
    /// Depth of a site along the optical axis, meters.
    fn depth(&self, site: &Expected) -> f64 {
        self.eye.in_sensor(site.place).z
    }

    /// Returns the sites in front of the camera.
    fn in_front(&self) -> Vec<Expected> {
        let in_front = |site: &&Expected| {
            let place = self.eye.in_sensor(site.place);
            place.is_finite() && place.z > NEAREST_SITE
        };
        self.expected.iter().filter(in_front).copied().collect()
    }

    /// Unit directions through the candidates' pixels, world frame.
    fn directions(&self, candidates: &[SkinCandidate]) -> Vec<Vec3> {
        candidates.iter().map(|item| self.eye.direction(self.eye.undistorted(item.pixel))).collect()
    }

    /// Distances of positions from the surfaces of the body's limbs.
    fn limb_distances(&self, places: &[[f64; 3]]) -> Result<LimbDistances, TrackError> {
        let Some(tracker) = self.tracker else { return Ok(LimbDistances::default()) };
        let body = tracker.body();
        let roles = (0..body.limbs().len()).map(|limb| body.roles().limb(limb)).collect();
        Ok(LimbDistances { roles, away: tracker.limb_distances(PointSlice::F64(places))?.concat() })
    }

    /// Distances of positions from the nearest other person; `None` without other persons.
    fn others_distance(&self, places: &[[f64; 3]]) -> Result<Option<Vec<f32>>, TrackError> {
        let mut nearest: Option<Vec<f32>> = None;
        for other in self.others {
            let away = other.distance(PointSlice::F64(places))?;
            nearest = Some(match nearest {
                Some(nearest) => nearest.iter().zip(&away).map(|(nearest, away)| nearest.min(*away)).collect(),
                None => away,
            });
        }
        Ok(nearest)
    }
}

/// A site that was detected in an image.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundSite {
    /// Index of the site.
    pub site: usize,
    /// A point of its ray, world frame, meters.
    pub origin: Vec3,
    /// The ray's unit direction.
    pub direction: Vec3,
    /// Position of the site, if a depth camera measured it, meters.
    pub place: Option<Vec3>,
    /// Predicted depth of the site along the optical axis, meters.
    pub depth: f64,
}

/// The state of the skin cue of one camera.
#[derive(Clone, Debug)]
pub struct SkinCue {
    /// Parameters.
    pub settings: SkinSettings,
    /// The tracked regions.
    pub blobs: Blobs,
    /// The last image and its segmentation.
    pub picture: Arc<Picture>,
    /// Pairs of site index and candidate index.
    pub assigned: Vec<(usize, usize)>,
    /// The candidates for heads and hands in the last image.
    pub candidates: Vec<SkinCandidate>,
    spare: Option<Arc<Picture>>,
}

impl SkinCue {
    /// Returns a cue without any image.
    pub fn new(settings: SkinSettings) -> Self {
        Self {
            blobs: Blobs::new(settings.sites.len()),
            settings,
            picture: Arc::default(),
            assigned: Vec::new(),
            candidates: Vec::new(),
            spare: None,
        }
    }

    /// Copies everything but the buffers for reuse.
    pub fn twin(&self) -> Self {
        let mut twin = self.clone();
        twin.spare = None;
        twin
    }

    /// Segments and tracks the skin regions of an image and assigns them to sites; returns a ray for each detected site.
    ///
    /// # Errors
    /// [`TrackError`] when sizes do not fit together, or a tracker has no pose.
    pub fn observe(&mut self, input: &SkinInput) -> Result<Vec<FoundSite>, TrackError> {
        let expected = input.in_front();
        let depths = expected.iter().map(|site| input.depth(site));
        let nearest = Some(depths.fold(f64::INFINITY, f64::min)).filter(|nearest| nearest.is_finite()).unwrap_or(1.0);
        // Radius of a palm at the nearest site.
        let radius = PALM * input.eye.focal() / nearest;
        self.assigned.clear();
        self.find_skin(input, radius)?;
        let labels = if input.settled && !expected.is_empty() {
            let (found, labels) = candidates(&self.picture.skin, input.size[1], radius);
            self.candidates = found;
            labels
        } else {
            self.candidates.clear();
            RegionLabels::default()
        };
        if self.candidates.is_empty() {
            return Ok(Vec::new());
        }
        let (sights, depths) = self.sights(input, &labels, nearest)?;
        self.blobs.follow(&sights, input.stamp);
        let places: Vec<[f64; 3]> = sights.iter().map(|sight| sight.place.to_array()).collect();
        let (limbs, others) = (input.limb_distances(&places)?, input.others_distance(&places)?);
        let count = sights.len();
        let specks: Vec<bool> = self
            .candidates
            .iter()
            .zip(&depths)
            .map(|(item, z)| (item.area as f64) < SPECK * PI * (PALM * input.eye.focal() / z).powi(2))
            .collect();
        let sight_context = SightContext {
            sights: &sights,
            blobs: &self.blobs.items[..count],
            specks: &specks,
            limbs: &limbs,
            unexplained: self.settings.unexplained as f32,
        };
        let theirs = |index: usize| {
            let known = others.as_ref().filter(|_| !limbs.roles.is_empty());
            known.is_some_and(|others| sights[index].deep && others[index] < limbs.nearest(index))
        };
        let theirs: Vec<bool> = (0..count).map(theirs).collect();
        let origin = input.eye.origin();
        let mut choices: Vec<Choice> =
            expected.iter().map(|site| self.choice(site, &sight_context, &theirs, origin)).collect();
        // Labels are assigned below; which candidates may be pieces of a hand is known before.
        let pieces: Vec<Vec<bool>> = choices.iter().map(|choice| pieces(choice, &sights)).collect();
        let rules =
            Rules { gate: self.settings.gate, growth: self.settings.growth, ambiguity: self.settings.ambiguity };
        let named = self.blobs.name(&mut choices, &rules, input.stamp);
        let taken: Vec<usize> = named.iter().map(|(_, column)| *column).collect();
        let free = |row: usize, column: &usize| pieces[row][*column] && !taken.contains(column);
        self.assigned = named.iter().map(|(row, column)| (expected[*row].site, *column)).collect();
        let found = |&(row, column): &(usize, usize)| {
            let pieces = (0..count).filter(|column| free(row, column)).map(|piece| &sights[piece]);
            found(&expected[row], &sights[column], pieces, input)
        };
        Ok(named.iter().map(found).collect())
    }

    /// Segments the skin pixels of an image for a palm of this radius in pixels.
    fn find_skin(&mut self, input: &SkinInput, radius: f64) -> Result<(), TrackError> {
        // The buffer of the image before the last is free for reuse.
        let mut picture = self.spare.take().and_then(|spare| Arc::try_unwrap(spare).ok()).unwrap_or_default();
        find_bins(input.image, &mut picture.bins);
        let body = input.body.filter(|body| body.size == input.size);
        if input.body.is_some() && body.is_none() {
            return Err(TrackError::measurement("body", "a view of the picture's size", format!("{:?}", input.size)));
        }
        let Picture { bins, colored, skin, .. } = &mut picture;
        let skin_picture = SkinPicture {
            bins,
            width: input.size[1],
            table: &input.teacher.colors.table[..],
            body: body.map(|body| &body.mask[..]),
            always: input.teacher.always(input.size),
            before: body.and_then(|body| body.before.as_deref()),
        };
        skin_picture.find(LONGEST_JOINED * radius, colored, skin)?;
        (picture.size, picture.body) = (input.size, body.cloned());
        self.spare = Some(std::mem::replace(&mut self.picture, Arc::new(picture)));
        Ok(())
    }

    /// The 3-D candidates and their depths along the optical axis: the measured depth, else that of the nearest site.
    fn sights(
        &self,
        input: &SkinInput,
        labels: &RegionLabels,
        nearest: f64,
    ) -> Result<(Vec<Sight>, Vec<f64>), TrackError> {
        let directions = input.directions(&self.candidates);
        let measured = match &self.picture.body {
            Some(body) => {
                let places: Vec<_> = self.candidates.iter().map(|item| (item.pixel, item.region)).collect();
                let radius = SURFACE_RADIUS * PALM * input.eye.focal() / nearest;
                body.measured().nearest_surfaces(labels, &places, radius)?
            }
            None => vec![None; directions.len()],
        };
        let (origin, axis) = (input.eye.origin(), input.eye.axis());
        let sight = |((direction, item), found): ((&Vec3, &SkinCandidate), Option<(f64, bool)>)| {
            let z = found.map_or(nearest, |(z, _)| z);
            let sight = Sight {
                direction: *direction,
                place: origin + *direction * (z / direction.dot(axis)),
                deep: found.is_some(),
                hand: item.hand,
                region: item.region,
                still: found.is_some_and(|(_, still)| still),
            };
            (sight, z)
        };
        Ok(directions.iter().zip(&self.candidates).zip(measured).map(sight).unzip())
    }

    fn choice(&self, site: &Expected, sight_context: &SightContext, theirs: &[bool], origin: Vec3) -> Choice {
        let inside: Vec<Vec3> = sight_context.sights.iter().map(|sight| inside(site, sight)).collect();
        let away = |(sight, inside): (&Sight, &Vec3)| {
            if sight.deep {
                return inside.distance(site.place);
            }
            let offset = site.place - origin;
            (offset - offset.dot(sight.direction).max(0.0) * sight.direction).length()
        };
        let distance: Vec<f64> = sight_context.sights.iter().zip(&inside).map(away).collect();
        let mut allowed = sight_context.allowed(site, &inside);
        for (index, allowed) in allowed.iter_mut().enumerate() {
            // A very small region far from the predicted hand is the remainder of another region.
            if theirs[index] || (distance[index] > self.settings.gate && sight_context.specks[index]) {
                *allowed = 0;
            }
        }
        let deep = self.picture.body.is_some();
        let widest = if deep && !site.head { self.settings.widest_gate } else { self.settings.lost_gate };
        let elsewhere = sight_context.elsewhere(site, self.settings.side(site.site));
        Choice { site: site.site, widest, distance, allowed, elsewhere }
    }
}

/// Position of a site if the candidate lies on its surface.
fn inside(site: &Expected, sight: &Sight) -> Vec3 {
    sight.place + sight.direction * if site.head { FACE_BEHIND } else { HAND_BEHIND }
}

/// For each candidate, whether it may be a piece of a site.
fn pieces(choice: &Choice, sights: &[Sight]) -> Vec<bool> {
    let marks = choice.allowed.iter().zip(&choice.elsewhere).zip(sights);
    marks.map(|((allowed, elsewhere), sight)| *allowed > 0 && !elsewhere && sight.deep).collect()
}

fn found<'a>(site: &Expected, sight: &Sight, pieces: impl Iterator<Item = &'a Sight>, input: &SkinInput) -> FoundSite {
    let origin = input.eye.origin();
    let mut direction = sight.direction;
    let mut place = sight.deep.then(|| inside(site, sight));
    if let (Some(whole), false) = (place, site.head) {
        let middle = of_pieces(whole, pieces.map(|piece| inside(site, piece)), site.place);
        direction = (middle - origin).normalize();
        place = Some(middle);
    }
    let shift = site.to_palm();
    let place = place.map(|place| place + shift);
    FoundSite { site: site.site, origin: origin + shift, direction, place, depth: input.depth(site) }
}
