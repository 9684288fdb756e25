//! The clock of a group of rows: isolated wrong times are skipped, and a restarted clock ends the reading.

/// Minimum difference from both neighbours for a wrong time, s. Bound: a day; a log has no such gap between two rows and back.
pub(crate) const STRAY_S: f64 = 86_400.0;

/// Maximum valid time, s. Bound: a century, within the range of a series' clock.
const MAX_TIME_S: f64 = 3.2e9;

/// Maximum number of intervals by which a clock may step back. Bound: loggers write some rows out of order.
pub(crate) const MAX_BACK_INTERVALS: f64 = 5.0;

/// Maximum step back that is always allowed, s. Bound: another clock synchronised it.
pub(crate) const MAX_BACK_S: f64 = 2.0;

/// Recent intervals whose median is the typical one. Bound: memory.
const KEPT_INTERVALS: usize = 15;

/// A clock that goes back.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Restart {
    /// Number of the row, from 1.
    pub(crate) row: u64,
    pub(crate) from_s: f64,
    pub(crate) to_s: f64,
}

/// Forwards rows with a delay of one row.
#[derive(Debug, Default)]
pub(crate) struct LogClock {
    rows: u64,
    pending: Option<(f64, Vec<f64>)>,
    last_s: Option<f64>,
    intervals_s: Vec<f64>,
    /// Number of skipped rows.
    pub(crate) strays: u64,
    /// The first skipped time, s.
    pub(crate) stray_s: f64,
}

/// Receives the time and the values of a row; an empty cell is NaN.
pub(crate) type TakeRow<'a> = dyn FnMut(f64, &[f64]) + 'a;

impl LogClock {
    /// Takes the next row.
    ///
    /// # Errors
    /// [`Restart`] if the clock starts again.
    pub(crate) fn push(&mut self, t_s: f64, values: &[f64], take: &mut TakeRow<'_>) -> Result<(), Restart> {
        self.rows += 1;
        if !t_s.is_finite() || t_s.abs() >= MAX_TIME_S {
            self.stray(t_s);
            return Ok(());
        }
        let mut row_values = Vec::new();
        if let Some((pending_s, pending_values)) = self.pending.take() {
            match self.last_s {
                // The very first row: the next one shows whether it is valid.
                None if (t_s - pending_s).abs() > STRAY_S => self.stray(pending_s),
                Some(last_s) if self.goes_back(last_s, pending_s) => {
                    if self.goes_back(last_s, t_s) {
                        return Err(Restart { row: self.rows - 1, from_s: last_s, to_s: pending_s });
                    }
                    self.stray(pending_s);
                }
                Some(last_s)
                    if pending_s - last_s > STRAY_S
                        && pending_s - t_s > STRAY_S
                        && !self.goes_back(last_s, t_s) =>
                {
                    self.stray(pending_s);
                }
                _ => self.accept(pending_s, &pending_values, take),
            }
            row_values = pending_values;
        }
        row_values.clear();
        row_values.extend_from_slice(values);
        self.pending = Some((t_s, row_values));
        Ok(())
    }

    /// Forwards the last row.
    pub(crate) fn finish(&mut self, take: &mut TakeRow<'_>) {
        let Some((pending_s, pending_values)) = self.pending.take() else { return };
        match self.last_s {
            Some(last_s) if pending_s - last_s > STRAY_S || self.goes_back(last_s, pending_s) => {
                self.stray(pending_s)
            }
            _ => self.accept(pending_s, &pending_values, take),
        }
    }

    fn accept(&mut self, t_s: f64, values: &[f64], take: &mut TakeRow<'_>) {
        if let Some(interval_s) = self.last_s.map(|last_s| t_s - last_s).filter(|step| *step > 0.0) {
            if self.intervals_s.len() >= KEPT_INTERVALS {
                self.intervals_s.remove(0);
            }
            self.intervals_s.push(interval_s);
        }
        self.last_s = Some(t_s);
        take(t_s, values);
    }

    fn stray(&mut self, t_s: f64) {
        if self.strays == 0 {
            self.stray_s = t_s;
        }
        self.strays += 1;
    }

    fn goes_back(&self, last_s: f64, t_s: f64) -> bool {
        let back_s = last_s - t_s;
        if back_s <= MAX_BACK_S {
            return false;
        }
        let typical_s = mapper_numerics::statistics::median(&self.intervals_s).unwrap_or(0.0);
        back_s > MAX_BACK_INTERVALS * typical_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn through(times_s: &[f64]) -> (Vec<f64>, u64, Option<Restart>) {
        let (mut clock, mut out) = (LogClock::default(), Vec::new());
        let mut take = |t_s: f64, values: &[f64]| {
            assert_eq!(values, [2.0 * t_s]);
            out.push(t_s);
        };
        let restart = times_s.iter().find_map(|t_s| clock.push(*t_s, &[2.0 * t_s], &mut take).err());
        clock.finish(&mut take);
        (out, clock.strays, restart)
    }

    #[test]
    fn a_single_wrong_time_is_skipped_at_any_place() {
        let good: Vec<f64> = (0..100).map(|row| f64::from(row) / 10.0).collect();
        for wrong in [1e9, -1e9, f64::NAN, 1e300] {
            for at in [0, 50, 100] {
                let mut times_s = good.clone();
                times_s.insert(at, wrong);
                assert_eq!(through(&times_s), (good.clone(), 1, None), "{wrong} at {at}");
            }
        }
        // Back to 0 for one row.
        let mut times_s = good.clone();
        times_s.insert(90, 0.0);
        assert_eq!(through(&times_s), (good, 1, None));
    }

    #[test]
    fn a_clock_that_starts_again_is_reported_with_its_row() {
        let run = || (0..100).map(|row| f64::from(row) / 10.0);
        let times_s: Vec<f64> = run().chain(run()).collect();
        let restart = through(&times_s).2.unwrap();
        assert_eq!(restart, Restart { row: 101, from_s: 9.9, to_s: 0.0 });
    }

    #[test]
    fn pauses_and_rows_a_little_out_of_order_stay() {
        let weekend = [0.0, 0.1, 0.2, 2e5, 2e5 + 0.1, 2e5 + 0.05, 2e5 + 0.2];
        assert_eq!(through(&weekend), (weekend.to_vec(), 0, None));
        // Once a minute, and four minutes back.
        let slow = [0.0, 60.0, 120.0, 180.0, 240.0, 0.0, 60.0, 300.0];
        assert_eq!(through(&slow).2, None);
        assert_eq!(through(&[5.0]).0, [5.0]);
    }
}
