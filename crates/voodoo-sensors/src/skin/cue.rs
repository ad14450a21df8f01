//! The skin cue of one camera (K06 III-A): segmentation that adapts, regions, and their assignment.

use std::f64::consts::PI;
use std::sync::Arc;

use crate::body_view::BodyView;
use crate::chroma::find_bins;
use crate::mask_regions::SkinPicture;
use crate::registration::Labels;
use crate::skin::blobs::{Blobs, Sight};
use crate::skin::candidates::{Candidate, PALM, candidates};
use crate::skin::naming::{Choice, Rules};
use crate::skin::picture::Picture;
use crate::skin::rules::{Expected, LimbDistances, Seen, of_pieces};
use crate::skin::teacher::Teacher;
use voodoo_core::error::TrackError;
use voodoo_core::math::Vec3;

/// Regions no longer than this, in radii of a palm, may be parts of one hand: a shadow between the fingers and the palm does not make
/// two of it. Arms that lie near each other stay apart.
const LONGEST_JOINED: f64 = 3.0;
/// A smaller share of a palm is a speck.
const SPECK: f64 = 0.7;
/// The middle of a head lies this far behind its face, metres.
const FACE_BEHIND: f64 = 0.075;
/// And that of a hand behind its skin.
const HAND_BEHIND: f64 = 0.04;
/// Depth is looked for within so many radii of a palm around a candidate.
const LOOKED_AT: f64 = 1.5;

/// How skin regions become rays.
#[derive(Clone, Debug)]
pub struct SkinSettings {
    /// Names of the sites; those of a hand begin with the letter of its side, and so do its limbs.
    pub sites: Vec<String>,
    /// A new region farther than this from the predicted site is not it, metres.
    pub gate: f64,
    /// The gate grows by this while its site is not seen, metres a second.
    pub growth: f64,
    /// Up to this, metres.
    pub lost_gate: f64,
    /// And for a hand that a depth camera sees up to this.
    pub widest_gate: f64,
    /// A region is taken far from where its site is expected only if it is this far outside the body, metres.
    pub unexplained: f64,
    /// A second candidate that is not this many times as far as the first makes both useless.
    pub ambiguity: f64,
}

impl SkinSettings {
    /// Whether a site is the head's.
    pub fn is_head(&self, site: usize) -> bool {
        self.sites.get(site).is_some_and(|name| name.starts_with("head"))
    }

    /// What the names of its side begin with.
    fn side(&self, site: usize) -> &str {
        let name = self.sites.get(site).map_or("", String::as_str);
        name.split_at_checked(1).map_or(name, |(side, _)| side)
    }
}

/// A picture, and where the sites are expected in it.
#[derive(Clone, Copy, Debug)]
pub struct Look<'a> {
    /// Blue, green, red, row by row.
    pub image: &'a [[u8; 3]],
    /// Rows and columns.
    pub size: [usize; 2],
    /// Time, seconds.
    pub stamp: f64,
    /// Focal length, pixels.
    pub focal: f64,
    /// What a depth camera saw of the body in it.
    pub body: Option<&'a Arc<BodyView>>,
    /// What was learnt.
    pub teacher: &'a Teacher,
    /// Sites before the camera.
    pub expected: &'a [Expected],
    /// Whether enough was learnt to tell skin.
    pub settled: bool,
}

/// A site that was found in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FoundSite {
    /// Its number.
    pub site: usize,
    /// A point of the ray that it is on, world, metres.
    pub origin: Vec3,
    /// The ray's unit direction.
    pub direction: Vec3,
    /// Where on it the site is, if a depth camera saw it, metres.
    pub place: Option<Vec3>,
    /// Where it is expected along the optical axis, metres.
    pub depth: f64,
}

/// What was found in a picture, before names are given.
#[derive(Clone, Debug, Default)]
struct Looked {
    candidates: Vec<Candidate>,
    labels: Arc<Labels>,
    expected: Vec<Expected>,
    sights: Vec<Sight>,
    /// Of the sights along the optical axis, metres.
    depths: Vec<f64>,
    origin: Vec3,
    stamp: f64,
    focal: f64,
}

/// The skin cue of one camera: what changes from picture to picture.
#[derive(Clone, Debug)]
pub struct SkinCue {
    /// How regions become rays.
    pub settings: SkinSettings,
    /// Regions that are followed.
    pub blobs: Blobs,
    /// The last picture.
    pub picture: Arc<Picture>,
    /// Pairs of a site's and a candidate's number.
    pub assigned: Vec<(usize, usize)>,
    looked: Looked,
    spare: Option<Arc<Picture>>,
}

