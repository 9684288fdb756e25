//! The gap before and after a cause, on steps that were not used to fit it.

use crate::gap::best_fit::fit::{Effort, Fit, MAX_SIGMAS, Start, fit, misfit_of_steps, with_start_read};
use crate::gap::best_fit::normal::{Selection, dot_over};
use crate::gap::report::{BeyondPrior, ChannelGap, Gap, PointGap};
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::{Hypothesis, Study};
use crate::gap::residuals::whiten::{Linearised, rows_of_step};
use mapper_core::Channel;
use mapper_numerics::parallel;
use mapper_numerics::statistics::{DOUBT_SIGMAS, share_interval_95};
use mapper_physics::simulation::steady::Inputs;
use std::collections::BTreeMap;
use std::ops::Range;

/// Share of the limit of a tolerance at which it counts as limited. Bound: rounding.
const LIMITED_SHARE: f64 = 0.999;
/// Difference between two openings that count as one. Bound: rounding; no valve repeats a millionth.
const SAME_OPENING: f64 = 1e-6;

/// Effort of a fit whose tolerances have no limit. Bound: no tolerance reaches a thousand sigmas.
const UNLIMITED: Effort =
    Effort { iterations: 8, enough: 0.5, max_sigmas: 1e3, max_sigmas_of_rig: 1e3, exact: true };

/// Tolerances beyond three sigmas of their prior, furthest first; one at [`MAX_SIGMAS`] is fitted again without that limit.
pub(crate) fn beyond_prior(study: &Study, linearised: &Linearised, fitted: &Fit) -> Vec<BeyondPrior> {
    let limited = fitted.hypothesis.nuisances.iter().any(|sigmas| sigmas.abs() > LIMITED_SHARE * MAX_SIGMAS);
    let freed =
        limited.then(|| fit(study, linearised, fitted, &Selection::all(study), UNLIMITED).ok()).flatten();
    let nuisances = &freed.as_ref().unwrap_or(fitted).hypothesis.nuisances;
    let mut beyond: Vec<BeyondPrior> = study
        .nuisances
        .iter()
        .zip(nuisances)
        .filter(|(nuisance, sigmas)| sigmas.abs() > DOUBT_SIGMAS && nuisance.kind.is_of_rig())
        .map(|(nuisance, sigmas)| BeyondPrior {
            what: nuisance.kind.to_string(),
            sigmas: sigmas.abs(),
            value: nuisance.value(*sigmas),
        })
        .collect();
    beyond.sort_by(|a, b| b.sigmas.total_cmp(&a.sigmas));
    beyond
}

/// Number of folds. Bound: effort; two would leave half of the steps out of each fit.
pub(crate) const FOLDS: usize = 3;

/// Groups of steps, each to be predicted by a fit to the others.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Folds {
    /// Step indices of each fold, ascending; a single fold means no hold-out.
    pub steps: Vec<Vec<usize>>,
}

impl Folds {
    /// The folds of a recording, each with every opening and speed range as far as the steps suffice; empty with too few steps.
    pub(crate) fn of(study: &Study) -> Folds {
        let places = study.steps.iter().map(|step| (step.marker.valve_opening_ratio, step.marker.p3_pa));
        Folds::latin_square(&places.collect::<Vec<_>>())
    }

