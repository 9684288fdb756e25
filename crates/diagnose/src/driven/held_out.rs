//! Phases of a log, and the gap reduction on held-out data: phase by phase, and after the fitted part.

use crate::driven::fit::{Columns, SideFit, SideProblem};
use crate::driven::search::weight;
use crate::driven::side::{Rows, SideModel};
use crate::driven::side_diagnosis::{Beyond, HeldOut, Phase};
use crate::gap::best_fit::coordinate::{coordinates, hypothesis_at, unknowns};
use crate::gap::causes::additions::Calibration;
use crate::gap::causes::probabilities::ids;
use mapper_core::Channel;
use mapper_inference::mixture::DRAWS;
use mapper_numerics::parallel;
use mapper_numerics::statistics::{
    MIN_VALUES, SHARE_025, SHARE_975, mean, quantile, rms, standard_deviation, student_quantile,
};
use nalgebra::DVector;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use std::ops::Range;

pub(crate) fn residual_rms_k<S: SideModel>(
    problem: &SideProblem<'_, S>,
    predicted: &Columns,
    rows: Range<usize>,
) -> f64 {
    let read = &problem.side.rows().judged[0].1;
    rms(rows.map(|i| read[i] - predicted[0][i])).unwrap_or(f64::NAN)
}

/// Predicts each phase from fits to the other phases: without a cause, and with the cause that they select. `causes` is empty if none is named.
pub(crate) fn held_out<S: SideModel>(
    problem: &SideProblem<'_, S>,
    phases: &[Range<usize>],
    null: &SideFit,
    causes: &[&SideFit],
    calibration: &Calibration,
    effects: usize,
) -> Option<HeldOut> {
    let last = phases.last()?.end;
    let rows = problem.side.rows();
    let jobs: Vec<(usize, Option<usize>)> = (0..phases.len())
        .flat_map(|phase| {
            std::iter::once((phase, None)).chain((0..causes.len()).map(move |c| (phase, Some(c))))
        })
        .collect();
    let fitted = parallel::map(&jobs, |(phase, cause)| {
        let counts: Vec<bool> = (0..rows.len()).map(|i| i < last && !phases[*phase].contains(&i)).collect();
        let start = cause.map_or(null, |cause| causes[cause]);
        problem.fit(&start.hypothesis, &counts)
    });
    let mut found = Vec::with_capacity(phases.len());
    for (place, phase) in phases.iter().enumerate() {
        let of_phase = || jobs.iter().zip(&fitted).filter(|((at, _), _)| *at == place);
        let bare = of_phase().find(|((_, cause), _)| cause.is_none()).and_then(|(_, fit)| fit.as_ref())?;
        let chosen = of_phase()
            .filter(|((_, cause), _)| cause.is_some())
            .filter_map(|(_, fit)| fit.as_ref())
            .max_by(|a, b| weight(calibration, effects, a).total_cmp(&weight(calibration, effects, b)));
        let speed_rpm = rows.drive(Channel::ShaftSpeed);
        found.push(Phase {
            from_s: rows.t_s[phase.start],
            until_s: rows.t_s[phase.end - 1],
            from_rpm: speed_rpm[phase.start],
            until_rpm: speed_rpm[phase.end - 1],
            before_k: residual_rms_k(problem, &bare.predicted, phase.clone()),
            after_k: residual_rms_k(problem, &chosen.unwrap_or(bare).predicted, phase.clone()),
            chosen: chosen.map_or_else(Vec::new, |fit| ids(problem.effects, &fit.hypothesis)),
        });
    }
    let whole = |of: &dyn Fn(&Phase) -> f64| {
        let squares = found.iter().zip(phases).map(|(phase, rows)| of(phase).powi(2) * rows.len() as f64);
        (squares.sum::<f64>() / phases.iter().map(|rows| rows.len() as f64).sum::<f64>()).sqrt()
    };
    let reductions: Vec<f64> = found.iter().map(|phase| phase.before_k - phase.after_k).collect();
    let gap_reduction_k = mean(&reductions)?;
    let samples = reductions.len() as f64;
    let half_k = student_quantile(SHARE_975, samples - 1.0).unwrap_or(f64::INFINITY)
        * standard_deviation(&reductions).unwrap_or(f64::INFINITY)
        / samples.sqrt();
    Some(HeldOut {
        before_k: whole(&|phase| phase.before_k),
        after_k: whole(&|phase| phase.after_k),
        gap_reduction_k,
        gap_reduction_low_k: gap_reduction_k - half_k,
        gap_reduction_high_k: gap_reduction_k + half_k,
        phases: found,
    })
}