impl SkinCue {
    /// Nothing was seen yet.
    pub fn new(settings: SkinSettings) -> Self {
        Self {
            blobs: Blobs::new(settings.sites.len()),
            settings,
            picture: Arc::default(),
            assigned: Vec::new(),
            looked: Looked::default(),
            spare: None,
        }
    }

    /// Where in the last picture a head or a hand may be.
    pub fn candidates(&self) -> &[Candidate] {
        &self.looked.candidates
    }

    /// The same, without memory that it would reuse.
    pub fn twin(&self) -> Self {
        let mut twin = self.clone();
        twin.spare = None;
        twin
    }

    /// Looks for regions of skin; their candidates are then known.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when sizes do not fit together.
    pub fn look(&mut self, look: &Look) -> Result<(), TrackError> {
        let palm = PALM * look.focal / nearest(look.expected);
        // The last picture but one is needed no more.
        let mut picture = self.spare.take().and_then(|spare| Arc::try_unwrap(spare).ok()).unwrap_or_default();
        find_bins(look.image, &mut picture.bins);
        let body = look.body.filter(|body| body.size == look.size);
        if look.body.is_some() && body.is_none() {
            return Err(TrackError::measurement("body", "a view of the picture's size", format!("{:?}", look.size)));
        }
        let Picture { bins, seen, skin, .. } = &mut picture;
        let looked = SkinPicture {
            bins,
            width: look.size[1],
            table: &look.teacher.colors.table[..],
            body: body.map(|body| &body.mask[..]),
            always: look.teacher.always(look.size),
            before: body.and_then(|body| body.before.as_deref()),
        };
        looked.find(LONGEST_JOINED * palm, seen, skin)?;
        (self.looked.candidates, self.looked.labels) = if look.settled && !look.expected.is_empty() {
            let (found, labels) = candidates(skin, look.size[1], palm);
            (found, Arc::new(labels))
        } else {
            Default::default()
        };
        (picture.size, picture.body) = (look.size, body.cloned());
        self.spare = Some(std::mem::replace(&mut self.picture, Arc::new(picture)));
        self.looked.expected = look.expected.to_vec();
        self.assigned.clear();
        (self.looked.stamp, self.looked.focal) = (look.stamp, look.focal);
        Ok(())
    }

    /// Puts the candidates into space and follows them: as deep as the depth camera has them, else where the nearest site is.
    ///
    /// `directions` are unit vectors from the camera's `origin` through the candidates' pixels, `axis` its optical axis; world.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when there are not as many directions as candidates.
    pub fn place(&mut self, directions: &[Vec3], origin: Vec3, axis: Vec3) -> Result<&[Sight], TrackError> {
        if directions.len() != self.looked.candidates.len() {
            let found = format!("{} for {}", directions.len(), self.looked.candidates.len());
            return Err(TrackError::measurement("directions", "one for each candidate", found));
        }
        let nearest = nearest(&self.looked.expected);
        let looked = match &self.picture.body {
            Some(body) => {
                let places: Vec<_> = self.looked.candidates.iter().map(|item| (item.pixel, item.region)).collect();
                let radius = LOOKED_AT * PALM * self.looked.focal / nearest;
                body.measured().nearest_surfaces(&self.looked.labels, &places, radius)?
            }
            None => vec![None; directions.len()],
        };
        self.looked.origin = origin;
        (self.looked.sights, self.looked.depths) = (Vec::new(), Vec::new());
        for ((direction, item), found) in directions.iter().zip(&self.looked.candidates).zip(looked) {
            let z = found.map_or(nearest, |(z, _)| z);
            self.looked.depths.push(z);
            self.looked.sights.push(Sight {
                direction: *direction,
                place: origin + *direction * (z / direction.dot(axis)),
                deep: found.is_some(),
                hand: item.hand,
                region: item.region,
                still: found.is_some_and(|(_, still)| still),
            });
        }
        self.blobs.follow(&self.looked.sights, self.looked.stamp);
        Ok(&self.looked.sights)
    }

