//! Gap reduction on held-out data: phase by phase, and after the fitted part.

use crate::driven::cause_search::fit::{Fit, Question};
use crate::driven::cause_search::search::weight;
use crate::driven::cause_search::side_diagnosis::{Beyond, HeldOut, Phase};
use crate::driven::cause_search::sides::side::Side;
use crate::gap::best_fit::coordinate::{coordinates, parameters, set_parameter};
use crate::gap::causes::calibration::Calibration;
use crate::gap::residuals::study::Hypothesis;
use mapper_core::Channel;
use mapper_numerics::parallel;
use mapper_numerics::statistics::{mean, quantile, rms, standard_deviation, student_quantile};
use nalgebra::DVector;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64Mcg;
use std::ops::Range;

/// Number of posterior draws.
const DRAWS: usize = 300;

/// Root mean square of the first judged channel minus its prediction, K.
pub(crate) fn off_k<S: Side>(question: &Question<'_, S>, predicted: &[Vec<f64>], rows: Range<usize>) -> f64 {
    let read = &question.side.rows().judged[0].1;
    rms(rows.map(|i| read[i] - predicted[0][i])).unwrap_or(f64::NAN)
}

/// Predicts each phase from fits to the others: without a cause, and with the one of `causes` that they select. `causes` is empty if none
/// is named.
pub(crate) fn held_out<S: Side>(
    question: &Question<'_, S>,
    phases: &[Range<usize>],
    null: &Fit,
    causes: &[&Fit],
    calibration: &Calibration,
    asked: usize,
) -> Option<HeldOut> {
    let last = phases.last()?.end;
    let rows = question.side.rows();
    let jobs: Vec<(usize, Option<usize>)> = (0..phases.len())
        .flat_map(|phase| {
            std::iter::once((phase, None)).chain((0..causes.len()).map(move |c| (phase, Some(c))))
        })
        .collect();
    let fitted = parallel::map(&jobs, |(phase, cause)| {
        let counts: Vec<bool> = (0..rows.len()).map(|i| i < last && !phases[*phase].contains(&i)).collect();
        let start = cause.map_or(null, |cause| causes[cause]);
        question.fit(&start.hypothesis, &counts)
    });
    let mut found = Vec::with_capacity(phases.len());
    for (place, phase) in phases.iter().enumerate() {
        let of_phase = || jobs.iter().zip(&fitted).filter(|((at, _), _)| *at == place);
        let bare = of_phase().find(|((_, cause), _)| cause.is_none()).and_then(|(_, fit)| fit.as_ref())?;
        let chosen = of_phase()
            .filter(|((_, cause), _)| cause.is_some())
            .filter_map(|(_, fit)| fit.as_ref())
            .max_by(|a, b| weight(calibration, asked, a).total_cmp(&weight(calibration, asked, b)));
        let speed_rpm = rows.drive(Channel::ShaftSpeed);
        found.push(Phase {
            from_s: rows.t_s[phase.start],
            until_s: rows.t_s[phase.end - 1],
            from_rpm: speed_rpm[phase.start],
            until_rpm: speed_rpm[phase.end - 1],
            before_k: off_k(question, &bare.predicted, phase.clone()),
            after_k: off_k(question, &chosen.unwrap_or(bare).predicted, phase.clone()),
            chosen: chosen.map_or_else(Vec::new, |fit| ids(question, &fit.hypothesis)),
        });
    }
    let whole = |of: &dyn Fn(&Phase) -> f64| {
        let squares = found.iter().zip(phases).map(|(phase, rows)| of(phase).powi(2) * rows.len() as f64);
        (squares.sum::<f64>() / phases.iter().map(|rows| rows.len() as f64).sum::<f64>()).sqrt()
    };
    let taken: Vec<f64> = found.iter().map(|phase| phase.before_k - phase.after_k).collect();
    let shrink_k = mean(&taken)?;
    let samples = taken.len() as f64;
    let half_k = student_quantile(0.975, samples - 1.0).unwrap_or(f64::INFINITY)
        * standard_deviation(&taken).unwrap_or(f64::INFINITY)
        / samples.sqrt();
    Some(HeldOut {
        before_k: whole(&|phase| phase.before_k),
        after_k: whole(&|phase| phase.after_k),
        shrink_k,
        shrink_low_k: shrink_k - half_k,
        shrink_high_k: shrink_k + half_k,
        phases: found,
    })
}

