//! What may be the still scene of a depth camera that stands: what has been at its place for some pictures, and behind which
//! nothing was ever seen.

use crate::error::TrackError;
use crate::math::widest;

/// What lies so far behind is another surface: metres, and share of the depth.
const FARTHER: [f32; 2] = [0.05, 0.02];
/// The depth of a still surface changes by less than this: metres, and share of the depth.
const STAYS: [f32; 2] = [0.02, 0.015];

/// Of every pixel of a depth image `now` (metres, 0 = no return) whether it shows what may be the scene, and whether something
/// before what was seen there once: `farthest`, of the pixel and its neighbours, since at the edges of things every camera sees now
/// the one, now the other. `then` is an image some pictures ago.
///
/// # Errors
/// [`TrackError::Measurement`] when the images are not of one size.
pub fn still(now: &[f32], farthest: &[f32], then: &[f32], width: usize) -> Result<(Vec<bool>, Vec<bool>), TrackError> {
    let whole = if width > 0 { now.len().is_multiple_of(width) } else { now.is_empty() };
    if [farthest.len(), then.len()] != [now.len(); 2] || !whole {
        let found = format!("{}, {} and {} pixels in rows of {width}", now.len(), farthest.len(), then.len());
        return Err(TrackError::measurement("depth", "images of one size", found));
    }
    let (mut behind, mut row) = (vec![0.0; now.len()], vec![0.0; width]);
    let (mut stays, mut before) = (vec![false; now.len()], vec![false; now.len()]);
    widest(
        #[inline(always)]
        || {
            least_around(farthest, width, &mut row, &mut behind);
            let images = now.iter().zip(then).zip(&behind);
            for ((stays, before), ((now, then), behind)) in stays.iter_mut().zip(&mut before).zip(images) {
                *before = behind - now >= FARTHER[0] + FARTHER[1] * now;
                *stays = !*before & ((now - then).abs() < STAYS[0] + STAYS[1] * now);
            }
        },
    );
    Ok((stays, before))
}

/// The least of every pixel and its eight neighbours, in an image of so many columns; `row` is working memory.
#[inline(always)]
fn least_around(image: &[f32], width: usize, row: &mut [f32], least: &mut [f32]) {
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

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;

    #[test]
    fn the_scene_is_what_stays_and_has_nothing_behind_it() {
        // A wall at 3 m; before it at 2 m a pole that stands, and a hand that came.
        let farthest = [[3.0, 3.0, 3.0, 2.0, 3.0, 3.0, 3.0, 3.0, 3.0]; 3].concat();
        let now = [[3.0, 3.01, 3.2, 2.0, 3.0, 3.0, 3.0, 2.0, 3.0]; 3].concat();
        let then = [[3.0, 3.0, 3.0, 2.0, 3.0, 3.0, 3.0, 3.0, 3.0]; 3].concat();
        let (stays, before) = still(&now, &farthest, &then, 9).unwrap();
        assert_eq!(stays[9..18], [true, true, false, true, true, true, true, false, true]);
        assert_eq!(before[9..18], [false, false, false, false, false, false, false, true, false]);
        for width in [0, 5] {
            assert!(still(&now, &farthest, &then, width).is_err(), "{width}");
        }
        assert!(still(&now, &farthest[1..], &then, 9).is_err());
        assert!(still(&[], &[], &[], 0).unwrap().0.is_empty());
    }
}
