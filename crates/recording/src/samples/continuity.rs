//! Clocks that were set forward in logs without step markers: a gap over which every reading goes on as if no time had passed.
//!
//! During a pause of the logger the machine goes on, so that readings that change before the gap have moved after it. If they go on from
//! their last value, at the same slope, the clock was set. Readings that do not change decide nothing, and their gap stays.

use crate::ReadWarning;
use crate::channel_mapping::mapped_topics::Reads;
use crate::samples::log_clock::{BACK_INTERVALS, BACK_S};
use crate::samples::series_builder::SeriesBuilder;
use mapper_numerics::statistics::median;
use std::collections::BTreeMap;

/// Samples on each side of a gap from which level and slope are taken, and the minimum.
const SIDE: usize = 20;
const SIDE_MIN: usize = 8;

/// Maximum number of gaps that are judged: a clock is set once or twice.
const GAP_LIMIT: usize = 100;

/// Standard errors within which two levels, or two slopes, are equal.
const EQUAL_SIGMAS: f64 = 5.0;

/// Standard errors by which a slope differs from 0, and multiples of the tolerance that a pause would have moved a reading.
const MOVES_SIGMAS: f64 = 8.0;
const MOVED_RATIO: f64 = 10.0;

/// Rounding of readings, relative to their level.
const ROUNDING_RATIO: f64 = 1e-9;

/// A straight line through the samples next to a gap.
#[derive(Debug, Clone, Copy)]
struct Line {
    /// Level at the edge of the gap, and its standard error.
    level: f64,
    level_sigma: f64,
    slope_per_s: f64,
    slope_sigma_per_s: f64,
}

impl Line {
    /// Through times, s from the edge, and values; `None` without a spread of times.
    fn through(samples: &[(f64, f64)]) -> Option<Line> {
        let count = samples.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| samples.iter().map(of).sum::<f64>() / count;
        let (mean_s, mean_value) = (mean(|sample| sample.0), mean(|sample| sample.1));
        let spread: f64 = samples.iter().map(|(t_s, _)| (t_s - mean_s).powi(2)).sum();
        if samples.len() < SIDE_MIN || spread <= 0.0 {
            return None;
        }
        let together: f64 = samples.iter().map(|(t_s, value)| (t_s - mean_s) * (value - mean_value)).sum();
        let slope_per_s = together / spread;
        let level = mean_value - slope_per_s * mean_s;
        let residual = |(t_s, value): &(f64, f64)| (value - level - slope_per_s * t_s).powi(2);
        let sigma = (samples.iter().map(residual).sum::<f64>() / (count - 2.0)).sqrt();
        let rounding = ROUNDING_RATIO * mean_value.abs();
        Some(Line {
            level,
            level_sigma: sigma * (1.0 / count + mean_s * mean_s / spread).sqrt() + rounding,
            slope_per_s,
            slope_sigma_per_s: (sigma + rounding) / spread.sqrt(),
        })
    }
}

/// What one channel says about a gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Says {
    /// It has moved: time has passed.
    Paused,
    /// It went on as if no time had passed, although it was moving.
    Set,
    /// It was not moving.
    Nothing,
}

fn says(builder: &SeriesBuilder, (from_ns, to_ns): (u64, u64), interval_s: f64) -> Option<Says> {
    let (before, after) = builder.sides(from_ns, to_ns, SIDE)?;
    let (before, after) = (Line::through(&before)?, Line::through(&after)?);
    let off = after.level - (before.level + before.slope_per_s * interval_s);
    let tolerance = EQUAL_SIGMAS * before.level_sigma.hypot(after.level_sigma);
    let slope_sigma = before.slope_sigma_per_s.hypot(after.slope_sigma_per_s);
    let gap_s = to_ns.saturating_sub(from_ns) as f64 / 1e9;
    if off.abs() > tolerance {
        return Some(Says::Paused);
    }
    let moves = before.slope_per_s.abs() > MOVES_SIGMAS * slope_sigma
        && before.slope_per_s.abs() * gap_s > MOVED_RATIO * tolerance;
    let same = (after.slope_per_s - before.slope_per_s).abs()
        <= EQUAL_SIGMAS * slope_sigma + 0.5 * before.slope_per_s.abs();
    Some(if moves && same { Says::Set } else { Says::Nothing })
}

/// Closes the gaps that a clock made when it was set forward, in all channels.
pub(crate) fn repair_gaps<'a>(
    builders: &mut BTreeMap<Reads, SeriesBuilder>,
    others: impl IntoIterator<Item = &'a mut SeriesBuilder>,
    warnings: &mut Vec<ReadWarning>,
) {
    let mut others: Vec<&mut SeriesBuilder> = others.into_iter().collect();
    for _ in 0..GAP_LIMIT {
        let Some((gap, by_ns)) = first_set(builders) else { return };
        for builder in builders.values_mut().chain(others.iter_mut().map(|builder| &mut **builder)) {
            builder.close_gap(gap.0, gap.1, by_ns, (BACK_S * 1e9) as u64);
        }
        warnings.push(ReadWarning::ClockSet { by_s: by_ns as f64 / 1e9 });
    }
}

/// The first gap that a set clock has made, and its excess over the usual interval, ns.
fn first_set(builders: &BTreeMap<Reads, SeriesBuilder>) -> Option<((u64, u64), u64)> {
    // Messages that are late leave gaps as well.
    if !builders.values().all(SeriesBuilder::is_in_order) {
        return None;
    }
    let reference = builders.values().max_by_key(|builder| builder.len())?;
    let intervals_s = reference.intervals_s();
    let interval_s = median(&intervals_s)?;
    let limit_s = BACK_S.max(BACK_INTERVALS * interval_s);
    reference.gaps(limit_s).take(GAP_LIMIT).find_map(|gap| {
        let all: Vec<Says> = builders.values().filter_map(|builder| says(builder, gap, interval_s)).collect();
        let set = all.contains(&Says::Set) && !all.contains(&Says::Paused);
        set.then(|| (gap, (gap.1 - gap.0).saturating_sub((interval_s * 1e9).round() as u64)))
    })
}
