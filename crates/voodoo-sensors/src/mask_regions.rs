//! Connected components of masks, and the segmentation of skin.

use crate::chroma;
use crate::masks::{PIXEL_BLOCK, bounds, closed, cut, is_empty, opened, smooth};
use voodoo_core::TrackError;

/// A connected component of a mask (8-connectivity).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MaskRegion {
    /// First row, and one past the last row.
    pub rows: (usize, usize),
    /// First column, and one past the last column.
    pub columns: (usize, usize),
    /// Number of pixels.
    pub area: usize,
    /// Sum of the pixels' columns, and of their rows.
    pub sums: [usize; 2],
}

impl MaskRegion {
    fn new(run: &Run) -> Self {
        let count = run.end - run.start;
        let columns = (run.start + run.end - 1) * count / 2;
        let sums = [columns, run.row * count];
        Self { rows: (run.row, run.row + 1), columns: (run.start, run.end), area: count, sums }
    }

    fn join(&mut self, other: &Self) {
        let both = |a: (usize, usize), b: (usize, usize)| (a.0.min(b.0), a.1.max(b.1));
        (self.rows, self.columns) = (both(self.rows, other.rows), both(self.columns, other.columns));
        self.area += other.area;
        self.sums = [0, 1].map(|axis| self.sums[axis] + other.sums[axis]);
    }
}

#[derive(Clone, Copy, Debug)]
struct Run {
    row: usize,
    start: usize,
    end: usize,
    /// Index of another run of the same component, smaller than this run's, or its own.
    parent: usize,
}

/// Returns the components of a mask of so many columns, and the label of each pixel, from 1. Labels are ordered by the first
/// block of two by two pixels that contains a pixel of the component.
pub(crate) fn regions(mask: &[u8], width: usize) -> (Vec<MaskRegion>, Vec<i32>) {
    let mut runs = joined_runs(mask, width);
    for index in 0..runs.len() {
        runs[index].parent = first(&runs, index);
    }
    let mut found: Vec<((usize, usize), usize, MaskRegion)> = Vec::new();
    let mut place = vec![0; runs.len()];
    for (index, run) in runs.iter().enumerate() {
        let block = (run.row / 2, run.start / 2);
        if run.parent == index {
            place[index] = found.len();
            found.push((block, index, MaskRegion::new(run)));
        } else {
            let known = &mut found[place[run.parent]];
            known.0 = known.0.min(block);
            known.2.join(&MaskRegion::new(run));
        }
    }
    found.sort_unstable_by_key(|(block, _, _)| *block);
    let mut labels = vec![0; mask.len()];
    for ((_, index, _), number) in found.iter().zip(1..) {
        place[*index] = number;
    }
    for run in &runs {
        labels[run.row * width + run.start..run.row * width + run.end].fill(place[run.parent] as i32);
    }
    (found.into_iter().map(|(_, _, region)| region).collect(), labels)
}

/// Runs of set pixels in rows, each linked to an earlier one that it touches.
fn joined_runs(mask: &[u8], width: usize) -> Vec<Run> {
    let mut runs: Vec<Run> = Vec::new();
    let mut above = 0..0;
    for (row, pixels) in mask.chunks_exact(width.max(1)).enumerate() {
        let begin = runs.len();
        let mut start = if is_empty(pixels) { pixels.len() } else { 0 };
        while let Some(next) = pixels[start..].iter().position(|pixel| *pixel != 0) {
            start += next;
            let end = pixels[start..].iter().position(|pixel| *pixel == 0).map_or(width, |length| start + length);
            runs.push(Run { row, start, end, parent: runs.len() });
            start = end;
        }
        let mut other = above.start;
        for index in begin..runs.len() {
            while other < above.end && runs[other].end < runs[index].start {
                other += 1;
            }
            let mut touching = other;
            while touching < above.end && runs[touching].start <= runs[index].end {
                let (a, b) = (first(&runs, index), first(&runs, touching));
                runs[a.max(b)].parent = a.min(b);
                touching += 1;
            }
        }
        above = begin..runs.len();
    }
    runs
}

fn first(runs: &[Run], mut index: usize) -> usize {
    while runs[index].parent != index {
        index = runs[index].parent;
    }
    index
}

