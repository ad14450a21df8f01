//! Regions of a mask: row by row, 1 for set pixels.

/// Whether at least `least` of a pixel and its eight neighbors are set; those outside do not count.
fn counted(mask: &[u8], width: usize, least: u8) -> Vec<u8> {
    let add = |sums: &mut [u8], others: &[u8]| sums.iter_mut().zip(others).for_each(|(sum, other)| *sum += other);
    let mut across = mask.to_vec();
    for (sums, row) in across.chunks_exact_mut(width).zip(mask.chunks_exact(width)) {
        add(&mut sums[1..], row);
        add(sums, &row[1..]);
    }
    let mut found = across.clone();
    add(found.get_mut(width..).unwrap_or_default(), &across);
    add(&mut found, across.get(width..).unwrap_or_default());
    found.iter_mut().for_each(|sum| *sum = u8::from(*sum >= least));
    found
}

/// Removes single pixels of a mask, and fills gaps of one.
pub(super) fn smoothed(mask: &[u8], width: usize) -> Vec<u8> {
    counted(mask, width, 5)
}

/// Removes what is narrower than three pixels.
pub(super) fn opened(mask: &[u8], width: usize) -> Vec<u8> {
    counted(&counted(mask, width, 9), width, 1)
}

/// The connected regions of a mask (8-connectivity) in the order of their first pixels: the indices of the pixels of each.
pub(super) fn regions(mask: &[u8], width: usize) -> Vec<Vec<usize>> {
    let (mut open, mut found) = (mask.to_vec(), Vec::new());
    for start in 0..mask.len() {
        if open[start] == 0 {
            continue;
        }
        open[start] = 0;
        let (mut region, mut next) = (vec![start], 0);
        while let Some(&index) = region.get(next) {
            next += 1;
            let (row, column) = (index / width, index % width);
            for row in row.saturating_sub(1)..(row + 2).min(mask.len() / width) {
                for other in row * width + column.saturating_sub(1)..row * width + (column + 2).min(width) {
                    if std::mem::take(&mut open[other]) != 0 {
                        region.push(other);
                    }
                }
            }
        }
        found.push(region);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mask(rows: &[&str]) -> Vec<u8> {
        rows.iter().flat_map(|row| row.bytes().map(|byte| u8::from(byte == b'#'))).collect()
    }

    #[test]
    fn specks_and_lines_go_and_a_hand_stays() {
        let drawn = mask(&["#......", "...###.", "...#.#.", "...####", "......#", "......#"]);
        let smooth = smoothed(&drawn, 7);
        assert!(smooth[0] == 0 && smooth[2 * 7 + 4] == 1);
        let block = mask(&[".......", "...###.", "...###.", "...###.", ".......", "######."]);
        assert_eq!(opened(&block, 7)[..35], block[..35]);
        assert_eq!(opened(&block, 7)[35..], [0; 7]);
        assert!(opened(&[], 1).is_empty());
    }

    #[test]
    fn regions_touch_at_corners_and_come_from_the_top() {
        let drawn = mask(&[".....#", "#..#..", ".#....", "#...##"]);
        let found = regions(&drawn, 6);
        let sorted: Vec<Vec<usize>> = found
            .into_iter()
            .map(|mut region| {
                region.sort_unstable();
                region
            })
            .collect();
        assert_eq!(sorted, [vec![5], vec![6, 13, 18], vec![9], vec![22, 23]]);
        assert!(regions(&[], 3).is_empty() && regions(&[0; 6], 3).is_empty());
    }
}
