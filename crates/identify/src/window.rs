//! The identification window: fixed, or found from where speed, flow and pressure ratio have stabilised.

use crate::findings::{Findings, code};
use crate::jump;
use crate::{Stabilisation, WindowRule};
use mapper_core::{Channel, Recording, Series, StepMarker, Window};
use mapper_numerics::statistics::{median, robust_sigma};

/// Blocks over which signals are condensed (to their median) before they are compared, s.
const BLOCK_S: f64 = 1.0;
/// Most blocks looked at, from the step's end backwards: bounds the work on absurd step times.
const MOST_BLOCKS: usize = 20_000;
/// Spread (largest less smallest) of about a hundred normally distributed values, standard deviations.
const NOISE_SPREAD_SIGMAS: f64 = 5.0;
/// Distance of the blocks whose second difference measures noise: farther apart than noise remembers.
const NOISE_LAG_BLOCKS: usize = 4;

/// The window of a step; `None` where the step has no room for any.
pub(crate) fn choose(
    recording: &Recording,
    step: &StepMarker,
    rule: &WindowRule,
    findings: &mut Findings,
) -> Option<Window> {
    match rule {
        WindowRule::Fixed { start_s, end_s } => fixed(step, *start_s, *end_s, findings),
        WindowRule::Auto(stabilisation) => stabilised(recording, step, stabilisation, findings),
    }
}

fn fixed(step: &StepMarker, start_s: f64, end_s: f64, findings: &mut Findings) -> Option<Window> {
    let asked_end_s = step.start_s + end_s;
    let window = Window { start_s: step.start_s + start_s, end_s: asked_end_s.min(step.end_s) };
    // A millisecond: step times of other loggers are rounded.
    if window.end_s + 1e-3 < asked_end_s {
        let message = format!(
            "the window was asked to end {end_s:.1} s after the jump, the step ends after {:.1} s",
            step.end_s - step.start_s
        );
        findings.remark(code::WINDOW_CUT, message);
    }
    (window.start_s < window.end_s).then_some(window)
}

fn stabilised(
    recording: &Recording,
    step: &StepMarker,
    rule: &Stabilisation,
    findings: &mut Findings,
) -> Option<Window> {
    let earliest_s = jump::commands_settled_s(recording, step) + rule.earliest_s;
    let end_s = step.end_s;
    if end_s.is_nan() || earliest_s.is_nan() || earliest_s >= end_s {
        return None;
    }
    let block_count = (((end_s - earliest_s) / BLOCK_S).floor() as usize).clamp(1, MOST_BLOCKS);
    let blocks = |channel| block_medians(recording.series.get(&channel), end_s, block_count);
    let (p1_pa, p2_pa) = (blocks(Channel::P1), blocks(Channel::P2));
    let pressure_ratio: Vec<f64> = p2_pa.iter().zip(&p1_pa).map(|(p2, p1)| p2 / p1).collect();
    let signals = [
        ("speed", blocks(Channel::ShaftSpeed), rule.speed_ratio),
        ("flow", blocks(Channel::CompressorFlow), rule.flow_ratio),
        ("pressure ratio", pressure_ratio, rule.pressure_ratio_ratio),
    ];
    let (slowest, stable_blocks) = signals
        .iter()
        .map(|(name, values, allowed_ratio)| (*name, stable_blocks(values, *allowed_ratio)))
        .min_by_key(|(_, blocks)| *blocks)?;
    let start_s =
        if stable_blocks == block_count { earliest_s } else { end_s - stable_blocks as f64 * BLOCK_S };
    if end_s - start_s >= rule.shortest_s {
        return Some(Window { start_s, end_s });
    }
    let start_s = (end_s - rule.shortest_s).max(earliest_s);
    let message = format!(
        "the {slowest} still varies beyond its limit {:.0} s before the step's end (needed: {:.0} s); the last {:.0} s are used",
        stable_blocks as f64 * BLOCK_S,
        rule.shortest_s,
        end_s - start_s
    );
    findings.doubt(code::NOT_STABILISED, message);
    Some(Window { start_s, end_s })
}

/// Medians over blocks counted backwards from `end_s`; NaN where a block has no value.
fn block_medians(series: Option<&Series>, end_s: f64, count: usize) -> Vec<f64> {
    let Some(series) = series else { return vec![f64::NAN; count] };
    (0..count)
        .map(|block| {
            let range = series.range(end_s - (block + 1) as f64 * BLOCK_S, end_s - block as f64 * BLOCK_S);
            median(series.values[range].iter().filter(|value| value.is_finite())).unwrap_or(f64::NAN)
        })
        .collect()
}

/// How many blocks, from the last one backwards, vary together by at most `allowed_ratio` of their mean.
fn stable_blocks(backwards: &[f64], allowed_ratio: f64) -> usize {
    let noise = NOISE_SPREAD_SIGMAS * noise_sigma(backwards);
    let (mut low, mut high, mut sum, mut seen) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0.0);
    for (index, value) in backwards.iter().enumerate() {
        if value.is_nan() {
            continue;
        }
        (low, high, sum, seen) = (low.min(*value), high.max(*value), sum + value, seen + 1.0);
        if high - low - noise > allowed_ratio * (sum / seen).abs() {
            return index;
        }
    }
    if seen > 0.0 { backwards.len() } else { 0 }
}

/// Standard deviation of a signal's noise from its second differences, whose median ignores where it really moves.
fn noise_sigma(values: &[f64]) -> f64 {
    let lag = NOISE_LAG_BLOCKS;
    let differences = (2 * lag..values.len())
        .map(|i| values[i] - 2.0 * values[i - lag] + values[i - 2 * lag])
        .filter(|difference| difference.is_finite());
    // The second difference has six times the variance of a value.
    robust_sigma(differences).map_or(0.0, |sigma| sigma / 6f64.sqrt())
}
