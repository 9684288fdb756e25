//! Phases of a log without steps: segments in which the driving speed and pressure follow straight lines.

use crate::driven::log_rows::Rows;
use mapper_core::Channel;
use mapper_numerics::statistics::MIN_VALUES;
use std::ops::Range;

/// Two neighbours are merged if one line for both increases the misfit by less than this share of the total variation.
const MERGE_RATIO: f64 = 0.01;
/// Minimum and maximum number of phases; each is predicted by fits to the others.
const PHASES: (usize, usize) = (3, 8);

/// Phases of the first `count` rows, in order; empty if there are too few rows for two.
pub(crate) fn phases(rows: &Rows, count: usize, drives: &[Channel]) -> Vec<Range<usize>> {
    let count = count.min(rows.len());
    let sums: Vec<Sums> =
        drives.iter().map(|channel| Sums::new(&rows.t_s[..count], rows.drive(*channel))).collect();
    let cost = |range: &Range<usize>| sums.iter().map(|sums| sums.line_misfit(range)).sum::<f64>();
    let mut phases: Vec<Range<usize>> = Vec::new();
    let mut from = 0;
    for i in 0..count {
        if i - from >= MIN_VALUES {
            phases.push(from..i);
            from = i;
        }
    }
    match phases.last_mut() {
        Some(last) => last.end = count,
        None => return Vec::new(),
    }
    loop {
        let added_cost = |i: usize| {
            let both = phases[i].start..phases[i + 1].end;
            cost(&both) - cost(&phases[i]) - cost(&phases[i + 1])
        };
        let next =
            (0..phases.len().saturating_sub(1)).min_by(|a, b| added_cost(*a).total_cmp(&added_cost(*b)));
        let Some(next) = next.filter(|_| phases.len() > PHASES.0) else { break };
        if phases.len() <= PHASES.1 && added_cost(next) > MERGE_RATIO * drives.len() as f64 {
            break;
        }
        let after = phases.remove(next + 1);
        phases[next].end = after.end;
    }
    if phases.len() < 2 { Vec::new() } else { phases }
}

/// Cumulative sums that give the misfit of a straight line over any range. Values are scaled by their spread.
struct Sums {
    /// Sums of 1, t, v, t t, t v, v v before each row.
    before: Vec<[f64; 6]>,
}

impl Sums {
    fn new(t_s: &[f64], values: &[f64]) -> Self {
        let logarithms: Vec<f64> = values.iter().take(t_s.len()).map(|value| value.max(1e-9).ln()).collect();
        let count = logarithms.len().max(1) as f64;
        let mean = logarithms.iter().sum::<f64>() / count;
        // A nearly constant drive has no phases, so a variation of one percent counts as small.
        let whole = logarithms.iter().map(|v| (v - mean).powi(2)).sum::<f64>().max(1e-4 * count);
        let first_s = t_s.first().copied().unwrap_or(0.0);
        let mut sums = [0.0; 6];
        let mut before = vec![sums];
        for (t_s, v) in t_s.iter().zip(&logarithms) {
            let (t, v) = (t_s - first_s, (v - mean) / whole.sqrt());
            for (sum, term) in sums.iter_mut().zip([1.0, t, v, t * t, t * v, v * v]) {
                *sum += term;
            }
            before.push(sums);
        }
        Sums { before }
    }

    fn line_misfit(&self, range: &Range<usize>) -> f64 {
        let [n, t, v, tt, tv, vv] =
            std::array::from_fn(|i| self.before[range.end][i] - self.before[range.start][i]);
        if n < 2.0 {
            return 0.0;
        }
        let (tt, tv, vv) = (tt - t * t / n, tv - t * v / n, vv - v * v / n);
        (vv - if tt > 0.0 { tv * tv / tt } else { 0.0 }).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_acceleration_and_a_brake_are_phases_of_their_own() {
        let t_s: Vec<f64> = (0..180).map(|i| 0.1 * f64::from(i)).collect();
        let speed = |t: f64| match t {
            t if t < 6.0 => 50e3,
            t if t < 8.0 => 50e3 + 45e3 * (t - 6.0),
            t if t < 13.0 => 140e3,
            _ => 90e3,
        };
        let speeds = t_s.iter().map(|t| speed(*t)).collect();
        let rows = Rows {
            drives: vec![(Channel::ShaftSpeed, speeds)],
            rates: Vec::new(),
            judged: Vec::new(),
            lost: 0,
            t_s: t_s.clone(),
        };
        let found = phases(&rows, rows.len(), &[Channel::ShaftSpeed]);
        for begins_s in [6.0, 8.0, 13.0] {
            let nearest =
                found.iter().map(|phase| (t_s[phase.start] - begins_s).abs()).fold(f64::MAX, f64::min);
            assert!(nearest < 0.8, "{begins_s} s: {found:?}");
        }
        assert_eq!((found.first().unwrap().start, found.last().unwrap().end), (0, rows.len()));
        assert!((3..=6).contains(&found.len()), "{found:?}");
        assert!(phases(&rows, 10, &[Channel::ShaftSpeed]).is_empty());
    }
}
