//! Learns from images: the colors of skin, and the background that has such colors away from head and hands.

use crate::chroma::bins;
use crate::masks::{PIXEL_BLOCK, is_empty};
use crate::skin::candidates::{FACE, PALM};
use crate::skin::colors::{Lesson, SkinColors};
use crate::skin::discs::Disc;
use crate::skin::picture::Picture;

/// Neither skin nor background is learned within this many radii of a face or palm.
const NOTHING_LEARNED: f64 = 2.5;
/// Skin is learned within this fraction of the radius.
const WITHIN: f64 = 0.8;
/// Sites farther than this outside the image are ignored, pixels.
const FAR_OUTSIDE: f64 = 1e4;

/// Color model and background model of one camera.
#[derive(Clone, Debug, Default)]
pub struct Teacher {
    /// Color model of skin.
    pub colors: SkinColors,
    /// Number of images that the colors were learned from.
    pub learned: u32,
    pictures: u32,
    /// For each pixel the running fraction of time in which it has the color of skin away from head and hands.
    always: Vec<f32>,
    /// Blocks of pixels in which that fraction was ever above zero.
    visible: Vec<bool>,
    size: [usize; 2],
    away: Vec<u8>,
}

/// A head or hand in an image.
#[derive(Clone, Copy, Debug)]
pub struct VisibleSite {
    /// Column and row.
    pub pixel: [f64; 2],
    /// Depth along the optical axis, meters.
    pub depth: f64,
    /// Whether it is the head.
    pub head: bool,
    /// Whether it was detected there, so that its colors may be learned.
    pub found: bool,
}

/// Learning parameters.
#[derive(Clone, Copy, Debug)]
pub struct Pace {
    /// Focal length, pixels.
    pub focal: f64,
    /// Half-life of the background model, images.
    pub half_life: f64,
    /// Colors are learned from every n-th image...
    pub every: u32,
    /// ... after the first so many images.
    pub settled: u32,
}

impl Teacher {
    /// For each pixel of an image of that size the fraction of time in which it shows background of skin color; `None` if
    /// unknown.
    pub fn always(&self, size: [usize; 2]) -> Option<&[f32]> {
        (!self.always.is_empty() && self.size == size).then_some(&self.always[..])
    }

    /// Learns from the segmented image, or from `image`, another one of the same camera.
    pub fn learn(
        &mut self,
        picture: &Picture,
        image: Option<(&[[u8; 3]], [usize; 2])>,
        sites: &[VisibleSite],
        pace: &Pace,
    ) {
        let size = image.map_or(picture.size, |(_, size)| size);
        self.away.clear();
        self.away.resize(size[0] * size[1], 1);
        let settled = self.learned >= pace.settled;
        let mut discs = Vec::new();
        for site in sites {
            let radius = (if site.head { FACE } else { PALM }) * pace.focal / site.depth;
            let middle = site.pixel.map(f64::round_ties_even);
            if !middle.iter().all(|place| -FAR_OUTSIDE < *place && *place < FAR_OUTSIDE) {
                continue;
            }
            let disc = |rate: f64, least: f64| Disc {
                middle: middle.map(|place| place as i64),
                radius: (rate * radius).round_ties_even().max(least) as i64,
            };
            disc(NOTHING_LEARNED, 2.0).fill(&mut self.away, size, 0);
            if site.found || !settled {
                discs.push(disc(WITHIN, 1.0));
            }
        }
        self.pictures += 1;
        let body = picture.body.as_deref().filter(|body| body.size == size);
        if picture.size == size {
            let before = body.and_then(|body| body.before.as_deref());
            self.learn_always(&picture.colored, before, size, 1.0 - 0.5_f64.powf(1.0 / pace.half_life));
        }
        // The light changes slowly, and learning colors is the most expensive part, so most images are skipped.
        if settled && !self.pictures.is_multiple_of(pace.every.max(1)) {
            return;
        }
        let other = image.map(|(image, _)| bins(image));
        let (bins, outside) = (other.as_deref().unwrap_or(&picture.bins), &self.away[..]);
        let lesson = Lesson { bins, size, inside: &discs, outside, body: body.map(|body| &body.mask[..]) };
        self.learned += u32::from(self.colors.learn(&lesson));
    }

    /// Updates the running mean of "has the color of skin, and no head or hand is near".
    fn learn_always(&mut self, colored: &[u8], before: Option<&[bool]>, size: [usize; 2], rate: f64) {
        if self.size != size || self.always.len() != colored.len() {
            self.always = vec![0.0; colored.len()];
            self.size = size;
            self.visible.clear();
        }
        let (new, old) = (rate as f32, 1.0 - rate as f32);
        self.visible.resize(colored.len().div_ceil(PIXEL_BLOCK), false);
        let blocks = self.always.chunks_mut(PIXEL_BLOCK).zip(colored.chunks(PIXEL_BLOCK)).zip(&mut self.visible);
        for (block, ((always, colored), visible)) in blocks.enumerate() {
            // Blocks that never showed skin color have nothing to decay.
            *visible |= !is_empty(colored);
            if !*visible {
                continue;
            }
            let here = block * PIXEL_BLOCK..block * PIXEL_BLOCK + always.len();
            let mut learns = [0; PIXEL_BLOCK];
            learns[..always.len()].copy_from_slice(&self.away[here.clone()]);
            if let Some(before) = before {
                learns.iter_mut().zip(&before[here]).for_each(|(learns, before)| *learns &= u8::from(!*before));
            }
            for ((always, colored), learns) in always.iter_mut().zip(colored).zip(&learns) {
                let (rate, kept) = if *learns != 0 { (new, old) } else { (0.0, 1.0) };
                *always = *always * kept + f32::from(*colored) * rate;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_shows_skin_for_long_where_no_hand_is_is_the_scene() {
        let picture = Picture { size: [40, 60], bins: vec![0; 2400], colored: vec![1; 2400], ..Picture::default() };
        let hand = VisibleSite { pixel: [30.0, 20.0], depth: 2.0, head: false, found: true };
        let pace = Pace { focal: 100.0, half_life: 10.0, every: 3, settled: 1 };
        let mut teacher = Teacher::default();
        assert!(teacher.always([40, 60]).is_none());
        for count in 1..=12 {
            teacher.learn(&picture, None, &[hand], &pace);
            let Some(always) = teacher.always([40, 60]) else { panic!("nothing learned") };
            assert_eq!((always[20 * 60 + 30], always[0] >= 0.5), (0.0, count >= 10), "{count}");
        }
        assert!(teacher.always([60, 40]).is_none());
        let far = VisibleSite { pixel: [f64::NAN, 1e9], ..hand };
        teacher.learn(&picture, None, &[far], &pace);
        assert_eq!(teacher.learned, 0, "one place is not enough");
    }
}
