//! Filled circles in masks, rasterized with Bresenham's algorithm like in OpenCV.

use std::ops::Range;

/// A filled circle: column and row of its center, and its radius, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Disc {
    pub middle: [i64; 2],
    pub radius: i64,
}

impl Disc {
    /// Visits the rows and column ranges of the circle within an image of `[height, width]`; some rows are visited several times.
    fn spans(&self, [height, width]: [usize; 2], mut visit: impl FnMut(usize, Range<usize>)) {
        let [u, v] = self.middle;
        let mut line = |row: i64, reach: i64| {
            let (first, end) = ((u - reach).max(0), (u + reach + 1).min(width as i64));
            if (0..height as i64).contains(&row) && first < end {
                visit(row as usize, first as usize..end as usize);
            }
        };
        let (mut error, mut along, mut across) = (0, self.radius, 0);
        let (mut plus, mut minus) = (1, 2 * self.radius - 1);
        while along >= across {
            for (row, reach) in [(v - across, along), (v + across, along), (v - along, across), (v + along, across)] {
                line(row, reach);
            }
            across += 1;
            error += plus;
            plus += 2;
            if error > 0 {
                error -= minus;
                along -= 1;
                minus -= 2;
            }
        }
    }

    /// Sets the pixels of the circle in a mask of `[height, width]`.
    pub(super) fn fill(&self, mask: &mut [u8], size: [usize; 2], value: u8) {
        self.spans(size, |row, columns| mask[row * size[1]..][columns].fill(value));
    }

    /// Ranges of rows and columns that contain the circle within an image of `[height, width]`.
    pub(super) fn window(&self, [height, width]: [usize; 2]) -> [Range<usize>; 2] {
        let within = |middle: i64, size: usize| {
            let inside = |value: i64| value.clamp(0, size as i64) as usize;
            inside(middle - self.radius)..inside(middle + self.radius + 1)
        };
        [within(self.middle[1], height), within(self.middle[0], width)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_circle_is_round_and_cut_off_at_the_border() {
        let size = [9, 9];
        let mut mask = vec![0; 81];
        Disc { middle: [4, 4], radius: 3 }.fill(&mut mask, size, 1);
        let rows: Vec<usize> = mask.chunks(9).map(|row| row.iter().filter(|pixel| **pixel == 1).count()).collect();
        assert_eq!(rows, [0, 1, 5, 5, 7, 5, 5, 1, 0]);
        let corner = Disc { middle: [0, 8], radius: 2 };
        corner.fill(&mut mask, size, 2);
        assert_eq!(mask.iter().filter(|pixel| **pixel == 2).count(), 6);
        assert_eq!(corner.window(size), [6..9, 0..3]);
        let outside = Disc { middle: [-20, 4], radius: 3 };
        outside.fill(&mut mask, size, 3);
        assert!(mask.iter().all(|pixel| *pixel != 3) && outside.window(size)[1].is_empty());
    }
}
