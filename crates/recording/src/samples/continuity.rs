//! Repairs logs without step markers whose clock was set forward: across the gap every reading continues as if no time had passed.
//!
//! While a logger pauses the machine continues, so changing readings differ after the gap. If they continue from their last value at the
//! same slope, the clock was set. A constant reading is no evidence.

use crate::ReadWarning;
use crate::channel_mapping::mapped_topics::MappedQuantity;
use crate::samples::log_clock::{MAX_BACK_INTERVALS, MAX_BACK_S};
use crate::samples::series_builder::SeriesBuilder;
use mapper_core::unit_factors::NS_PER_S;
use mapper_numerics::statistics::median;
use std::collections::BTreeMap;

/// Samples on each side of a gap that determine level and slope. Bound: more would average over changes.
const SIDE_SAMPLES: usize = 20;
/// Their minimum number. Bound: the error of their standard deviation is a quarter.
const MIN_SIDE_SAMPLES: usize = 8;

/// Maximum number of gaps that are checked. Bound: a clock is set once or twice.
const MAX_GAPS: usize = 100;

/// Standard errors within which two levels, or two slopes, are equal. Bound: by chance never exceeded.
const EQUAL_SIGMAS: f64 = 5.0;

/// Minimum slope in standard errors for a reading that is evidence. Bound: noise never reaches it.
const MIN_SLOPE_SIGMAS: f64 = 8.0;
/// Minimum change over a pause in tolerances for a reading that is evidence. Bound: equal levels on both sides then exclude a pause.
const MIN_MOVE_RATIO: f64 = 10.0;

/// Rounding of readings, relative to their level. Bound: stored numbers have more digits.
const ROUNDING_RATIO: f64 = 1e-9;

/// A straight line through the samples next to a gap.
#[derive(Debug, Clone, Copy)]
struct LineFit {
    /// Level at the edge of the gap, and its standard error.
    level: f64,
    level_sigma: f64,
    slope_per_s: f64,
    slope_sigma_per_s: f64,
}

impl LineFit {
    /// Through times, s from the edge, and values; `None` without a spread of times.
    fn through(samples: &[(f64, f64)]) -> Option<LineFit> {
        let count = samples.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| samples.iter().map(of).sum::<f64>() / count;
        let (mean_s, mean_value) = (mean(|sample| sample.0), mean(|sample| sample.1));
        let spread: f64 = samples.iter().map(|(t_s, _)| (t_s - mean_s).powi(2)).sum();
        if samples.len() < MIN_SIDE_SAMPLES || spread <= 0.0 {
            return None;
        }
        let cross_sum: f64 = samples.iter().map(|(t_s, value)| (t_s - mean_s) * (value - mean_value)).sum();
        let slope_per_s = cross_sum / spread;
        let level = mean_value - slope_per_s * mean_s;
        let residual = |(t_s, value): &(f64, f64)| (value - level - slope_per_s * t_s).powi(2);
        let sigma = (samples.iter().map(residual).sum::<f64>() / (count - 2.0)).sqrt();
        let rounding = ROUNDING_RATIO * mean_value.abs();
        Some(LineFit {
            level,
            level_sigma: sigma * (1.0 / count + mean_s * mean_s / spread).sqrt() + rounding,
            slope_per_s,
            slope_sigma_per_s: (sigma + rounding) / spread.sqrt(),
        })
    }
}

/// Evidence of one channel about a gap.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum GapEvidence {
    /// The reading changed: time passed.
    Paused,
    /// The reading was changing, and continued as if no time had passed.
    Set,
    /// The reading was constant.
    Nothing,
}

fn gap_evidence(
    builder: &SeriesBuilder,
    (from_ns, to_ns): (u64, u64),
    interval_s: f64,
) -> Option<GapEvidence> {
    let (before, after) = builder.sides(from_ns, to_ns, SIDE_SAMPLES)?;
    let (before, after) = (LineFit::through(&before)?, LineFit::through(&after)?);
    let jump = after.level - (before.level + before.slope_per_s * interval_s);
    let tolerance = EQUAL_SIGMAS * before.level_sigma.hypot(after.level_sigma);
    let slope_sigma = before.slope_sigma_per_s.hypot(after.slope_sigma_per_s);
    let gap_s = to_ns.saturating_sub(from_ns) as f64 / NS_PER_S;
    if jump.abs() > tolerance {
        return Some(GapEvidence::Paused);
    }
    let is_moving = before.slope_per_s.abs() > MIN_SLOPE_SIGMAS * slope_sigma
        && before.slope_per_s.abs() * gap_s > MIN_MOVE_RATIO * tolerance;
    let is_same_slope = (after.slope_per_s - before.slope_per_s).abs()
        <= EQUAL_SIGMAS * slope_sigma + 0.5 * before.slope_per_s.abs();
    Some(if is_moving && is_same_slope { GapEvidence::Set } else { GapEvidence::Nothing })
}

/// Closes the gaps of a clock that was set forward, in all channels.
pub(crate) fn repair_gaps<'a>(
    builders: &mut BTreeMap<MappedQuantity, SeriesBuilder>,
    others: impl IntoIterator<Item = &'a mut SeriesBuilder>,
    warnings: &mut Vec<ReadWarning>,
) {
    let mut others: Vec<&mut SeriesBuilder> = others.into_iter().collect();
    for _ in 0..MAX_GAPS {
        let Some((gap, by_ns)) = find_clock_step(builders) else { return };
        for builder in builders.values_mut().chain(others.iter_mut().map(|builder| &mut **builder)) {
            builder.close_gap(gap.0, gap.1, by_ns, (MAX_BACK_S * NS_PER_S) as u64);
        }
        warnings.push(ReadWarning::ClockSet { by_s: by_ns as f64 / NS_PER_S });
    }
}

/// The first gap that is due to a clock that was set, and its excess over the usual interval, ns.
fn find_clock_step(builders: &BTreeMap<MappedQuantity, SeriesBuilder>) -> Option<((u64, u64), u64)> {
    // Late messages cause gaps as well.
    if !builders.values().all(SeriesBuilder::is_in_order) {
        return None;
    }
    let reference = builders.values().max_by_key(|builder| builder.len())?;
    let intervals_s = reference.intervals_s();
    let interval_s = median(&intervals_s)?;
    let limit_s = MAX_BACK_S.max(MAX_BACK_INTERVALS * interval_s);
    reference.gaps(limit_s).take(MAX_GAPS).find_map(|gap| {
        let all: Vec<GapEvidence> =
            builders.values().filter_map(|builder| gap_evidence(builder, gap, interval_s)).collect();
        let set = all.contains(&GapEvidence::Set) && !all.contains(&GapEvidence::Paused);
        set.then(|| (gap, (gap.1 - gap.0).saturating_sub((interval_s * NS_PER_S).round() as u64)))
    })
}
