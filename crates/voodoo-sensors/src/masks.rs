//! Binary image morphology: masks, row by row with 1 for set pixels, are dilated, opened, closed and smoothed.

use voodoo_core::math::widest;

/// Dilates a mask of so many columns by a square of `reach` rows and columns to each side.
pub(crate) fn grown(mask: &[u8], width: usize, reach: usize) -> Vec<u8> {
    around(mask, width, reach, |a, b| a | b)
}

/// Opens a mask: removes what is narrower than three pixels.
pub(crate) fn opened(mask: &[u8], width: usize) -> Vec<u8> {
    around(&around(mask, width, 1, |a, b| a & b), width, 1, |a, b| a | b)
}

/// Closes a mask: fills gaps of up to two pixels.
pub(crate) fn closed(mask: &[u8], width: usize) -> Vec<u8> {
    around(&around(mask, width, 1, |a, b| a | b), width, 1, |a, b| a & b)
}

/// Combines every pixel with all those within `reach` rows and columns; pixels outside the image do not count.
fn around(mask: &[u8], width: usize, reach: usize, join: impl Fn(u8, u8) -> u8) -> Vec<u8> {
    by_rows(
        mask,
        width,
        #[inline(always)]
        |index, row, found| {
            row.copy_from_slice(&mask[index * width..][..width]);
            let last = (index + reach).min(mask.len() / width - 1);
            for other in (index.saturating_sub(reach)..index).chain(index + 1..=last) {
                row.iter_mut().zip(&mask[other * width..][..width]).for_each(|(a, b)| *a = join(*a, *b));
            }
            found.copy_from_slice(row);
            for apart in 1..=reach.min(width - 1) {
                found[apart..].iter_mut().zip(&*row).for_each(|(a, b)| *a = join(*a, *b));
                found.iter_mut().zip(&row[apart..]).for_each(|(a, b)| *a = join(*a, *b));
            }
        },
    )
}

/// Writes the majority of each pixel and its eight neighbors into `found`; the border is replicated.
pub(crate) fn smooth(mask: &[u8], width: usize, found: &mut Vec<u8>) {
    found.resize(mask.len(), 0);
    fill_rows(
        found,
        width,
        #[inline(always)]
        |index, row, found| {
            let line = |other: usize| &mask[other.min(mask.len() / width - 1) * width..][..width];
            let rows = line(index.saturating_sub(1)).iter().zip(line(index)).zip(line(index + 1));
            row.iter_mut().zip(rows).for_each(|(sum, ((a, b), c))| *sum = a + b + c);
            if let (Some(inner), Some(second), Some(third)) = (found.get_mut(1..), row.get(1..), row.get(2..)) {
                for (((found, a), b), c) in inner.iter_mut().zip(&*row).zip(second).zip(third) {
                    *found = u8::from(a + b + c > 4);
                }
            }
            let end = width - 1;
            found[0] = u8::from(2 * row[0] + row[end.min(1)] > 4);
            found[end] = u8::from(2 * row[end] + row[end.saturating_sub(1)] > 4);
        },
    )
}

/// Builds a mask row by row: `make` gets the index of a row, working memory for one row, and the row to fill.
fn by_rows(mask: &[u8], width: usize, make: impl FnMut(usize, &mut [u8], &mut [u8])) -> Vec<u8> {
    let mut found = vec![0; mask.len()];
    fill_rows(&mut found, width, make);
    found
}

fn fill_rows(found: &mut [u8], width: usize, mut make: impl FnMut(usize, &mut [u8], &mut [u8])) {
    let mut row = vec![0; width];
    widest(
        #[inline(always)]
        || {
            for (index, found) in found.chunks_exact_mut(width.max(1)).enumerate() {
                make(index, &mut row, found);
            }
        },
    );
}

/// Number of pixels that are skipped together if none of them is set: two registers of AVX2.
pub(crate) const PIXEL_BLOCK: usize = 64;

/// A part of a mask with this many columns.
pub(crate) fn cut(
    mask: &[u8],
    width: usize,
    rows: &std::ops::Range<usize>,
    columns: &std::ops::Range<usize>,
) -> Vec<u8> {
    let mut part = Vec::with_capacity(rows.len() * columns.len());
    for row in rows.clone() {
        part.extend_from_slice(&mask[row * width..][columns.clone()]);
    }
    part
}

/// Whether a row of a mask is empty. Reading all of it at once is faster than searching for the first set pixel.
pub(crate) fn is_empty(row: &[u8]) -> bool {
    row.iter().fold(0, |any, pixel| any | pixel) == 0
}

/// Smallest range of rows and of columns that contains all set pixels of a mask.
pub(crate) fn bounds(mask: &[u8], width: usize) -> [std::ops::Range<usize>; 2] {
    let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
    for (index, row) in mask.chunks_exact(width.max(1)).enumerate().filter(|(_, row)| !is_empty(row)) {
        if let Some(first) = row.iter().position(|pixel| *pixel != 0) {
            let last = row.iter().rposition(|pixel| *pixel != 0).unwrap_or(first);
            low = [low[0].min(index), low[1].min(first)];
            high = [index + 1, high[1].max(last + 1)];
        }
    }
    [0, 1].map(|axis| low[axis].min(high[axis])..high[axis])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn smoothed(mask: &[u8], width: usize) -> Vec<u8> {
        let mut found = Vec::new();
        smooth(mask, width, &mut found);
        found
    }

    #[test]
    fn a_mask_grows_shrinks_and_is_smoothed() {
        let mask = [[0, 0, 0, 0, 0], [0, 1, 0, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 0, 1]].concat();
        let wide = [[1, 1, 1, 0, 0], [1, 1, 1, 0, 0], [1, 1, 1, 1, 1], [0, 0, 0, 1, 1]].concat();
        assert_eq!(grown(&mask, 5, 1), wide);
        assert_eq!(grown(&mask, 5, 9), [1; 20]);
        assert_eq!(opened(&wide, 5)[..10], [1, 1, 1, 0, 0, 1, 1, 1, 0, 0]);
        let gap = [[1, 1, 0, 1, 1]; 3].concat();
        assert_eq!((closed(&gap, 5), opened(&gap, 5)), (vec![1; 15], gap.clone()));
        assert_eq!(smoothed(&mask, 5), [0; 20]);
        assert_eq!(smoothed(&gap, 5), [1; 15]);
        assert_eq!(bounds(&mask, 5), [1..4, 1..5]);
        assert_eq!(bounds(&[0; 20], 5), [0..0, 0..0]);
        assert!(grown(&[], 0, 1).is_empty() && smoothed(&[], 0).is_empty() && smoothed(&[1], 1) == [1]);
    }
}