pub(crate) fn beyond<S: SideModel>(
    problem: &SideProblem<'_, S>,
    fitted: usize,
    before: &SideFit,
    after: &SideFit,
    seed: u64,
) -> Option<Beyond> {
    let rows = problem.side.rows();
    let later = fitted..rows.len();
    if later.is_empty() {
        return None;
    }
    let drawn = draws(problem, after, seed);
    let predicted = &after.predicted[0];
    let expected: Vec<f64> =
        drawn.iter().filter_map(|draw| rms(later.clone().map(|i| draw[i] - predicted[i]))).collect();
    let at = |share: f64| quantile(&expected, share).unwrap_or(f64::NAN);
    let is_inside = |i: &usize| {
        let end = |share: f64| quantile(drawn.iter().map(|draw| draw[*i]), share).unwrap_or(f64::NAN);
        (end(SHARE_025)..=end(SHARE_975)).contains(&rows.judged[0].1[*i])
    };
    Some(Beyond {
        from_s: rows.t_s[later.start],
        until_s: rows.t_s[later.end - 1],
        rows: later.len(),
        before_k: residual_rms_k(problem, &before.predicted, later.clone()),
        after_k: residual_rms_k(problem, &after.predicted, later.clone()),
        expected_k: at(0.5),
        expected_low_k: at(SHARE_025),
        expected_high_k: at(SHARE_975),
        inside_ratio: later.clone().filter(is_inside).count() as f64 / later.len() as f64,
    })
}

/// Simulated readings of the first judged channel for posterior draws of a fit, each with noise of its own.
fn draws<S: SideModel>(problem: &SideProblem<'_, S>, fit: &SideFit, seed: u64) -> Vec<Vec<f64>> {
    let Some(cholesky) = fit.precision.clone().cholesky() else { return Vec::new() };
    let coordinates = coordinates(problem.effects, &fit.hypothesis);
    let mode = unknowns(&fit.hypothesis, &coordinates);
    let (t_s, correlation_s) = (&problem.side.rows().t_s, S::MODEL_ERRORS[0].correlation_s);
    let numbers: Vec<u64> = (0..DRAWS as u64).collect();
    let drawn = parallel::map(&numbers, |number| {
        let mut random = Pcg64Mcg::seed_from_u64(seed.wrapping_mul(DRAWS as u64).wrapping_add(*number));
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let unit = DVector::from_fn(fit.precision.nrows(), |_, _| normal());
        // With precision L L', L'^-1 times unit noise has the inverse precision as its covariance.
        let off = cholesky.l().transpose().solve_upper_triangular(&unit)?;
        let there = hypothesis_at(&fit.hypothesis, &coordinates, &(&mode + off));
        let mut readings_k = problem.predict(&there)?.swap_remove(0);
        let mut model_error =
            CorrelatedNoise { sigma: fit.model_error_sigma_k[0], correlation_s, last: None };
        for (reading_k, t_s) in readings_k.iter_mut().zip(t_s) {
            *reading_k += model_error.next(*t_s, normal()) + problem.white_k[0] * normal();
        }
        Some(readings_k)
    });
    drawn.into_iter().flatten().collect()
}

/// First-order noise along the rows of a log.
struct CorrelatedNoise {
    sigma: f64,
    correlation_s: f64,
    /// Time, s, and value of the previous row.
    last: Option<(f64, f64)>,
}

impl CorrelatedNoise {
    /// The noise at the next row, from a standard normal number.
    fn next(&mut self, t_s: f64, z: f64) -> f64 {
        let (keep, before) =
            self.last.map_or((0.0, 0.0), |(at_s, noise)| ((-(t_s - at_s) / self.correlation_s).exp(), noise));
        let noise = keep * before + self.sigma * (1.0 - keep * keep).sqrt() * z;
        self.last = Some((t_s, noise));
        noise
    }
}

/// Two neighbours are merged if one line for both increases the misfit by less than this share of the total variation. Bound: noise and curvature of one phase.
const MERGE_RATIO: f64 = 0.01;
/// Minimum and maximum number of phases. Bound: effort, and enough for a spread; each is predicted by fits to the others.
const PHASES: (usize, usize) = (3, 8);
/// Minimum of a drive for its logarithm, in its unit. Bound: avoids the logarithm of zero.
const MIN_DRIVE: f64 = 1e-9;
/// Minimum variance of the logarithm of a drive that has phases. Bound: a variation of one per cent.
const MIN_VARIANCE: f64 = 1e-4;

