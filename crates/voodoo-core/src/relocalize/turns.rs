//! What is done every now and then: by time, so that a frame that is missing changes nothing of when it is done next.

/// Turns of something that is done every so many seconds.
#[derive(Debug, Default)]
pub(super) struct Turns {
    /// When turns began to count, and the last one was taken, seconds.
    since: Option<f64>,
    last: Option<f64>,
}

impl Turns {
    /// Whether it is time, `every` so many seconds; the turn is taken then. Turns stay where they are on the clock: one that was
    /// taken late does not move the next.
    pub(super) fn take(&mut self, stamp: f64, every: f64) -> bool {
        let since = *self.since.get_or_insert(stamp);
        let number = |stamp: f64| ((stamp - since) / every).round();
        let due = self.last.is_none_or(|last| number(stamp) > number(last) && stamp - last > 0.5 * every);
        if due {
            self.last = Some(stamp);
        }
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Frames of so many a second of which it was done in, of those that are not missing.
    fn done(rate: f64, every: f64, missing: &[u32]) -> Vec<u32> {
        let mut turns = Turns::default();
        (0..31).filter(|frame| !missing.contains(frame) && turns.take(f64::from(*frame) / rate, every)).collect()
    }

    #[test]
    fn a_turn_comes_every_so_many_seconds_whatever_the_rate() {
        assert_eq!(done(30.0, 0.5, &[]), [0, 8, 23]);
        assert_eq!(done(30.0, 0.1, &[])[..4], [0, 2, 5, 8]);
        assert_eq!(done(60.0, 0.1, &[]).len(), done(30.0, 0.1, &[]).len().div_ceil(2));
        assert_eq!(done(5.0, 0.1, &[]), (0..31).collect::<Vec<_>>());
    }

    #[test]
    fn a_missing_frame_moves_no_other_turn() {
        let all = done(30.0, 0.1, &[]);
        for missing in all.iter().skip(1) {
            let others: Vec<u32> = all.iter().copied().filter(|frame| frame != missing).collect();
            let mut expected = [&others[..], &[missing + 1]].concat();
            expected.sort_unstable();
            expected.retain(|frame| *frame < 31);
            assert_eq!(done(30.0, 0.1, &[*missing]), expected);
        }
    }
}
