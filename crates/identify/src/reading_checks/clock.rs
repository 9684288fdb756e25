//! Checks times: late channels, and impossible steps.
//!
//! Speed, flow, P2 and T2 show the jump as a change of level. The housing shows a change of slope, since its temperature cannot jump. Over all
//! jumps of a recording the moment of the largest change is known to a second or two. Two loggers with separate clocks, a filter, or a slow
//! fieldbus client make a channel late.

use crate::reading_checks::ends::FailedCheck;
use crate::step_data::samples::{begins_with_jump, slope_per_s};
use mapper_core::{Channel, Recording, Series, StepConflict, Swapped, Warning, WindowRule, step_number};
use mapper_numerics::statistics::{MIN_VALUES, mean, median};

/// Spacing of the moments in averaging times. Bound: fine compared with a level, so that no peak is missed.
const MOMENT_SPACING_RATIO: f64 = 0.25;
/// Minimum ratio of the largest squared change to the mean. Bound: noise of ten jumps does not reach it at any of
/// 80 moments.
const MIN_PEAK_RATIO: f64 = 4.0;

/// Averaging time of a level before and after a moment, s; twice as long for a slope. Moments lie a quarter of it apart. Bound: longer
/// than the correlation time of sensor noise, shorter than a lag that matters.
const LEVEL_S: f64 = 2.0;
/// Latest moment after a jump that is considered, s; the earliest is [`WindowRule::EARLIEST_S`] before it. Bound: slower channels than
/// that are no sensors.
const AFTER_S: f64 = 40.0;
/// Lag behind the others above which a channel is late, s. Bound: a probe of 4 mm and a shaft that runs up make 2 s.
const LATE_S: f64 = 3.5;
/// Whether a channel changes its level or its slope at a jump.
const WATCHED: [(Channel, bool); 5] = [
    (Channel::ShaftSpeed, false),
    (Channel::CompressorFlow, false),
    (Channel::P2, false),
    (Channel::T2, false),
    (Channel::Tc, true),
];

pub(crate) fn lag_checks(recording: &Recording) -> Vec<FailedCheck> {
    let steps = &recording.steps;
    let jumps_s: Vec<f64> = (0..steps.len())
        .filter(|position| begins_with_jump(steps, *position))
        // The window after the last moment must not include the next jump.
        .filter(|position| {
            steps[*position].end_s - steps[*position].start_s > AFTER_S + WindowRule::EARLIEST_S
        })
        .map(|position| steps[position].start_s)
        .collect();
    if jumps_s.len() < MIN_VALUES {
        return Vec::new();
    }
    let mut found: Vec<FailedCheck> = housing_jumps(recording, &jumps_s).into_iter().collect();
    let lags_s: Vec<(Channel, f64)> = WATCHED
        .into_iter()
        .filter_map(|(channel, slope)| {
            Some((channel, lag_s(recording.series.get(&channel)?, &jumps_s, slope)?))
        })
        .collect();
    // At least three channels are needed for a reference time.
    let Some(middle_s) = median(lags_s.iter().map(|(_, lag_s)| *lag_s)).filter(|_| lags_s.len() >= 3) else {
        return found;
    };
    let late =
        lags_s.iter().filter(|(_, lag_s)| (lag_s - middle_s).abs() > LATE_S).map(|(channel, lag_s)| {
            let (lag_s, jumps) = (lag_s - middle_s, jumps_s.len());
            let late = Warning::LateChannel { channel: *channel, lag_s, jumps };
            FailedCheck::of_all_steps(late, recording)
        });
    found.extend(late);
    found
}

/// A housing of a kilogram cannot jump with the gas: if Tc jumps more than T2, the two are swapped.
fn housing_jumps(recording: &Recording, jumps_s: &[f64]) -> Option<FailedCheck> {
    let jump_k = |channel: Channel| {
        let series = recording.series.get(&channel)?;
        median(jumps_s.iter().filter_map(|jump_s| change(series, jump_s + LEVEL_S, false)).map(f64::abs))
    };
    let (t2_k, tc_k) = (jump_k(Channel::T2)?, jump_k(Channel::Tc)?);
    (tc_k > 2.0 * t2_k).then(|| {
        let swapped = Swapped::TcBeforeT2 { tc_jump_k: tc_k, t2_jump_k: t2_k };
        FailedCheck::of_all_steps(Warning::SwappedChannels(swapped), recording)
    })
}

