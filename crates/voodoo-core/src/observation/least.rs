//! The least of neighbouring pixels.

/// The least of every pixel and its eight neighbours, in an image of so many columns; `row` is working memory.
#[inline(always)]
pub(super) fn least_around(image: &[f32], width: usize, row: &mut [f32], least: &mut [f32]) {
    let lesser = |a: f32, b: f32| if a < b { a } else { b };
    let rows = image.len() / width.max(1);
    for index in 0..rows {
        let line = |other: usize| &image[other.min(rows - 1) * width..][..width];
        let (above, here, below) = (line(index.saturating_sub(1)), line(index), line(index + 1));
        for (((row, above), here), below) in row.iter_mut().zip(above).zip(here).zip(below) {
            *row = lesser(lesser(*above, *below), *here);
        }
        let found = &mut least[index * width..][..width];
        found.copy_from_slice(row);
        for (found, left) in found[1..].iter_mut().zip(&*row) {
            *found = lesser(*found, *left);
        }
        for (found, right) in found.iter_mut().zip(&row[1..]) {
            *found = lesser(*found, *right);
        }
    }
}
