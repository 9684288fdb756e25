//! Gap reduction on held-out steps.

use crate::gap::best_fit::adequacy::misfit_of_steps;
use crate::gap::best_fit::first_step::with_start_read;
use crate::gap::best_fit::fit::{Effort, Fit, MAX_SIGMAS, Start, fit};
use crate::gap::best_fit::selection::{Selection, dot_over};
use crate::gap::findings::report::{ChannelGap, Gap, PointGap};
use crate::gap::gap_reduction::beyond_prior::beyond_prior;
use crate::gap::gap_reduction::folds::Folds;
use crate::gap::gap_reduction::gap_distribution::{StepMisfit, gap_reduction};
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::{Hypothesis, Study};
use crate::gap::residuals::whiten::{Linearised, rows_of_step};
use mapper_core::Channel;
use mapper_numerics::parallel;
use mapper_numerics::statistics::DOUBT_SIGMAS;
use mapper_physics::simulation::inputs::Inputs;
use std::collections::BTreeMap;
use std::ops::Range;

#[derive(Clone, Copy)]
pub struct Compared<'a> {
    pub study: &'a Study,
    /// Linearised at the nominal model, and at the best cause.
    pub linearised: [&'a Linearised; 2],
    /// Fit of tolerances alone.
    pub null: &'a Fit,
    /// Causes from which each fold selects, best first; empty if none is named.
    pub causes: &'a [&'a Fit],
    /// Logarithm of the evidence of a fit, including priors.
    pub weight: &'a (dyn Fn(&Fit) -> f64 + Sync),
}

/// Whitened residuals and predicted values of all steps.
struct Predicted {
    residual: Vec<f64>,
    values: Vec<f64>,
}

impl Predicted {
    fn of(fit: &Fit) -> Predicted {
        Predicted { residual: fit.residual.clone(), values: fit.prediction.values.clone() }
    }

    fn nominal(study: &Study, linearised: &Linearised) -> Predicted {
        let base = &linearised.base;
        Predicted { residual: linearised.residual(study, base), values: base.values.clone() }
    }
}

/// Effort of a fit without some of the steps; it starts at the best fit to all steps. A tolerance beyond this limit is a suspect
/// ([`beyond_prior`]), and its own reduction of the gap does not count.
const EFFORT: Effort = Effort {
    iterations: 5,
    enough: 0.2,
    max_sigmas: MAX_SIGMAS,
    max_sigmas_of_rig: DOUBT_SIGMAS,
    exact: true,
};

/// The start of a fit without some of the steps: the best fit to all steps, its tolerances within [`EFFORT`].
fn start_within_limits(study: &Study, fit: &Fit) -> Start {
    let mut start = Start::from(fit);
    for (sigmas, nuisance) in start.hypothesis.nuisances.iter_mut().zip(&study.nuisances) {
        let limit = EFFORT.max_sigmas_of(nuisance.kind);
        if sigmas.abs() > limit {
            *sigmas = limit.copysign(*sigmas);
            start.prediction = None;
        }
    }
    start
}