    /// Which of the candidates each site is, and on which ray it was seen.
    ///
    /// `limbs` are the candidates' distances from the body's limbs, `strangers` those from other persons, metres: what is nearer to
    /// them is theirs.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when there are not as many distances as candidates.
    pub fn name(&mut self, limbs: &LimbDistances, strangers: Option<&[f32]>) -> Result<Vec<FoundSite>, TrackError> {
        let count = self.looked.sights.len();
        if limbs.away.len() != limbs.names.len() * count || strangers.is_some_and(|others| others.len() != count) {
            let found = format!("{} of {} limbs for {count}", limbs.away.len(), limbs.names.len());
            return Err(TrackError::measurement("distances", "one for each limb and candidate", found));
        }
        let specks: Vec<bool> = self
            .candidates()
            .iter()
            .zip(&self.looked.depths)
            .map(|(item, z)| (item.area as f64) < SPECK * PI * (PALM * self.looked.focal / z).powi(2))
            .collect();
        let seen = Seen {
            sights: &self.looked.sights,
            blobs: &self.blobs.items[..count],
            specks: &specks,
            limbs,
            unexplained: self.settings.unexplained as f32,
        };
        let theirs = |index: usize| {
            let known = strangers.filter(|_| !limbs.names.is_empty());
            known.is_some_and(|others| self.looked.sights[index].deep && others[index] < limbs.nearest(index))
        };
        let theirs: Vec<bool> = (0..count).map(theirs).collect();
        let mut choices: Vec<Choice> =
            self.looked.expected.iter().map(|site| self.choice(site, &seen, &theirs)).collect();
        // Names are given below; what could be a piece of a hand is known before.
        let pieces: Vec<Vec<bool>> = choices.iter().map(|choice| self.pieces(choice)).collect();
        let rules =
            Rules { gate: self.settings.gate, growth: self.settings.growth, ambiguity: self.settings.ambiguity };
        let named = self.blobs.name(&mut choices, &rules, self.looked.stamp);
        let taken: Vec<usize> = named.iter().map(|(_, column)| *column).collect();
        let free = |row: usize, column: &usize| pieces[row][*column] && !taken.contains(column);
        self.assigned = named.iter().map(|(row, column)| (self.looked.expected[*row].site, *column)).collect();
        let found = |&(row, column): &(usize, usize)| {
            let pieces: Vec<usize> = (0..count).filter(|column| free(row, column)).collect();
            self.found(&self.looked.expected[row], column, &pieces)
        };
        Ok(named.iter().map(found).collect())
    }

    /// Where a site is when a sight is its surface.
    fn inside(&self, site: &Expected, sight: &Sight) -> Vec3 {
        sight.place + sight.direction * if site.head { FACE_BEHIND } else { HAND_BEHIND }
    }

    fn choice(&self, site: &Expected, seen: &Seen, theirs: &[bool]) -> Choice {
        let inside: Vec<Vec3> = self.looked.sights.iter().map(|sight| self.inside(site, sight)).collect();
        let distance: Vec<f64> = self
            .looked
            .sights
            .iter()
            .zip(&inside)
            .map(|(sight, inside)| {
                if sight.deep {
                    return inside.distance(site.place);
                }
                let offset = site.place - self.looked.origin;
                (offset - offset.dot(sight.direction).max(0.0) * sight.direction).length()
            })
            .collect();
        let mut allowed = seen.allowed(site, &inside);
        for (index, allowed) in allowed.iter_mut().enumerate() {
            // A speck far from where the hand is expected is what is left of another region.
            if theirs[index] || (distance[index] > self.settings.gate && seen.specks[index]) {
                *allowed = 0;
            }
        }
        let deep = self.picture.body.is_some();
        let widest = if deep && !site.head { self.settings.widest_gate } else { self.settings.lost_gate };
        let elsewhere = seen.elsewhere(site, self.settings.side(site.site));
        Choice { site: site.site, widest, distance, allowed, elsewhere }
    }

    fn pieces(&self, choice: &Choice) -> Vec<bool> {
        let marks = choice.allowed.iter().zip(&choice.elsewhere).zip(&self.looked.sights);
        marks.map(|((allowed, elsewhere), sight)| *allowed > 0 && !elsewhere && sight.deep).collect()
    }

    fn found(&self, site: &Expected, column: usize, pieces: &[usize]) -> FoundSite {
        let sight = &self.looked.sights[column];
        let mut direction = sight.direction;
        let mut place = sight.deep.then(|| self.inside(site, sight));
        if let (Some(whole), false) = (place, site.head) {
            let pieces = pieces.iter().map(|piece| self.inside(site, &self.looked.sights[*piece]));
            let middle = of_pieces(whole, pieces, site.place);
            direction = (middle - self.looked.origin).normalize();
            place = Some(middle);
        }
        let shift = site.to_palm();
        let place = place.map(|place| place + shift);
        FoundSite { site: site.site, origin: self.looked.origin + shift, direction, place, depth: site.depth }
    }
}

/// How far the nearest site is along the optical axis, metres.
fn nearest(expected: &[Expected]) -> f64 {
    let nearest = expected.iter().fold(f64::INFINITY, |least, site| least.min(site.depth));
    if nearest.is_finite() { nearest } else { 1.0 }
}
