//! Quantizes the colors of an image to histogram bins of chroma and coarse luma, from which skin is classified.

use crate::masks::PIXEL_BLOCK;
use voodoo_core::TrackError;
use voodoo_core::math::widest;

/// Bins of either axis of chroma, Cr and Cb. Coarse luma is added to distinguish a face from a dark poster of the same hue.
pub const CHROMA_BINS: usize = 64;
/// Bins of luma.
pub const LUMA_BINS: usize = 8;
/// Bins of a histogram, Cr by Cb by luma.
pub const BINS: usize = CHROMA_BINS * CHROMA_BINS * LUMA_BINS;
/// Pixels with less luma have no reliable chroma.
const DARKEST: i32 = 30;
/// Flag of such a pixel, stored beside its bin.
const DARK: u16 = 1 << 15;

/// The bin of every pixel (blue, green, red) and a flag for dark ones. Luma and chroma follow ITU-R BT.601, rounded to eight-bit
/// integers.
pub fn bins(image: &[[u8; 3]]) -> Vec<u16> {
    let mut found = Vec::new();
    find_bins(image, &mut found);
    found
}

/// Writes the bins, as [`bins`] does, into `found`.
pub fn find_bins(image: &[[u8; 3]], found: &mut Vec<u16>) {
    found.resize(image.len(), 0);
    widest(
        #[inline(always)]
        || {
            for (bin, [b, g, r]) in found.iter_mut().zip(image) {
                *bin = bin_of([*b, *g, *r].map(i32::from));
            }
        },
    );
}

#[inline(always)]
fn bin_of([b, g, r]: [i32; 3]) -> u16 {
    // Coefficients in units of 2^-14.
    let rounded = |sum: i32| (sum + (1 << 13)) >> 14;
    // The input has eight bits; a compiler that knows this uses a faster product of two short integers.
    let luma = rounded(1868 * b + 9617 * g + 4899 * r) & 255;
    let chroma = |difference: i32, weight: i32| rounded(difference * weight + (128 << 14)).clamp(0, 255);
    let (cr, cb) = (chroma(r - luma, 11682), chroma(b - luma, 9241));
    let bin = ((cr >> 2) << 9 | (cb >> 2) << 3 | luma >> 5) as u16;
    if luma < DARKEST { bin | DARK } else { bin }
}

/// Whether a pixel is light enough to have a color and its bin is in the `table`.
#[inline(always)]
pub fn is_among(bin: u16, table: &[bool; BINS]) -> bool {
    table[usize::from(bin & !DARK)] & (bin & DARK == 0)
}

/// Writes 1 into `found` where a pixel is light enough and its bin is in the `table`, which has [`BINS`] entries.
///
/// # Errors
/// [`TrackError::Measurement`] when the table has another size.
pub fn find_among(bins: &[u16], table: &[bool], found: &mut Vec<u8>) -> Result<(), TrackError> {
    let count = table.len();
    let Ok(table): Result<&[bool; BINS], _> = table.try_into() else {
        return Err(TrackError::measurement("table", "a mark for each of 32768 bins", count.to_string()));
    };
    let within = Chroma::new(table);
    found.clear();
    found.resize(bins.len(), 0);
    widest(
        #[inline(always)]
        || {
            for (bins, found) in bins.chunks(PIXEL_BLOCK).zip(found.chunks_mut(PIXEL_BLOCK)) {
                if within.any(bins) {
                    found.iter_mut().zip(bins).for_each(|(found, bin)| *found = u8::from(is_among(*bin, table)));
                }
            }
        },
    );
    Ok(())
}

/// Least and greatest Cr and Cb of the bins in a table.
struct Chroma {
    cr: [u16; 2],
    cb: [u16; 2],
}

impl Chroma {
    fn new(table: &[bool; BINS]) -> Self {
        let mut found = Self { cr: [u16::MAX, 0], cb: [u16::MAX, 0] };
        for (column, luma) in table.as_chunks::<LUMA_BINS>().0.iter().enumerate() {
            if luma.iter().fold(false, |any, marked| any | marked) {
                let (cr, cb) = ((column / CHROMA_BINS) as u16, (column % CHROMA_BINS) as u16);
                found.cr = [found.cr[0].min(cr), found.cr[1].max(cr)];
                found.cb = [found.cb[0].min(cb), found.cb[1].max(cb)];
            }
        }
        found
    }

    /// Whether any of these bins lies within the bounds.
    #[inline(always)]
    fn any(&self, bins: &[u16]) -> bool {
        let width = |[low, high]: [u16; 2]| high.wrapping_sub(low);
        let (cr_width, cb_width) = (width(self.cr), width(self.cb));
        let inside = |bin: &u16| {
            let (cr, cb) = (bin >> 9, bin >> 3 & 63);
            // The unsigned difference wraps to a large value below the lower bound.
            (cr.wrapping_sub(self.cr[0]) <= cr_width) & (cb.wrapping_sub(self.cb[0]) <= cb_width)
        };
        self.cr[0] <= self.cr[1] && bins.iter().fold(false, |any, bin| any | inside(bin))
    }
}