/// Compares tolerances alone with the best cause on held-out steps. Each fold selects among the first few causes and refits, without its
/// own steps.
pub fn held_out_gap(compared: Compared<'_>, folds: &Folds) -> Gap {
    let Compared { study, linearised: [nominal, _], null, .. } = compared;
    let (before, after) = predict_held_out(compared, folds);
    let steps: Vec<usize> = (0..study.steps.len()).collect();
    let misfit = |predicted: &Predicted| misfit_of_steps(study, &predicted.residual);
    let (misfit_before, misfit_after) = (misfit(&before), misfit(&after));
    let mean = |misfits: &[f64]| misfits.iter().sum::<f64>() / misfits.len().max(1) as f64;
    let of_step = |step: &usize| StepMisfit {
        before: misfit_before[*step],
        after: misfit_after[*step],
        values: rows_of_step(study, *step).len(),
    };
    let reduction = gap_reduction(&steps.iter().map(of_step).collect::<Vec<_>>());
    let bare = Predicted::nominal(study, nominal);
    let (channels, worse) = by_channel(study, [&bare, &before, &after], &steps);
    let is_reduced = worse.is_empty() && !compared.causes.is_empty();
    let (low, high) = if is_reduced { reduction.interval } else { (0.0, 0.0) };
    Gap {
        nominal: mean(&misfit(&bare)),
        before: mean(&misfit_before),
        after: mean(&misfit_after),
        gap_reduction: if is_reduced { reduction.removed } else { 0.0 },
        gap_reduction_low: low,
        gap_reduction_high: high,
        steps_with_gap: reduction.steps,
        largest_step: reduction.largest.map(|(step, _)| step),
        largest_share: reduction.largest.map_or(0.0, |(_, share)| share),
        beyond_prior: beyond_prior(study, nominal, null).into_iter().next(),
        worse,
        held_out_steps: if folds.steps.len() > 1 { steps } else { Vec::new() },
        folds: folds.steps.clone(),
        channels,
        points: points(study, &compared.causes.first().unwrap_or(&null).hypothesis, &after.values),
    }
}

/// Predictions without and with a cause, of each step from fits to the other folds.
fn predict_held_out(compared: Compared<'_>, folds: &Folds) -> (Predicted, Predicted) {
    let Compared { study, linearised: [nominal, at_best], null, causes, weight } = compared;
    if folds.steps.len() < 2 {
        return (Predicted::of(null), Predicted::of(causes.first().unwrap_or(&null)));
    }
    // The null and each cause in every fold.
    let jobs: Vec<(usize, usize)> =
        (0..folds.steps.len()).flat_map(|fold| (0..=causes.len()).map(move |which| (fold, which))).collect();
    let fitted = parallel::map(&jobs, |(fold, which)| {
        let mut selection = Selection::all(study);
        for step in &folds.steps[*fold] {
            selection.steps[*step] = false;
        }
        let (linearised, whole) = match which.checked_sub(1) {
            None => (nominal, null),
            Some(cause) => (at_best, causes[cause]),
        };
        // If a fold cannot be fitted, it keeps the fit to all steps.
        let start = start_within_limits(study, whole);
        let fitted = fit(study, linearised, start, &selection, EFFORT).unwrap_or_else(|_| whole.clone());
        if selection.steps[0] { fitted } else { with_start_read(study, linearised, fitted) }
    });
    let (mut before, mut after) = (Predicted::of(null), Predicted::of(null));
    for (fold, steps) in folds.steps.iter().enumerate() {
        let of_fold: Vec<&Fit> =
            jobs.iter().zip(&fitted).filter(|((f, _), _)| *f == fold).map(|(_, fit)| fit).collect();
        let Some((bare, causes)) = of_fold.split_first() else { continue };
        let best = causes.iter().max_by(|a, b| weight(a).total_cmp(&weight(b))).unwrap_or(bare);
        for step in steps {
            for row in rows_of_step(study, *step) {
                before.residual[row] = bare.residual[row];
                before.values[row] = bare.prediction.values[row];
                after.residual[row] = best.residual[row];
                after.values[row] = best.prediction.values[row];
            }
        }
    }
    (before, after)
}

/// Channel residuals on some steps for each prediction, and the channels that the last prediction makes worse than the one before it.
pub fn channels_on(
    study: &Study,
    linearised: &Linearised,
    [before, after]: [&Fit; 2],
    steps: &[usize],
) -> (BTreeMap<String, ChannelGap>, Vec<String>) {
    let nominal = Predicted::nominal(study, linearised);
    by_channel(study, [&nominal, &Predicted::of(before), &Predicted::of(after)], steps)
}

/// A channel is worse if its residual grows by this ratio, and by more than chance.
const WORSE_RATIO: f64 = 1.1;