/// Phases of the first `count` rows, in order; empty if there are too few rows for two.
pub(crate) fn phases(rows: &Rows, count: usize, drives: &[Channel]) -> Vec<Range<usize>> {
    let count = count.min(rows.len());
    let sums: Vec<Sums> =
        drives.iter().map(|channel| Sums::new(&rows.t_s[..count], rows.drive(*channel))).collect();
    let cost = |range: &Range<usize>| sums.iter().map(|sums| sums.line_misfit(range)).sum::<f64>();
    let mut phases: Vec<Range<usize>> = Vec::new();
    let mut from = 0;
    for i in 0..count {
        if i - from >= MIN_VALUES {
            phases.push(from..i);
            from = i;
        }
    }
    match phases.last_mut() {
        Some(last) => last.end = count,
        None => return Vec::new(),
    }
    loop {
        let added_cost = |i: usize| {
            let both = phases[i].start..phases[i + 1].end;
            cost(&both) - cost(&phases[i]) - cost(&phases[i + 1])
        };
        let next =
            (0..phases.len().saturating_sub(1)).min_by(|a, b| added_cost(*a).total_cmp(&added_cost(*b)));
        let Some(next) = next.filter(|_| phases.len() > PHASES.0) else { break };
        if phases.len() <= PHASES.1 && added_cost(next) > MERGE_RATIO * drives.len() as f64 {
            break;
        }
        let after = phases.remove(next + 1);
        phases[next].end = after.end;
    }
    if phases.len() < 2 { Vec::new() } else { phases }
}

/// Cumulative sums that give the misfit of a straight line over any range. Values are scaled by their spread.
struct Sums {
    /// Sums of 1, t, v, t t, t v, v v before each row.
    before: Vec<[f64; 6]>,
}

impl Sums {
    fn new(t_s: &[f64], values: &[f64]) -> Self {
        let logarithms: Vec<f64> =
            values.iter().take(t_s.len()).map(|value| value.max(MIN_DRIVE).ln()).collect();
        let count = logarithms.len().max(1) as f64;
        let mean = logarithms.iter().sum::<f64>() / count;
        // A nearly constant drive has no phases.
        let whole = logarithms.iter().map(|v| (v - mean).powi(2)).sum::<f64>().max(MIN_VARIANCE * count);
        let first_s = t_s.first().copied().unwrap_or(0.0);
        let mut sums = [0.0; 6];
        let mut before = vec![sums];
        for (t_s, v) in t_s.iter().zip(&logarithms) {
            let (t, v) = (t_s - first_s, (v - mean) / whole.sqrt());
            for (sum, term) in sums.iter_mut().zip([1.0, t, v, t * t, t * v, v * v]) {
                *sum += term;
            }
            before.push(sums);
        }
        Sums { before }
    }

    fn line_misfit(&self, range: &Range<usize>) -> f64 {
        let [n, t, v, tt, tv, vv] =
            std::array::from_fn(|i| self.before[range.end][i] - self.before[range.start][i]);
        if n < 2.0 {
            return 0.0;
        }
        let (tt, tv, vv) = (tt - t * t / n, tv - t * v / n, vv - v * v / n);
        (vv - if tt > 0.0 { tv * tv / tt } else { 0.0 }).max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_acceleration_and_a_brake_are_phases_of_their_own() {
        let t_s: Vec<f64> = (0..180).map(|i| 0.1 * f64::from(i)).collect();
        let speed = |t: f64| match t {
            t if t < 6.0 => 50e3,
            t if t < 8.0 => 50e3 + 45e3 * (t - 6.0),
            t if t < 13.0 => 140e3,
            _ => 90e3,
        };
        let speeds = t_s.iter().map(|t| speed(*t)).collect();
        let rows = Rows {
            drives: vec![(Channel::ShaftSpeed, speeds)],
            rates: Vec::new(),
            judged: Vec::new(),
            lost: 0,
            t_s: t_s.clone(),
        };
        let found = phases(&rows, rows.len(), &[Channel::ShaftSpeed]);
        for begins_s in [6.0, 8.0, 13.0] {
            let nearest =
                found.iter().map(|phase| (t_s[phase.start] - begins_s).abs()).fold(f64::MAX, f64::min);
            assert!(nearest < 0.8, "{begins_s} s: {found:?}");
        }
        assert_eq!((found.first().unwrap().start, found.last().unwrap().end), (0, rows.len()));
        assert!((3..=6).contains(&found.len()), "{found:?}");
        assert!(phases(&rows, 10, &[Channel::ShaftSpeed]).is_empty());
    }
}
