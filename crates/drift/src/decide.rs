//! Which cause, with which course: every one is tried against what is constant, and chance is simulated.

use crate::candidates::{Candidate, Weighed, courses, evidence, mean_of, weigh};
use crate::cause::Cause;
use crate::course::CourseKind;
use crate::fit::{Fit, fit};
use crate::leftovers::{inflate, leave_out};
use crate::low_rank::LowRank;
use crate::readings::Readings;
use crate::report::{Alternative, DetectionLimit};
use crate::request::{DriftError, Unsolvable};
use nalgebra::DMatrix;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

/// Onsets that are tried over a campaign.
const ONSETS: usize = 36;
/// Drift-free campaigns that set the threshold.
const NULL_CAMPAIGNS: usize = 300;
/// Share of drift-free campaigns that may be flagged.
const FALSE_ALARMS: f64 = 0.01;
/// Prior of sensors that seldom drift against those that do.
const SELDOM: f64 = 0.25;
/// A cause less probable than this is not called by its name alone.
const CLEAR: f64 = 0.5;

/// What is found.
pub(crate) struct Decision {
    /// Whether chance is exceeded.
    pub flagged: bool,
    /// Whether the cause stands out from the others.
    pub clear: bool,
    /// Best cause.
    pub cause: Cause,
    pub evidence: f64,
    pub threshold: f64,
    /// No drift and all causes, most probable first.
    pub probabilities: Vec<Alternative>,
    pub limits: Vec<DetectionLimit>,
    /// Stretches that the model cannot follow, and all.
    pub left_out: (usize, usize),
    /// Covariance of each stretch as found, constants apart.
    pub own: Vec<DMatrix<f64>>,
}

pub(crate) fn decide(
    readings: &Readings,
    mut own: Vec<DMatrix<f64>>,
    columns: &DMatrix<f64>,
    seed: u64,
) -> Result<(Decision, Fit), DriftError> {
    let causes: Vec<(Cause, Vec<f64>)> = Cause::ALL
        .into_iter()
        .filter_map(|cause| Some((cause, readings.signature(cause)?.readings)))
        .filter(|(_, readings)| readings.iter().any(|value| *value != 0.0))
        .collect();
    let (start_s, end_s) = readings.span_s();
    let candidates: Vec<Candidate> = (0..causes.len())
        .flat_map(|cause| {
            courses(start_s, end_s, ONSETS).into_iter().map(move |course| Candidate { cause, course })
        })
        .collect();
    let shown = DMatrix::from_fn(readings.difference.len(), candidates.len(), |row, column| {
        let Candidate { cause, course } = &candidates[column];
        causes[*cause].1[row] * mean_of(readings, row, *course)
    });
    let difference = DMatrix::from_column_slice(readings.difference.len(), 1, &readings.difference);

    let left_out = leave_out(&mut own, readings, columns, &difference, &shown)?;
    // Twice: the noise that the best explanation leaves says how much more there is than declared.
    let mut noise = LowRank::new(&own, columns)?;
    inflate(&mut own, readings, &noise, &difference, &shown);
    noise = LowRank::new(&own, columns)?;

    let whitened = noise.whiten(difference);
    let whitened_shown = noise.whiten(shown);
    let inverse_shown = noise.inverse_times(&whitened_shown);
    let weighed = weigh(&causes, &candidates, &whitened, &whitened_shown, &inverse_shown);
    let threshold = threshold(&causes, &candidates, &noise, &whitened_shown, &inverse_shown, seed);

    let probabilities = probabilities(&causes, &candidates, &weighed, end_s - start_s);
    let best = (0..candidates.len())
        .max_by(|a, b| weighed.evidence[*a].total_cmp(&weighed.evidence[*b]))
        .ok_or(Unsolvable::NothingShows)?;
    let evidence = weighed.evidence[best];
    let flagged = evidence > threshold;
    // Among causes, the most probable one: it need not be that of the single best course.
    let top = probabilities
        .iter()
        .find_map(|alternative| alternative.cause)
        .unwrap_or(causes[candidates[best].cause].0);
    let top_probability =
        probabilities.iter().find(|other| other.cause == Some(top)).map_or(0.0, |other| other.probability);
    let of_top = |index: &usize| causes[candidates[*index].cause].0 == top;
    let best_of_top = (0..candidates.len())
        .filter(of_top)
        .max_by(|a, b| weighed.evidence[*a].total_cmp(&weighed.evidence[*b]))
        .unwrap_or(best);
    let kind = candidates[best_of_top].course.kind;
    let limits = limits(&causes, &candidates, &weighed, threshold, start_s, end_s);
    let fit = fit(readings, noise, top, kind)?;
    let decision = Decision {
        flagged,
        clear: top_probability >= CLEAR,
        cause: top,
        evidence,
        threshold,
        probabilities,
        limits,
        left_out: (left_out, readings.blocks.len()),
        own,
    };
    Ok((decision, fit))
}