/// Closes gaps of two pixels between the regions of a mask whose bounding-box diagonals are no longer than `longest`.
pub(crate) fn joined(mask: &[u8], width: usize, longest: f64) -> Vec<u8> {
    let mut result = mask.to_vec();
    let [rows, columns] = bounds(mask, width);
    let part = cut(mask, width, &rows, &columns);
    let (regions, mut labels) = regions(&part, columns.len());
    let length = |(low, high): (usize, usize)| (high - low) as f64;
    let small: Vec<bool> =
        regions.iter().map(|region| length(region.columns).hypot(length(region.rows)) <= longest).collect();
    for label in &mut labels {
        *label = i32::from(*label > 0 && small[(*label - 1) as usize]);
    }
    let small: Vec<u8> = labels.iter().map(|label| *label as u8).collect();
    for (row, closed) in rows.zip(closed(&small, columns.len()).chunks_exact(columns.len().max(1))) {
        result[row * width..][columns.clone()].iter_mut().zip(closed).for_each(|(pixel, closed)| *pixel |= closed);
    }
    result
}

/// The input of the skin segmentation: an image, and where skin may be.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SkinPicture<'a> {
    /// Bin of each pixel's color, see [`chroma::bins`].
    pub bins: &'a [u16],
    /// Number of columns.
    pub width: usize,
    /// Which bins count as skin.
    pub table: &'a [bool],
    /// Where the body may be.
    pub body: Option<&'a [bool]>,
    /// For each pixel the fraction of time in which it shows background of skin color; pixels with one half or more are
    /// background.
    pub always: Option<&'a [f32]>,
    /// Where a surface lies in front of the scene.
    pub before: Option<&'a [bool]>,
}