/// Counts the pixels of two classes by bin; its memory is reused.
#[derive(Clone, Debug, Default)]
pub struct Counter {
    /// Counts of the two classes. Two tables of each are used in turn, since neighboring pixels often share a bin and one count
    /// would wait for the last.
    tables: [Vec<[u32; 2]>; 2],
}

impl Counter {
    /// Counts the pixels that are marked; each has a bin, a mark and a class.
    pub fn count(&mut self, pixels: impl Iterator<Item = (u16, bool, bool)>) {
        let [even, odd] = &mut self.tables;
        even.resize(BINS, [0; 2]);
        odd.resize(BINS, [0; 2]);
        for (index, (bin, mark, other)) in pixels.enumerate() {
            let table = if index % 2 == 0 { &mut *even } else { &mut *odd };
            table[usize::from(bin & !DARK)][usize::from(other)] += u32::from(mark);
        }
    }

    /// Returns the counts of both classes for each bin and resets them.
    pub fn take(&mut self, mut visit: impl FnMut(usize, [u32; 2])) {
        let [even, odd] = &mut self.tables;
        for (bin, (even, odd)) in even.iter_mut().zip(odd).enumerate() {
            visit(bin, [0, 1].map(|kind| std::mem::take(&mut even[kind]) + std::mem::take(&mut odd[kind])));
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;

    #[test]
    fn bins_are_those_of_opencv() {
        // Pixels (blue, green, red) and the result of cvtColor(COLOR_BGR2YCrCb) of OpenCV 5.0: luma, Cr, Cb.
        let known = [
            ([17, 9, 28], [16, 137, 129]),
            ([30, 21, 8], [18, 121, 135]),
            ([255, 255, 255], [255, 128, 128]),
            ([0, 0, 0], [0, 128, 128]),
            ([255, 0, 0], [29, 107, 255]),
            ([0, 255, 0], [150, 21, 43]),
            ([0, 0, 255], [76, 255, 85]),
            ([66, 39, 106], [62, 159, 130]),
            ([213, 171, 45], [138, 62, 170]),
            ([167, 57, 69], [73, 125, 181]),
            ([153, 178, 215], [186, 149, 109]),
        ];
        for (color, [luma, cr, cb]) in known {
            let dark = if luma < 30 { DARK } else { 0 };
            assert_eq!(bins(&[color]), [(cr >> 2) * 512 + (cb >> 2) * 8 + (luma >> 5) + dark], "{color:?}");
        }
    }

    /// Luma and chroma by the definition, in double precision.
    fn defined([b, g, r]: [u8; 3]) -> [f64; 3] {
        let [b, g, r] = [b, g, r].map(f64::from);
        let luma = 0.299 * r + 0.587 * g + 0.114 * b;
        [(r - luma) * 0.713 + 128.0, (b - luma) * 0.564 + 128.0, luma]
    }

    #[test]
    fn a_bin_is_that_of_the_color_by_its_definition() {
        let mut dark = 0;
        for n in 0..50_000_u32 {
            let color = [n.wrapping_mul(2_654_435_761) >> 24, n * 7 % 256, n * 131 % 256].map(|value| value as u8);
            let [bin] = bins(&[color])[..] else { panic!("one pixel, one bin") };
            let (place, [cr, cb, luma]) = (usize::from(bin & !DARK), defined(color));
            for (found, expected, width) in [(place >> 9, cr, 4.0), (place >> 3 & 63, cb, 4.0), (place & 7, luma, 32.0)]
            {
                let middle = (found as f64 + 0.5) * width - 0.5;
                assert!((expected.clamp(0.0, 255.0) - middle).abs() < 0.5 * width + 1.1, "{color:?}: {found}");
            }
            assert!((bin & DARK != 0) == (luma < 29.5) || (luma - 29.5).abs() < 0.6);
            dark += usize::from(bin & DARK != 0);
        }
        assert!(dark > 100);
    }

    #[test]
    fn colors_are_found_and_counted_but_dark_ones_only_counted() {
        let picture = [[10, 10, 200], [0, 0, 20], [200, 10, 10], [10, 10, 200]];
        let found = bins(&picture);
        let mut table = vec![false; BINS];
        for bin in &found[..2] {
            table[usize::from(bin & !DARK)] = true;
        }
        let mut marks = Vec::new();
        find_among(&found, &table, &mut marks).unwrap();
        assert_eq!(marks, [1, 0, 0, 1]);
        let mut counter = Counter::default();
        let marked = found.iter().copied().zip([true, true, true, false]);
        counter.count(marked.map(|(bin, mark)| (bin, mark, bin & DARK != 0)));
        let mut counts = vec![[0; 2]; BINS];
        counter.take(|bin, found| counts[bin] = found);
        assert_eq!((counts[usize::from(found[0])], counts[usize::from(found[1] & !DARK)]), ([1, 0], [0, 1]));
        assert_eq!(counts.iter().flatten().sum::<u32>(), 3);
        counter.take(|_, found| assert_eq!(found, [0; 2]));
        find_among(&found, &[false; BINS], &mut marks).unwrap();
        assert_eq!(marks, [0; 4]);
        assert!(find_among(&found, &table[1..], &mut marks).is_err());
    }
}
