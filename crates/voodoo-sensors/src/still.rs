//! Finds the pixels of a static depth camera that may be the still scene: their depth has not changed over some images, and no
//! surface behind them was ever observed.

use std::ops::Range;

use voodoo_core::TrackError;
use voodoo_core::math::widest;

/// Least distance behind a surface at which another surface begins: meters, and a fraction of the depth.
const FARTHER: [f32; 2] = [0.05, 0.02];
/// Greatest change of depth of a still surface: meters, and a fraction of the depth.
const STAYS: [f32; 2] = [0.02, 0.015];

/// For each pixel of a depth image `now` (meters, 0 = no return): whether it may be the scene, and whether a surface lies in
/// front of one observed earlier. `farthest` is the farthest depth observed so far; the neighbors of a pixel are included, since
/// at edges a camera measures one or the other surface. `then` is an image some frames ago. Only pixels within the given rows and
/// columns are evaluated.
///
/// # Errors
/// [`TrackError::Measurement`] when the images differ in size, or do not have these rows and columns.
pub(crate) fn still(
    now: &[f32],
    farthest: &[f32],
    then: &[f32],
    width: usize,
    [rows, columns]: [Range<usize>; 2],
) -> Result<(Vec<bool>, Vec<bool>), TrackError> {
    let whole = if width > 0 { now.len().is_multiple_of(width) } else { now.is_empty() };
    let within = columns.end <= width && rows.end <= now.len() / width.max(1);
    if [farthest.len(), then.len()] != [now.len(); 2] || !whole || !within {
        let found = format!(
            "{}, {} and {} pixels in rows of {width}, of which rows {rows:?} and columns {columns:?}",
            now.len(),
            farthest.len(),
            then.len()
        );
        return Err(TrackError::measurement("depth", "images of one size", found));
    }
    let (mut stays, mut before) = (vec![false; now.len()], vec![false; now.len()]);
    // Columns including a neighbor on either side, where there is one.
    let around = columns.start.saturating_sub(1)..(columns.end + 1).min(width);
    let (mut behind, mut line) = (vec![0.0; around.len()], vec![0.0; around.len()]);
    widest(
        #[inline(always)]
        || {
            for row in rows {
                least_around(farthest, width, (row, &around), &mut line, &mut behind);
                let here = row * width + columns.start..row * width + columns.end;
                let images = now[here.clone()].iter().zip(&then[here.clone()]);
                let images = images.zip(&behind[columns.start - around.start..]);
                let marks = stays[here.clone()].iter_mut().zip(&mut before[here]);
                for ((stays, before), ((now, then), behind)) in marks.zip(images) {
                    *before = behind - now >= FARTHER[0] + FARTHER[1] * now;
                    *stays = !*before & ((now - then).abs() < STAYS[0] + STAYS[1] * now);
                }
            }
        },
    );
    Ok((stays, before))
}

/// Minimum of every pixel and its eight neighbors in some columns of a row of an image; neighbors outside these columns do not
/// count. `line` is working memory.
#[inline(always)]
fn least_around(
    image: &[f32],
    width: usize,
    (row, columns): (usize, &Range<usize>),
    line: &mut [f32],
    least: &mut [f32],
) {
    let lesser = |a: f32, b: f32| if a < b { a } else { b };
    let last = image.len() / width.max(1) - 1;
    let rows = |other: usize| &image[other.min(last) * width..][columns.clone()];
    let (above, here, below) = (rows(row.saturating_sub(1)), rows(row), rows(row + 1));
    for (((line, above), here), below) in line.iter_mut().zip(above).zip(here).zip(below) {
        *line = lesser(lesser(*above, *below), *here);
    }
    least.copy_from_slice(line);
    for (least, left) in least[1..].iter_mut().zip(&*line) {
        *least = lesser(*least, *left);
    }
    for (least, right) in least.iter_mut().zip(&line[1..]) {
        *least = lesser(*least, *right);
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;

    #[test]
    fn the_scene_is_what_stays_and_has_nothing_behind_it() {
        // A wall at 3 m; in front of it at 2 m a static pole, and a hand that has appeared.
        let farthest = [[3.0, 3.0, 3.0, 2.0, 3.0, 3.0, 3.0, 3.0, 3.0]; 3].concat();
        let now = [[3.0, 3.01, 3.2, 2.0, 3.0, 3.0, 3.0, 2.0, 3.0]; 3].concat();
        let then = [[3.0, 3.0, 3.0, 2.0, 3.0, 3.0, 3.0, 3.0, 3.0]; 3].concat();
        let (stays, before) = still(&now, &farthest, &then, 9, [0..3, 0..9]).unwrap();
        assert_eq!(stays[9..18], [true, true, false, true, true, true, true, false, true]);
        assert_eq!(before[9..18], [false, false, false, false, false, false, false, true, false]);
        for width in [0, 5] {
            assert!(still(&now, &farthest, &then, width, [0..0, 0..0]).is_err(), "{width}");
        }
        assert!(still(&now, &farthest[1..], &then, 9, [0..3, 0..9]).is_err());
        assert!(still(&now, &farthest, &then, 9, [0..4, 0..9]).is_err());
        assert!(still(&[], &[], &[], 0, [0..0, 0..0]).unwrap().0.is_empty());
        for window in [[1..3, 2..7], [0..1, 0..9], [1..2, 7..8], [2..2, 3..3], [0..3, 4..4]] {
            let (stays_there, ahead) = still(&now, &farthest, &then, 9, window.clone()).unwrap();
            let [rows, columns] = window;
            let inside = |index: &usize| rows.contains(&(index / 9)) && columns.contains(&(index % 9));
            for index in (0..27).filter(inside) {
                assert_eq!(
                    (stays_there[index], ahead[index]),
                    (stays[index], before[index]),
                    "{rows:?} {columns:?} {index}"
                );
            }
            assert!((0..27).all(|index| inside(&index) || !(stays_there[index] || ahead[index])));
        }
    }
}
