//! How far the gap shrinks, on steps that were used neither for selection nor for fitting.

use crate::adequacy::misfit_of_steps;
use crate::fit::Fit;
use crate::nuisance::OUTPUTS;
use crate::report::{ChannelGap, Gap, PointGap};
use crate::study::{Hypothesis, Study};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::collections::BTreeMap;

/// Every how many steps one is held out.
const EVERY: usize = 3;
/// Resamples of the held-out steps for the interval.
const RESAMPLES: usize = 2000;

/// Steps held out of a recording: every third, chosen by place alone; none where steps are too few.
pub fn held_out(study: &Study) -> Vec<usize> {
    let steps = study.steps.len();
    if steps < 2 * EVERY { Vec::new() } else { (0..steps).filter(|step| step % EVERY == EVERY - 1).collect() }
}

/// Compares two fits made without the held-out steps on them. `seed` draws the interval's resamples.
pub fn how_far(study: &Study, before: &Fit, after: &Fit, held_out: &[usize], seed: u64) -> Gap {
    // Where nothing could be held out, all steps are compared, and the list says so by being empty.
    let all: Vec<usize> = (0..study.steps.len()).collect();
    let steps = if held_out.is_empty() { &all[..] } else { held_out };
    let of = |fit: &Fit| {
        let misfit = misfit_of_steps(study, &fit.residual);
        steps.iter().map(|step| misfit[*step]).collect::<Vec<f64>>()
    };
    let (g_before, g_after) = (of(before), of(after));
    let share = |places: &[usize]| {
        let sum = |g: &[f64]| places.iter().map(|i| g[*i].max(0.0)).sum::<f64>();
        let total = sum(&g_before);
        if total > 0.0 { 1.0 - sum(&g_after) / total } else { 0.0 }
    };
    let every: Vec<usize> = (0..steps.len()).collect();
    let mut random = Pcg64::seed_from_u64(seed);
    let mut drawn: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let places: Vec<usize> = every.iter().map(|_| random.random_range(0..steps.len())).collect();
            share(&places)
        })
        .collect();
    drawn.sort_by(f64::total_cmp);
    let quantile = |p: f64| drawn.get((p * (RESAMPLES - 1) as f64) as usize).copied().unwrap_or(0.0);
    let mean = |g: &[f64]| g.iter().sum::<f64>() / g.len().max(1) as f64;
    Gap {
        before: mean(&g_before),
        after: mean(&g_after),
        shrink: share(&every),
        shrink_low: quantile(0.025),
        shrink_high: quantile(0.975),
        held_out_steps: held_out.to_vec(),
        channels: channels(study, before, after, steps),
        points: points(study, &before.hypothesis, &after.hypothesis),
    }
}

/// Root mean square of measured minus predicted block means, for each channel, in its unit.
fn channels(study: &Study, before: &Fit, after: &Fit, steps: &[usize]) -> BTreeMap<String, ChannelGap> {
    let mut channels = BTreeMap::new();
    for (output, channel) in OUTPUTS.iter().enumerate() {
        let groups = || study.groups.iter().filter(|g| g.output == output && steps.contains(&g.step));
        let count: usize = groups().map(|g| g.rows.len()).sum();
        if count == 0 {
            continue;
        }
        let rms = |fit: &Fit| {
            let squares = groups().flat_map(|g| g.rows.clone());
            let sum: f64 =
                squares.map(|row| (study.measured[row] - fit.prediction.values[row]).powi(2)).sum();
            (sum / count as f64).sqrt()
        };
        let row = ChannelGap { before: rms(before), after: rms(after), unit: channel.unit().to_owned() };
        channels.insert(channel.symbol().to_owned(), row);
    }
    channels
}

fn points(study: &Study, before: &Hypothesis, after: &Hypothesis) -> Vec<PointGap> {
    let (Ok(before), Ok(after)) = (study.points(before), study.points(after)) else { return Vec::new() };
    study
        .steps
        .iter()
        .zip(before.iter().zip(&after))
        .map(|(step, (before, after))| PointGap {
            speed_rpm: after.speed_rpm,
            valve: step.marker.valve_opening_ratio,
            eta_before: before.efficiency,
            eta_after: after.efficiency,
            h_before_w_m2k: before.h_w_m2k,
            h_after_w_m2k: after.h_w_m2k,
        })
        .collect()
}