/// Root mean square of measured minus predicted block means of these steps, per channel in its unit: nominal model, fitted tolerances, and
/// cause. Also returns the channels that the cause makes worse.
fn by_channel(
    study: &Study,
    [nominal, before, after]: [&Predicted; 3],
    steps: &[usize],
) -> (BTreeMap<String, ChannelGap>, Vec<String>) {
    let (mut channels, mut worse) = (BTreeMap::new(), Vec::new());
    for (output, channel) in OUTPUTS.iter().enumerate() {
        let groups = study.groups.iter().filter(|g| g.output == output && steps.contains(&g.step));
        let rows: Vec<Range<usize>> = groups.map(|g| g.rows.clone()).collect();
        let count: usize = rows.iter().map(Range::len).sum();
        if count == 0 {
            continue;
        }
        let rms = |predicted: &Predicted| {
            let off: Vec<f64> = study.measured.iter().zip(&predicted.values).map(|(m, v)| m - v).collect();
            (dot_over(&rows, &off, &off) / count as f64).sqrt()
        };
        let gap = ChannelGap {
            nominal: rms(nominal),
            before: rms(before),
            after: rms(after),
            unit: channel.unit().to_owned(),
        };
        let squares = |of: &[f64]| dot_over(&rows, of, of);
        let apart: Vec<f64> = before.residual.iter().zip(&after.residual).map(|(b, a)| b - a).collect();
        let more = squares(&after.residual) - squares(&before.residual);
        // For two equally good predictions, the misfit difference has a standard deviation of twice their distance.
        let chance = 2.0 * squares(&apart).sqrt();
        if gap.after > WORSE_RATIO * gap.before && more > DOUBT_SIGMAS * chance.max(DOUBT_SIGMAS) {
            worse.push(channel.symbol().to_owned());
        }
        channels.insert(channel.symbol().to_owned(), gap);
    }
    (channels, worse)
}

/// Residual of T2 in the last block of a step as a share of the temperature rise: at equal pressures, that of the efficiency.
fn rise_residual_ratio(study: &Study, step: usize, predicted: &[f64]) -> Option<f64> {
    let group = study.groups.iter().find(|g| g.step == step && OUTPUTS[g.output] == Channel::T2)?;
    let row = group.rows.clone().last()?;
    let rise_k = study.measured[row] - study.inputs.at(study.steps[step].blocks.last()?.mean_s).t1_k;
    (rise_k > 1.0).then(|| ((study.measured[row] - predicted[row]) / rise_k).abs())
}

/// Efficiency and heat transfer at the end of each step: with the cause and its tolerances, with these tolerances alone, and for the
/// nominal model. All use the same speed, pressures and metal temperatures, so a shifted operating point does not appear as an efficiency
/// change.
fn points(study: &Study, after: &Hypothesis, predicted: &[f64]) -> Vec<PointGap> {
    let tolerances = Hypothesis { nuisances: after.nuisances.clone(), effects: Vec::new() };
    let nothing = study.nothing();
    let Ok(points) = study.points_with_others(after, &[&nothing, &tolerances]) else { return Vec::new() };
    study
        .steps
        .iter()
        .zip(points)
        .enumerate()
        .filter_map(|(index, (step, (after, others)))| {
            let [nominal, before] = others.as_slice() else { return None };
            Some(PointGap {
                speed_rpm: after.speed_rpm,
                valve: step.marker.valve_opening_ratio,
                eta_nominal: nominal.efficiency,
                eta_before: before.efficiency,
                eta_after: after.efficiency,
                eta_residual: after.efficiency * rise_residual_ratio(study, index, predicted).unwrap_or(0.0),
                h_nominal_w_m2k: nominal.h_w_m2k,
                h_before_w_m2k: before.h_w_m2k,
                h_after_w_m2k: after.h_w_m2k,
            })
        })
        .collect()
}