    /// Assigns steps to folds along each opening in order of pressure (and so speed), from a different fold at each opening.
    fn latin_square(places: &[(f64, f64)]) -> Folds {
        if places.len() < 2 * FOLDS {
            return Folds { steps: vec![(0..places.len()).collect()] };
        }
        let mut openings: Vec<f64> = places.iter().map(|(opening, _)| *opening).collect();
        openings.sort_by(f64::total_cmp);
        openings.dedup_by(|a, b| (*a - *b).abs() < SAME_OPENING);
        let mut steps = vec![Vec::new(); FOLDS];
        // A single step at an opening continues the order of the previous opening.
        let mut assigned = 0;
        for (row, opening) in openings.iter().enumerate() {
            let mut here: Vec<usize> =
                (0..places.len()).filter(|i| (places[*i].0 - opening).abs() < SAME_OPENING).collect();
            here.sort_by(|a, b| places[*a].1.total_cmp(&places[*b].1).then(a.cmp(b)));
            let first = if here.len() < FOLDS { assigned } else { row };
            for (rank, step) in here.iter().enumerate() {
                steps[(first + rank) % FOLDS].push(*step);
            }
            assigned += here.len();
        }
        for fold in &mut steps {
            fold.sort_unstable();
        }
        Folds { steps }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct GapReduction {
    pub(crate) removed: f64,
    /// 95 % interval of this share for similar steps.
    pub(crate) interval: (f64, f64),
    pub(crate) steps: usize,
    /// Index of the step with most of the gap and its share; `None` if no step has a gap.
    pub(crate) largest: Option<(usize, f64)>,
}

/// Misfit `(|r|^2 - n)/n` of one step before and after, and its number of values.
#[derive(Debug, Clone, Copy)]
pub(crate) struct StepMisfit {
    pub(crate) before: f64,
    pub(crate) after: f64,
    pub(crate) values: usize,
}

impl StepMisfit {
    fn has_gap(&self) -> bool {
        // For noise, |r|^2 has mean n and variance 2 n.
        self.before > DOUBT_SIGMAS * (2.0 / self.values.max(1) as f64).sqrt()
    }

    /// Share of its own gap removed, 0..1.
    fn removed(&self) -> f64 {
        (1.0 - self.after.max(0.0) / self.before).clamp(0.0, 1.0)
    }
}

/// Every step with a gap is one trial, whatever its size. The interval is Clopper and Pearson's for the mean share removed, widened to
/// include the share of the whole gap, which is weighted by size: one step, which is named, may dominate it.
pub(crate) fn gap_reduction(steps: &[StepMisfit]) -> GapReduction {
    let positive = |g: f64| g.max(0.0);
    let total: f64 = steps.iter().map(|step| positive(step.before)).sum();
    let remaining: f64 = steps.iter().map(|step| positive(step.after)).sum();
    let removed = if total > 0.0 { 1.0 - remaining / total } else { 0.0 };
    let shares: Vec<f64> = steps.iter().filter(|step| step.has_gap()).map(StepMisfit::removed).collect();
    let (low, high) = share_interval_95(shares.iter().sum(), shares.len() as f64);
    let whole = removed.clamp(0.0, 1.0);
    let largest = steps
        .iter()
        .enumerate()
        .filter(|(_, step)| step.has_gap())
        .map(|(index, step)| (index, positive(step.before) / total))
        .max_by(|a, b| a.1.total_cmp(&b.1));
    GapReduction { removed, interval: (low.min(whole), high.max(whole)), steps: shares.len(), largest }
}

#[derive(Clone, Copy)]
pub(crate) struct Compared<'a> {
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
/// ([`beyond_prior`]), and its own reduction of the gap does not count. Bound: effort; a decrease of 0.2 is a tenth of what one more sigma of evidence costs.
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

/// Compares tolerances alone with the best cause on held-out steps; each fold selects among the first few causes and refits without its own.
pub(crate) fn held_out_gap(compared: Compared<'_>, folds: &Folds) -> Gap {
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

/// A channel is worse if its residual grows by this ratio, and by more than chance. Bound: a tenth of a residual is not seen on a plot.
const WORSE_RATIO: f64 = 1.1;

/// Rms of measured minus predicted block means per channel, in its unit: nominal, tolerances, cause; and the channels that get worse.
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

/// Efficiency and heat transfer at the end of each step: with cause and tolerances, with the tolerances alone, nominal. All at the same
/// speed, pressures and metal temperatures, so a shifted operating point is no change of efficiency.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Six speeds at three openings, shuffled: each fold has every speed once and every opening twice.
    #[test]
    fn every_fold_has_every_speed_and_every_opening() {
        let mut places = Vec::new();
        for opening in [0.5, 0.7, 1.0] {
            for speed in [90.0, 150.0, 50.0, 130.0, 70.0, 110.0] {
                places.push((opening, 1e3 * speed * (1.0 + 0.1 * opening)));
            }
        }
        let folds = Folds::latin_square(&places).steps;
        assert_eq!(folds.iter().map(Vec::len).collect::<Vec<_>>(), [6, 6, 6]);
        for fold in &folds {
            for opening in [0.5, 0.7, 1.0] {
                assert_eq!(fold.iter().filter(|i| places[**i].0 == opening).count(), 2);
            }
            let mut speeds: Vec<usize> = fold.iter().map(|i| i % 6).collect();
            speeds.sort_unstable();
            assert_eq!(speeds, [0, 1, 2, 3, 4, 5]);
        }
        let mut all = folds.concat();
        all.sort_unstable();
        assert_eq!(all, (0..18).collect::<Vec<_>>());
        // One step per opening still gives three folds of two.
        let single: Vec<(f64, f64)> = (0..6).map(|i| (0.5 + 0.1 * f64::from(i), 1e5)).collect();
        assert!(Folds::latin_square(&single).steps.iter().all(|fold| fold.len() == 2));
    }

    fn step(before: f64, after: f64) -> StepMisfit {
        StepMisfit { before, after, values: 800 }
    }

    /// Clopper and Pearson (1934): 18 of 18 gives more than 0.025^(1/18) = 81.5 %, even if one of the 18 has most of the gap; 1 of 1 gives
    /// only more than 2.5 %.
    #[test]
    fn one_large_step_does_not_silence_the_others() {
        let mut steps = vec![step(2.0, 0.0); 18];
        let even = gap_reduction(&steps);
        steps[4] = step(1000.0, 0.0);
        let uneven = gap_reduction(&steps);
        for found in [even, uneven] {
            assert_eq!((found.removed, found.steps), (1.0, 18));
            assert!((found.interval.0 - 0.025f64.powf(1.0 / 18.0)).abs() < SAME_OPENING, "{found:?}");
        }
        assert!(uneven.largest.is_some_and(|(index, share)| index == 4 && share > 0.96));
        // Steps without a gap carry no information.
        let mut alone = vec![step(0.0, 0.0); 17];
        alone.push(step(50.0, 0.0));
        let alone = gap_reduction(&alone);
        assert_eq!((alone.steps, alone.largest), (1, Some((17, 1.0))));
        assert!((alone.interval.0 - 0.025).abs() < SAME_OPENING, "{alone:?}");
    }

    /// The step with most of the gap keeps it: the total share then lies outside the other steps' interval, and the interval includes both.
    #[test]
    fn the_interval_holds_the_share_of_the_whole() {
        let mut steps = vec![step(2.0, 0.0); 17];
        steps.push(step(500.0, 500.0));
        let found = gap_reduction(&steps);
        assert!(found.removed < 0.1 && found.interval.0 <= found.removed, "{found:?}");
        assert_eq!(gap_reduction(&[]).steps, 0);
    }
}
