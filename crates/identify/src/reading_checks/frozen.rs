//! Detects frozen and saturated channels: a reading with noise does not repeat to the last digit.
//!
//! A stuck sensor, a logger with a failed module and a saturated amplifier all repeat one value. A coarse logger also repeats values, but all
//! the time. Such a channel counts as frozen only if it stays constant over a jump that should move it.

use crate::IdentifyConfig;
use crate::needs::needs;
use crate::reading_checks::ends::Ends;
use crate::reading_checks::failed_check::FailedCheck;
use crate::step_data::commands::FOLLOWED_S;
use mapper_core::{Channel, Recording, Series, Warning, is_jump, repeats};
use mapper_numerics::statistics::{MIN_VALUES, range};
use mapper_physics::rig::sensor_fault::repeats_s;

/// Share of equal neighbours outside the long runs above which a logger counts as coarse. Bound: noise above a digit repeats less often.
const COARSE_SHARE: f64 = 0.3;

/// A run of one repeated value.
struct Run {
    first: usize,
    last: usize,
}

pub(crate) fn failed_checks(
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