/// Ids of a hypothesis' effects.
pub(crate) fn ids<S: Side>(question: &Question<'_, S>, hypothesis: &Hypothesis) -> Vec<String> {
    hypothesis.effects.iter().map(|(index, _)| question.effects[*index].info().id.to_string()).collect()
}

/// Compares the rows after the fitted part with the expectation of `after`.
pub(crate) fn beyond<S: Side>(
    question: &Question<'_, S>,
    fitted: usize,
    before: &Fit,
    after: &Fit,
    seed: u64,
) -> Option<Beyond> {
    let rows = question.side.rows();
    let behind = fitted..rows.len();
    if behind.is_empty() {
        return None;
    }
    let drawn = draws(question, after, seed);
    let predicted = &after.predicted[0];
    let off: Vec<f64> =
        drawn.iter().filter_map(|draw| rms(behind.clone().map(|i| draw[i] - predicted[i]))).collect();
    let at = |share: f64| quantile(&off, share).unwrap_or(f64::NAN);
    let holds = |i: &usize| {
        let end = |share: f64| quantile(drawn.iter().map(|draw| draw[*i]), share).unwrap_or(f64::NAN);
        (end(0.025)..=end(0.975)).contains(&rows.judged[0].1[*i])
    };
    Some(Beyond {
        from_s: rows.t_s[behind.start],
        until_s: rows.t_s[behind.end - 1],
        rows: behind.len(),
        before_k: off_k(question, &before.predicted, behind.clone()),
        after_k: off_k(question, &after.predicted, behind.clone()),
        expected_k: at(0.5),
        expected_low_k: at(0.025),
        expected_high_k: at(0.975),
        inside_ratio: behind.clone().filter(holds).count() as f64 / behind.len() as f64,
    })
}

/// Simulated readings of the first judged channel for posterior draws of a fit, each with its own noise.
fn draws<S: Side>(question: &Question<'_, S>, fit: &Fit, seed: u64) -> Vec<Vec<f64>> {
    let Some(cholesky) = fit.precision.clone().cholesky() else { return Vec::new() };
    let unknowns = fit.hypothesis.nuisances.len();
    let coordinates = coordinates(question.effects, &fit.hypothesis);
    let (t_s, alike_s) = (&question.side.rows().t_s, S::smooth()[0].alike_s);
    let numbers: Vec<u64> = (0..DRAWS as u64).collect();
    let drawn = parallel::map(&numbers, |number| {
        let mut random = Pcg64Mcg::seed_from_u64(seed.wrapping_mul(DRAWS as u64).wrapping_add(*number));
        let mut normal = || -> f64 { StandardNormal.sample(&mut random) };
        let unit = DVector::from_fn(fit.precision.nrows(), |_, _| normal());
        // With precision L L', L'^-1 times unit noise has the inverse precision as its covariance.
        let off = cholesky.l().transpose().solve_upper_triangular(&unit)?;
        let mut there = fit.hypothesis.clone();
        for (z, by) in there.nuisances.iter_mut().zip(off.iter()) {
            *z += by;
        }
        for (place, (coordinate, value)) in coordinates.iter().zip(parameters(&fit.hypothesis)).enumerate() {
            set_parameter(&mut there, place, coordinate.value(coordinate.of(value) + off[unknowns + place]));
        }
        let mut predicted = question.predict(&there)?.swap_remove(0);
        let (mut smooth_k, mut before_s): (f64, Option<f64>) = (0.0, None);
        for (reading_k, t_s) in predicted.iter_mut().zip(t_s) {
            let keep = before_s.map_or(0.0, |before_s| (-(t_s - before_s) / alike_s).exp());
            smooth_k = keep * smooth_k + fit.left_k[0] * (1.0 - keep * keep).sqrt() * normal();
            before_s = Some(*t_s);
            *reading_k += smooth_k + question.white_k[0] * normal();
        }
        Some(predicted)
    });
    drawn.into_iter().flatten().collect()
}