/// Time after the jumps at which a channel changes most, s; `None` if it does not change.
fn lag_s(series: &Series, jumps_s: &[f64], slope: bool) -> Option<f64> {
    let every_s = MOMENT_SPACING_RATIO * LEVEL_S;
    let moments = ((WindowRule::EARLIEST_S + AFTER_S) / every_s) as usize;
    let mut squares = vec![0.0; moments + 1];
    for jump_s in jumps_s {
        let changes: Vec<f64> = (0..=moments)
            .map(|k| {
                let moment_s = jump_s - WindowRule::EARLIEST_S + k as f64 * every_s;
                change(series, moment_s, slope).unwrap_or(0.0).powi(2)
            })
            .collect();
        let whole = mean(&changes).filter(|mean| *mean > 0.0)?;
        // Give each jump equal weight.
        squares.iter_mut().zip(changes).for_each(|(sum, square)| *sum += square / whole);
    }
    let (at, largest) = squares.iter().enumerate().max_by(|a, b| a.1.total_cmp(b.1))?;
    // Pure noise has no peak.
    let clear = *largest > MIN_PEAK_RATIO * mean(&squares)?;
    clear.then_some(at as f64 * every_s - WindowRule::EARLIEST_S)
}

/// Change of level or slope at a moment.
fn change(series: &Series, moment_s: f64, slope: bool) -> Option<f64> {
    if !slope {
        let before = mean(series.slice(moment_s - LEVEL_S, moment_s).1)?;
        return Some(mean(series.slice(moment_s, moment_s + LEVEL_S).1)? - before).filter(|d| d.is_finite());
    }
    let rate = |from_s: f64, to_s: f64| {
        let (t_s, values) = series.slice(from_s, to_s);
        slope_per_s(t_s.iter().copied().zip(values.iter().copied()))
    };
    let change = rate(moment_s, moment_s + 2.0 * LEVEL_S)? - rate(moment_s - 2.0 * LEVEL_S, moment_s)?;
    Some(change).filter(|change| change.is_finite())
}

/// Overlap that the rounded times of other loggers explain, s. Bound: half of their second.
const ROUNDED_S: f64 = 0.5;

/// Steps that overlap in time or share a number.
pub(crate) fn step_checks(recording: &Recording) -> Vec<FailedCheck> {
    let steps = &recording.steps;
    let mut found = Vec::new();
    let mut by_time: Vec<usize> = (0..steps.len()).filter(|i| steps[*i].start_s < steps[*i].end_s).collect();
    by_time.sort_by(|a, b| steps[*a].start_s.total_cmp(&steps[*b].start_s));
    // The step with the latest end so far: a step that begins before that end overlaps it.
    let mut furthest: Option<usize> = None;
    for &position in &by_time {
        let step = &steps[position];
        if let Some(before) = furthest.filter(|before| steps[*before].end_s > step.start_s + ROUNDED_S) {
            let overlap = StepConflict::Overlap {
                first: step_number(steps[before].index),
                first_start_s: steps[before].start_s,
                first_end_s: steps[before].end_s,
                second: step_number(step.index),
                second_start_s: step.start_s,
                second_end_s: step.end_s,
            };
            found.push(FailedCheck::new(Warning::StepsContradict(overlap), vec![before, position]));
        }
        if furthest.is_none_or(|before| steps[before].end_s < step.end_s) {
            furthest = Some(position);
        }
    }
    let mut by_index: Vec<usize> = (0..steps.len()).collect();
    by_index.sort_by_key(|position| steps[*position].index);
    for same in by_index.chunk_by(|a, b| steps[*a].index == steps[*b].index).filter(|same| same.len() > 1) {
        let shared =
            StepConflict::SharedNumber { number: step_number(steps[same[0]].index), steps: same.len() };
        found.push(FailedCheck::new(Warning::StepsContradict(shared), same.to_vec()));
    }
    found
}
