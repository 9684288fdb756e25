//! Checks each channel by itself: frozen and saturated, dead, and noisier than declared.
//!
//! A stuck sensor, a logger with a failed module and a saturated amplifier all repeat one value. A coarse logger also repeats values, but all
//! the time. Such a channel counts as frozen only if it stays constant over a jump that should move it.

use crate::IdentifyConfig;
use crate::config::needs;
use crate::reading_checks::ends::{Ends, FailedCheck};
use crate::step_data::samples::{FOLLOWED_S, LONGEST_BRIDGE_S};
use mapper_core::{Channel, Recording, Series, Warning, check_running, is_jump, repeats};
use mapper_numerics::statistics::{MIN_VALUES, median, range, robust_sigma};
use mapper_physics::rig::sensor_fault::repeats_s;

/// Share of equal neighbours outside the long runs above which a logger counts as coarse. Bound: noise above a digit repeats less often.
const COARSE_SHARE: f64 = 0.3;

/// A run of one repeated value.
struct Run {
    first: usize,
    last: usize,
}

pub(crate) fn frozen_checks(
    recording: &Recording,
    ends: &[Option<Ends>],
    config: &IdentifyConfig,
) -> Vec<FailedCheck> {
    let moves = moves(ends);
    needs(config.method)
        .into_iter()
        .filter_map(|channel| of_channel(recording, channel, moves, config))
        .collect()
}

/// Whether the operating point changes between any steps.
fn moves(ends: &[Option<Ends>]) -> bool {
    let moves = |channel, read: fn(&Ends) -> f64| {
        let (low, high) = range(ends.iter().flatten().map(read));
        is_jump(channel, low, high)
    };
    moves(Channel::ShaftSpeed, |end| end.speed_rpm)
        || moves(Channel::CompressorFlow, |end| end.flow_kg_s)
        || moves(Channel::P2, |end| end.p2_pa)
}

fn of_channel(
    recording: &Recording,
    channel: Channel,
    moves: bool,
    config: &IdentifyConfig,
) -> Option<FailedCheck> {
    let series = recording.series.get(&channel)?;
    let shortest_s = repeats_s(channel);
    let mut long = runs(series, shortest_s);
    let in_runs: usize = long.iter().map(|run| run.last - run.first).sum();
    let pairs = series.values.len().saturating_sub(1);
    let equal = series.values.windows(2).filter(|pair| pair[0] == pair[1]).count();
    let coarse = (equal - in_runs) as f64 > COARSE_SHARE * (pairs - in_runs).max(1) as f64;
    let noisy = config.sensor(channel).noise_sigma > 0.0;
    // Controlled inlet conditions may be constant.
    let inlet = matches!(channel, Channel::P1 | Channel::T1);
    let over_a_jump = |run: &Run| {
        let (from_s, to_s) = (series.t_s[run.first], series.t_s[run.last]);
        let mut later = recording.steps.iter().skip(1);
        moves && !inlet && later.any(|step| from_s < step.start_s && step.start_s + FOLLOWED_S < to_s)
    };
    if coarse || !noisy {
        long.retain(over_a_jump);
    }
    let affected = |(position, step): (usize, &mapper_core::StepMarker)| {
        let shared_s =
            |run: &Run| series.t_s[run.last].min(step.end_s) - series.t_s[run.first].max(step.start_s);
        long.iter().any(|run| shared_s(run) >= 0.5 * shortest_s).then_some(position)
    };
    let steps: Vec<usize> = recording.steps.iter().enumerate().filter_map(affected).collect();
    let longest = long.iter().max_by(|a, b| {
        let of = |run: &Run| series.t_s[run.last] - series.t_s[run.first];
        of(a).total_cmp(&of(b))
    })?;
    let (from_s, to_s) = (series.t_s[longest.first], series.t_s[longest.last]);
    let frozen = Warning::FrozenChannel { channel, reading: series.values[longest.first], from_s, to_s };
    // Cleaning removes the constant samples of a channel with declared noise; speed needs no other check.
    let samples_left_out = noisy && channel != Channel::ShaftSpeed;
    let failed_check = FailedCheck { samples_left_out, ..FailedCheck::new(frozen, steps) };
    (!failed_check.steps.is_empty()).then_some(failed_check)
}

/// The runs of one repeated value that are at least this long.
fn runs(series: &Series, shortest_s: f64) -> Vec<Run> {
    let long = |run: &Run| {
        run.last + 1 - run.first >= MIN_VALUES && series.t_s[run.last] - series.t_s[run.first] >= shortest_s
    };
    repeats(&series.values).map(|(first, last)| Run { first, last }).filter(long).collect()
}

// Detects noise far above its declaration: a broken shield, a loose contact, a pulsating flow.
// Successive samples of a slow quantity differ only by noise. The declared noise sets the weight of each reading and the width of intervals.
// A channel with several times that noise makes the intervals too narrow.

/// Ratio of a sample's standard deviation to the declared one above which intervals are far too narrow. Judgement; noise with a time
/// constant only reduces the difference between samples. Bound: noise with a time constant only reduces the difference between samples.
const MAX_RATIO: f64 = 3.0;

pub(crate) fn noise_checks(recording: &Recording, config: &IdentifyConfig) -> Vec<FailedCheck> {
    needs(config.method)
        .into_iter()
        .filter_map(|channel| {
            let declared = config.declared.get(&channel)?.noise_sigma;
            let series = recording.series.get(&channel)?;
            let close = |pair: &[f64]| pair[1] - pair[0] <= LONGEST_BRIDGE_S;
            let differences: Vec<f64> = series
                .t_s
                .windows(2)
                .zip(series.values.windows(2))
                .filter(|(times, values)| close(times) && values.iter().all(|value| value.is_finite()))
                .map(|(_, values)| (values[1] - values[0]) / std::f64::consts::SQRT_2)
                .collect();
            let found = robust_sigma(&differences)?;
            if !(declared > 0.0 && found > MAX_RATIO * declared) {
                return None;
            }
            let noisy = Warning::NoisyChannel { channel, noise: found, declared_noise: declared };
            Some(FailedCheck::of_all_steps(noisy, recording))
        })
        .collect()
}

// Detects dead channels and wrong units: the median reading of a step is impossible for a running machine.
// The ranges are those of `mapper_core::plausible`, wide enough for every turbocharger on a gas stand.

pub(crate) fn plausibility_checks(recording: &Recording, config: &IdentifyConfig) -> Vec<FailedCheck> {
    needs(config.method)
        .into_iter()
        .filter_map(|channel| {
            let series = recording.series.get(&channel)?;
            let (mut steps, mut middles) = (Vec::new(), Vec::new());
            for (position, step) in recording.steps.iter().enumerate() {
                let values = series.slice(step.start_s, step.end_s).1;
                let Some(middle) = median(values.iter().filter(|value| value.is_finite())) else { continue };
                if check_running(channel, middle).is_err() {
                    steps.push(position);
                    middles.push(middle);
                }
            }
            let why = check_running(channel, median(&middles)?).err()?;
            Some(FailedCheck::new(Warning::DeadChannel { channel, reading: why.value }, steps))
        })
        .collect()
}
