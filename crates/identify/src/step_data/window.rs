//! The identification window: fixed, or found from the settling of the operating point.

use crate::step_data::commands;
use crate::step_outcome::findings::Findings;
use mapper_core::{Channel, Recording, Series, SettleBands, StepMarker, Warning, Window, WindowRule};
use mapper_numerics::statistics::median;
use mapper_physics::operating_point::settled::{BLOCK_S, noise_spread, settled_count, with_bands};

/// Tolerance of the end of a window, s. Source: loggers round step times to milliseconds.
const STEP_ROUNDING_S: f64 = 1e-3;

/// The window of a step; `None` if the step is too short for one.
pub(crate) fn choose(
    recording: &Recording,
    step: &StepMarker,
    rule: WindowRule,
    bands: &SettleBands,
    findings: &mut Findings,
) -> Option<Window> {
    match rule {
        WindowRule::Fixed { start_s, end_s } => fixed(step, start_s, end_s, findings),
        WindowRule::Auto => settled(recording, step, bands, findings),
    }
}

fn fixed(step: &StepMarker, start_s: f64, end_s: f64, findings: &mut Findings) -> Option<Window> {
    let wanted_s = step.start_s + end_s;
    let window = Window { start_s: step.start_s + start_s, end_s: wanted_s.min(step.end_s) };
    if window.end_s + STEP_ROUNDING_S < wanted_s {
        let step_s = step.end_s - step.start_s;
        findings.remark(Warning::WindowCut { requested_end_s: end_s, step_s });
    }
    (window.start_s < window.end_s).then_some(window)
}

fn settled(
    recording: &Recording,
    step: &StepMarker,
    bands: &SettleBands,
    findings: &mut Findings,
) -> Option<Window> {
    let Settling { slowest, settled_s, earliest_s, whole } = settling(recording, step, bands)?;
    let end_s = step.end_s;
    let start_s = if whole { earliest_s } else { end_s - settled_s };
    if end_s - start_s >= WindowRule::SHORTEST_S {
        return Some(Window { start_s, end_s });
    }
    let start_s = (end_s - WindowRule::SHORTEST_S).max(earliest_s);
    findings.doubt(Warning::NotStabilised {
        quantity: slowest.to_owned(),
        settled_s,
        needed_s: WindowRule::SHORTEST_S,
        used_s: Some(end_s - start_s),
    });
    Some(Window { start_s, end_s })
}

/// Settling of an operating point.
pub(crate) struct Settling {
    /// The quantity that settles last.
    pub(crate) slowest: &'static str,
    /// How long it has been settled at the step's end, s.
    pub(crate) settled_s: f64,
    /// Earliest time checked, s.
    earliest_s: f64,
    /// Whether all quantities were settled from then on.
    pub(crate) whole: bool,
}

/// Checks a step from its end backwards; `None` for a step that ends before the earliest time.
pub(crate) fn settling(recording: &Recording, step: &StepMarker, bands: &SettleBands) -> Option<Settling> {
    let earliest_s = commands::settled_s(recording, step) + WindowRule::EARLIEST_S;
    let end_s = step.end_s;
    if end_s.is_nan() || earliest_s.is_nan() || earliest_s >= end_s {
        return None;
    }
    // Limits the number of blocks if the step times are wrong.
    let samples = recording.series.get(&Channel::ShaftSpeed).map_or(1, |series| series.t_s.len());
    let block_count = (((end_s - earliest_s) / BLOCK_S).floor() as usize).clamp(1, samples.max(1));
    let blocks = |channel| block_medians(recording.series.get(&channel), end_s, block_count);
    let (p1_pa, p2_pa) = (blocks(Channel::P1), blocks(Channel::P2));
    let pressure_ratio: Vec<f64> = p2_pa.iter().zip(&p1_pa).map(|(p2, p1)| p2 / p1).collect();
    let signals =
        with_bands(blocks(Channel::ShaftSpeed), blocks(Channel::CompressorFlow), pressure_ratio, bands);
    let (slowest, settled_blocks) = signals
        .into_iter()
        .map(|(name, backwards, allowed_ratio)| {
            let spread = noise_spread(&backwards);
            (name, settled_count(backwards, allowed_ratio, spread))
        })
        .min_by_key(|(_, blocks)| *blocks)?;
    let settled_s = settled_blocks as f64 * BLOCK_S;
    Some(Settling { slowest, settled_s, earliest_s, whole: settled_blocks == block_count })
}

/// Medians over blocks counted backwards from `end_s`; NaN for a block without values.
fn block_medians(series: Option<&Series>, end_s: f64, count: usize) -> Vec<f64> {
    let Some(series) = series else { return vec![f64::NAN; count] };
    (0..count)
        .map(|block| {
            let range = series.range(end_s - (block + 1) as f64 * BLOCK_S, end_s - block as f64 * BLOCK_S);
            median(series.values[range].iter().filter(|value| value.is_finite())).unwrap_or(f64::NAN)
        })
        .collect()
}