impl SkinPicture<'_> {
    /// Writes the pixels of skin color, without isolated ones, into `colored`. Writes those that may belong to the body into
    /// `skin`: regions at least three pixels wide, with gaps closed between regions no longer than `longest`.
    ///
    /// # Errors
    /// [`TrackError::Measurement`] when array sizes do not match.
    pub(crate) fn find(&self, longest: f64, colored: &mut Vec<u8>, skin: &mut Vec<u8>) -> Result<(), TrackError> {
        let count = self.bins.len();
        let whole = if self.width > 0 { count.is_multiple_of(self.width) } else { count == 0 };
        let masks = [self.body, self.before].into_iter().flatten().map(<[_]>::len);
        if !whole || masks.chain(self.always.map(<[_]>::len)).any(|length| length != count) {
            let found = format!("{count} pixels in rows of {} and masks of another size", self.width);
            return Err(TrackError::measurement("skin", "a picture and masks of its size", found));
        }
        chroma::find_among(self.bins, self.table, skin)?;
        smooth(skin, self.width, colored);
        skin.copy_from_slice(colored);
        self.rule_out(skin);
        let [rows, columns] = bounds(skin, self.width);
        // The crop is extended by one pixel within the image, and its outer pixels are not set.
        let around = |span: std::ops::Range<usize>, size: usize| span.start.saturating_sub(1)..(span.end + 1).min(size);
        let (rows, columns) = (around(rows, count / self.width.max(1)), around(columns, self.width));
        let part = cut(skin, self.width, &rows, &columns);
        let found = joined(&opened(&part, columns.len()), columns.len(), longest);
        for (row, found) in rows.zip(found.chunks_exact(columns.len().max(1))) {
            let here = row * self.width + columns.start..row * self.width + columns.end;
            skin[here.clone()].copy_from_slice(found);
            if let Some(body) = self.body {
                skin[here.clone()].iter_mut().zip(&body[here]).for_each(|(pixel, body)| *pixel &= u8::from(*body));
            }
        }
        Ok(())
    }

    /// Removes pixels that cannot belong to the body.
    fn rule_out(&self, skin: &mut [u8]) {
        for (block, pixels) in skin.chunks_mut(PIXEL_BLOCK).enumerate().filter(|(_, pixels)| !is_empty(pixels)) {
            let here = block * PIXEL_BLOCK..block * PIXEL_BLOCK + pixels.len();
            if let Some(body) = self.body {
                pixels.iter_mut().zip(&body[here.clone()]).for_each(|(pixel, body)| *pixel &= u8::from(*body));
            }
            let Some(always) = self.always.map(|always| &always[here.clone()]) else { continue };
            match self.before.map(|before| &before[here]) {
                Some(before) => {
                    for ((pixel, always), before) in pixels.iter_mut().zip(always).zip(before) {
                        *pixel &= u8::from((*always < 0.5) | *before);
                    }
                }
                None => pixels.iter_mut().zip(always).for_each(|(pixel, always)| *pixel &= u8::from(*always < 0.5)),
            }
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test stops at the first surprise")]
mod tests {
    use super::*;

    #[test]
    fn regions_touch_at_corners_and_are_numbered_from_the_top() {
        let mask = [[0, 0, 0, 0, 0, 1], [1, 0, 0, 1, 0, 0], [0, 1, 0, 0, 0, 0], [1, 0, 0, 0, 1, 1]].concat();
        let (found, labels) = regions(&mask, 6);
        assert_eq!(labels, [[0, 0, 0, 0, 0, 3], [1, 0, 0, 2, 0, 0], [0, 1, 0, 0, 0, 0], [1, 0, 0, 0, 4, 4]].concat());
        assert_eq!(found[0], MaskRegion { rows: (1, 4), columns: (0, 2), area: 3, sums: [1, 6] });
        assert_eq!(found[3], MaskRegion { rows: (3, 4), columns: (4, 6), area: 2, sums: [9, 6] });
        assert!(regions(&[], 0).0.is_empty() && regions(&[0; 6], 3).0.is_empty());
    }

    /// Labels of all pixels by flood fill, one region after the other.
    fn flooded(mask: &[u8], width: usize) -> Vec<i32> {
        let mut labels = vec![0; mask.len()];
        let mut count = 0;
        for start in 0..mask.len() {
            if mask[start] == 0 || labels[start] != 0 {
                continue;
            }
            count += 1;
            let mut open = vec![start];
            while let Some(index) = open.pop() {
                if mask[index] == 0 || labels[index] != 0 {
                    continue;
                }
                labels[index] = count;
                let (row, column) = (index / width, index % width);
                for row in row.saturating_sub(1)..(row + 2).min(mask.len() / width) {
                    open.extend((column.saturating_sub(1)..(column + 2).min(width)).map(|column| row * width + column));
                }
            }
        }
        labels
    }

    #[test]
    fn regions_are_those_that_filling_finds() {
        let mut state = 3_u32;
        for _ in 0..60 {
            let mut next = || {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                state >> 16
            };
            let (height, width) = (1 + next() as usize % 30, 1 + next() as usize % 40);
            let fraction = 20 + next() % 40;
            let mask: Vec<u8> = (0..height * width).map(|_| u8::from(next() % 100 < fraction)).collect();
            let (found, labels) = regions(&mask, width);
            let flooded = flooded(&mask, width);
            let mut pairs: Vec<(i32, i32)> = labels.iter().copied().zip(flooded).collect();
            pairs.sort_unstable();
            pairs.dedup();
            assert!(pairs.iter().filter(|(own, _)| *own > 0).count() == found.len(), "one to one");
            assert!(pairs.iter().all(|(own, other)| (*own == 0) == (*other == 0)));
            for (region, number) in found.iter().zip(1..) {
                let pixels = || (0..mask.len()).filter(|index| labels[*index] == number);
                let span = |of: fn(usize, usize) -> usize| {
                    let places = || pixels().map(|index| of(index, width));
                    (places().min().unwrap(), places().max().unwrap() + 1, places().sum::<usize>())
                };
                let (rows, columns) = (span(|index, width| index / width), span(|index, width| index % width));
                let expected = MaskRegion {
                    rows: (rows.0, rows.1),
                    columns: (columns.0, columns.1),
                    area: pixels().count(),
                    sums: [columns.2, rows.2],
                };
                assert_eq!(*region, expected);
            }
        }
    }

    #[test]
    fn what_a_shadow_parts_is_one_hand_and_arms_stay_apart() {
        let (width, palm) = (240, 5.4);
        let mut mask = vec![0; width * 160];
        let mut fill = |rows: std::ops::Range<usize>, columns: std::ops::Range<usize>| {
            rows.for_each(|row| mask[row * width..][columns.clone()].fill(1));
        };
        // Palm and fingers, and two forearms.
        fill(100..108, 100..108);
        fill(110..118, 100..108);
        fill(100..150, 200..208);
        fill(100..150, 210..218);
        let (_, labels) = regions(&joined(&mask, width, 3.0 * palm), width);
        let at = |row: usize, column: usize| labels[row * width + column];
        assert!(at(104, 104) == at(114, 104) && at(104, 104) != 0 && at(120, 204) != at(120, 214));
    }

    #[test]
    fn only_short_regions_are_joined_and_sizes_are_checked() {
        let mask = [[1, 0, 1, 1, 0, 0, 0], [1, 0, 1, 1, 0, 0, 0]].concat();
        assert_eq!(joined(&mask, 7, 3.0)[..7], [1, 1, 1, 1, 0, 0, 0]);
        assert_eq!(joined(&mask, 7, 1.0), mask);
        let (bins, table) = (vec![0; 12], vec![true; chroma::BINS]);
        let picture = SkinPicture { bins: &bins, width: 4, table: &table, body: None, always: None, before: None };
        let find = |picture: SkinPicture| {
            let (mut colored, mut skin) = (Vec::new(), Vec::new());
            picture.find(3.0, &mut colored, &mut skin).map(|()| (colored, skin))
        };
        assert_eq!(find(picture).unwrap(), (vec![1; 12], vec![1; 12]));
        let body = [true, true, true, false].repeat(3);
        assert_eq!(find(SkinPicture { body: Some(&body), ..picture }).unwrap().1[..4], [1, 1, 1, 0]);
        let always = [0.6; 12];
        assert_eq!(find(SkinPicture { always: Some(&always), ..picture }).unwrap().1, [0; 12]);
        let before = SkinPicture { always: Some(&always), before: Some(&body), ..picture };
        assert_eq!(find(before).unwrap().1[..4], [1, 1, 1, 0]);
        assert!(find(SkinPicture { width: 5, ..picture }).is_err());
        assert!(find(SkinPicture { body: Some(&body[1..]), ..picture }).is_err());
        assert!(find(SkinPicture { table: &table[1..], ..picture }).is_err());
    }
    /// Numbers in [0, 1) that look random and are the same in every run (Knuth's linear congruence).
    fn numbers(mut state: u64) -> impl FnMut() -> f64 {
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1_u64 << 53) as f64
        }
    }

    /// Pixels of a mask around a pixel, including itself, within the image.
    fn around(index: usize, [height, width]: [usize; 2]) -> impl Iterator<Item = usize> {
        let (row, column) = (index / width, index % width);
        let span = |place: usize, size: usize| place.saturating_sub(1)..(place + 2).min(size);
        span(row, height).flat_map(move |row| span(column, width).map(move |column| row * width + column))
    }

    /// Whether all, or any, of the pixels around each one are set.
    fn morphed(mask: &[u8], size: [usize; 2], all: bool) -> Vec<u8> {
        let pixel = |index: usize| around(index, size).filter(|other| mask[*other] != 0).count();
        (0..mask.len())
            .map(|index| u8::from(if all { pixel(index) == around(index, size).count() } else { pixel(index) > 0 }))
            .collect()
    }

    /// Regions by flood fill.
    fn filled(mask: &[u8], size: [usize; 2]) -> (Vec<MaskRegion>, Vec<i32>) {
        let (mut owner, mut found) = (vec![usize::MAX; mask.len()], Vec::new());
        for start in 0..mask.len() {
            if mask[start] == 0 || owner[start] != usize::MAX {
                continue;
            }
            let (number, mut todo) = (found.len(), vec![start]);
            let mut region = MaskRegion { rows: (usize::MAX, 0), columns: (usize::MAX, 0), area: 0, sums: [0, 0] };
            let mut block = (usize::MAX, usize::MAX);
            owner[start] = number;
            while let Some(index) = todo.pop() {
                let (row, column) = (index / size[1], index % size[1]);
                let one =
                    MaskRegion { rows: (row, row + 1), columns: (column, column + 1), area: 1, sums: [column, row] };
                region.join(&one);
                block = block.min((row / 2, column / 2));
                for other in around(index, size).filter(|other| mask[*other] != 0) {
                    if owner[other] == usize::MAX {
                        owner[other] = number;
                        todo.push(other);
                    }
                }
            }
            found.push((block, number, region));
        }
        found.sort_by_key(|(block, ..)| *block);
        let number_of =
            |own: &usize| found.iter().position(|(_, number, _)| number == own).map_or(0, |place| place as i32 + 1);
        (found.iter().map(|(.., region)| *region).collect(), owner.iter().map(number_of).collect())
    }

    #[test]
    fn regions_gaps_and_skin_are_those_of_plain_loops() {
        for seed in 0..40 {
            let mut number = numbers(seed);
            let size = [1 + (59.0 * number()) as usize, 1 + (89.0 * number()) as usize];
            let count = size[0] * size[1];
            // Correlated noise: the mean of the surroundings of each pixel.
            let noise: Vec<f64> = (0..count).map(|_| number()).collect();
            let limit = 0.4 + 0.2 * number();
            let mean = |index: usize| {
                let (sum, count) =
                    around(index, size).fold((0.0, 0.0), |(sum, count), other| (sum + noise[other], count + 1.0));
                sum / count
            };
            let mask: Vec<u8> = (0..count).map(|index| u8::from(mean(index) > limit)).collect();
            let longest = 3.0 + 21.0 * number();
            let gaps_closed = |mask: &[u8]| {
                let (regions, labels) = filled(mask, size);
                let length = |(low, high): (usize, usize)| (high - low) as f64;
                let short = |label: &i32| {
                    let region = usize::try_from(label - 1).ok().map(|place| regions[place]);
                    u8::from(region.is_some_and(|region| length(region.rows).hypot(length(region.columns)) <= longest))
                };
                // The bounding box of the set pixels contains everything: nothing outside it counts.
                let [rows, columns] = bounds(mask, size[1]);
                let short = cut(&labels.iter().map(short).collect::<Vec<_>>(), size[1], &rows, &columns);
                let part = [rows.len(), columns.len()];
                let closed = morphed(&morphed(&short, part, false), part, true);
                let mut result = mask.to_vec();
                for (place, pixel) in closed.into_iter().enumerate() {
                    let index = (rows.start + place / part[1]) * size[1] + columns.start + place % part[1];
                    result[index] |= pixel;
                }
                result
            };
            assert_eq!(regions(&mask, size[1]), filled(&mask, size), "{seed}");
            assert_eq!(joined(&mask, size[1], longest), gaps_closed(&mask), "{seed}");

            // Repeats the test with an image and all exclusion masks.
            let fraction = 0.3 + 0.5 * number();
            let mut table: Vec<bool> = (0..chroma::BINS).map(|_| number() < fraction).collect();
            table[5] = true;
            let bins: Vec<u16> =
                mask.iter().map(|pixel| if *pixel != 0 { 5 } else { (65_536.0 * number()) as u16 }).collect();
            let body: Vec<bool> = (0..count).map(|_| number() < 0.9).collect();
            let before: Vec<bool> = (0..count).map(|_| number() < 0.5).collect();
            let always: Vec<f32> = (0..count).map(|_| 0.6 * number() as f32).collect();
            let picture = SkinPicture {
                bins: &bins,
                width: size[1],
                table: &table,
                body: Some(&body),
                always: Some(&always),
                before: Some(&before),
            };
            let (mut colored, mut skin) = (Vec::new(), Vec::new());
            picture.find(longest, &mut colored, &mut skin).unwrap();
            let light: Vec<bool> = bins.iter().map(|bin| *bin < 32_768 && table[usize::from(*bin)]).collect();
            // Majority of nine, with the border replicated.
            let most = |index: usize| {
                let near = |place: usize, offset: usize, size: usize| (place + offset).saturating_sub(1).min(size - 1);
                let (row, column) = (index / size[1], index % size[1]);
                let nine = (0..9).map(|n| near(row, n / 3, size[0]) * size[1] + near(column, n % 3, size[1]));
                nine.filter(|other| light[*other]).count() > 4
            };
            let smooth: Vec<u8> = (0..count).map(|index| u8::from(most(index))).collect();
            assert_eq!(colored, smooth, "{seed}");
            let may = |index: usize| body[index] && (always[index] < 0.5 || before[index]);
            let kept: Vec<u8> = (0..count).map(|index| smooth[index] & u8::from(may(index))).collect();
            let opened = morphed(&morphed(&kept, size, true), size, false);
            let expected: Vec<u8> =
                gaps_closed(&opened).iter().zip(&body).map(|(pixel, body)| pixel & u8::from(*body)).collect();
            assert_eq!(skin, expected, "{seed}");
        }
    }
}