/// What one drift-free campaign in a hundred reaches: campaigns of noise and constants alone, a Gumbel distribution
/// through the best evidence of each.
fn threshold(
    causes: &[(Cause, Vec<f64>)],
    candidates: &[Candidate],
    noise: &LowRank,
    shown: &DMatrix<f64>,
    inverse: &DMatrix<f64>,
    seed: u64,
) -> f64 {
    let mut rng = Pcg64::seed_from_u64(seed);
    let mut draw = |rows: usize| {
        DMatrix::from_fn(rows, NULL_CAMPAIGNS, |_, _| -> f64 { StandardNormal.sample(&mut rng) })
    };
    let readings = draw(inverse.nrows()) + noise.shown(&draw(noise.constants_count()));
    let along = inverse.tr_mul(&readings);
    let information: Vec<f64> =
        (0..candidates.len()).map(|index| shown.column(index).dot(&inverse.column(index))).collect();
    let best: Vec<f64> = along
        .column_iter()
        .map(|campaign| {
            candidates
                .iter()
                .enumerate()
                .map(|(index, candidate)| {
                    evidence(causes[candidate.cause].0, campaign[index], information[index]).0
                })
                .fold(0.0, f64::max)
        })
        .collect();
    let count = best.len() as f64;
    let mean = best.iter().sum::<f64>() / count;
    let variance = best.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    // Gumbel: standard deviation pi/sqrt(6) beta, mean mu + 0.5772 beta, quantile mu - beta ln(-ln q).
    let beta = variance.sqrt() * 6.0_f64.sqrt() / std::f64::consts::PI;
    const EULER: f64 = 0.577_215_664_901_532_9;
    mean - EULER * beta - beta * (-(1.0 - FALSE_ALARMS).ln()).ln()
}

/// Bayes factors over onset and course, with a prior of the size: most probable first.
fn probabilities(
    causes: &[(Cause, Vec<f64>)],
    candidates: &[Candidate],
    weighed: &Weighed,
    length_s: f64,
) -> Vec<Alternative> {
    let log_factor = |index: usize| {
        let Candidate { cause, course } = &candidates[index];
        let usual = match course.kind {
            CourseKind::Ramp => causes[*cause].0.usual_size() * 3600.0 / length_s,
            CourseKind::Step => causes[*cause].0.usual_size(),
        };
        let spread = (usual / weighed.sigma[index]).powi(2);
        0.5 * weighed.evidence[index] * spread / (1.0 + spread) - 0.5 * (1.0 + spread).ln()
    };
    let mut logs: Vec<(Option<Cause>, f64)> = vec![(None, 0.0)];
    for (position, (cause, _)) in causes.iter().enumerate() {
        let own: Vec<f64> = (0..candidates.len())
            .filter(|index| candidates[*index].cause == position)
            .map(log_factor)
            .collect();
        let largest = own.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mean = own.iter().map(|log| (log - largest).exp()).sum::<f64>() / own.len().max(1) as f64;
        let usual = Cause::ALL.iter().take(8).any(|other| other == cause);
        let prior: f64 = if usual { 1.0 } else { SELDOM };
        logs.push((Some(*cause), largest + mean.ln() + (prior / Cause::ALL.len() as f64).ln()));
    }
    let largest = logs.iter().map(|(_, log)| *log).fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = logs.iter().map(|(_, log)| (log - largest).exp()).sum();
    let mut probabilities: Vec<Alternative> = logs
        .into_iter()
        .map(|(cause, log)| Alternative { cause, probability: (log - largest).exp() / sum })
        .collect();
    probabilities.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    probabilities
}

/// Steady drift over the whole campaign whose expected evidence meets the threshold.
fn limits(
    causes: &[(Cause, Vec<f64>)],
    candidates: &[Candidate],
    weighed: &Weighed,
    threshold: f64,
    start_s: f64,
    end_s: f64,
) -> Vec<DetectionLimit> {
    candidates
        .iter()
        .enumerate()
        .filter(|(_, candidate)| {
            candidate.course.kind == CourseKind::Ramp && candidate.course.onset_s <= start_s
        })
        .map(|(index, candidate)| DetectionLimit {
            cause: causes[candidate.cause].0,
            change: threshold.max(0.0).sqrt() * weighed.sigma[index] * (end_s - start_s) / 3600.0,
            unit: causes[candidate.cause].0.unit(),
        })
        .collect()
}
