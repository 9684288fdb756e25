//! Selects the most probable set of causes and time histories, in addition to constants.

use crate::drift::candidates::{Candidates, LowRank};
use crate::drift::causes::Cause;
use crate::drift::readings::Readings;
use crate::drift::report::{Alternative, DetectionLimit};
use crate::drift::runs::{DriftError, Unsolvable};
use mapper_core::unit_factors::S_PER_H;
use mapper_inference::hypotheses::Member;
use mapper_inference::posterior::shares;
use mapper_inference::time_history::{Shape, TimeHistory};
use mapper_numerics::least_squares::descent::ROUNDS;
use mapper_numerics::statistics::{EXCLUDE_SIGMAS, median};
use mapper_observe::perturbation::UNINFORMATIVE;
use nalgebra::{DMatrix, DVector};

/// A detected cause, before the fit of its size and onset.
#[derive(Debug, Clone)]
pub(crate) struct DetectedCause {
    pub cause: Cause,
    pub history: TimeHistory,
    /// Its probability relative to alternatives and to none in its place.
    pub probability: f64,
    /// The alternatives, most probable first.
    pub alternatives: Vec<Alternative>,
}

pub(crate) struct Decision {
    /// Empty if nothing drifts.
    pub detected: Vec<DetectedCause>,
    /// No drift and each single cause, most probable first.
    pub alone: Vec<Alternative>,
    pub limits: Vec<DetectionLimit>,
    /// Number of segments that the model cannot follow, and of all.
    pub left_out: (usize, usize),
    /// Estimated covariance of each segment, without constants.
    pub own: Vec<DMatrix<f64>>,
}

/// `own` is the declared covariance of each segment, `constants` the responses to the constants, a column each. Onsets near `known` drifts are
/// tried on a finer grid.
pub(crate) fn decide(
    readings: &Readings,
    mut own: Vec<DMatrix<f64>>,
    constants: &DMatrix<f64>,
    known: &[(Cause, TimeHistory)],
) -> Result<Decision, DriftError> {
    let candidates = Candidates::new(readings, known)?;
    let (left_out, noise, residual) = leave_out(&mut own, readings, constants, &candidates)?;
    // The residual of the best explanation shows how much noise exceeds its declaration.
    inflate(&mut own, readings, &noise, &residual);
    let noise = LowRank::new(&own, constants)?;

    let likelihood = candidates.likelihood(&noise, &readings.difference);
    let explanation = likelihood.explain(&candidates.priors).ok_or(Unsolvable::NotFinite)?;
    let alone =
        explanation.alone.iter().map(|(family, ln_odds)| (Some(candidates.causes[*family]), *ln_odds));
    let detected = explanation.members.iter().map(|member| detected(&candidates, member)).collect();
    let (start_s, end_s) = readings.span_s();
    let is_steady = |index: &usize| {
        let TimeHistory { onset, shape } = candidates.all[*index].history;
        matches!(shape, Shape::Ramp(_)) && onset <= start_s
    };
    let limit = |index: usize| {
        let rate_per_h = likelihood.smallest_seen(&candidates.priors, index)?;
        let cause = candidates.cause(index);
        let change = rate_per_h * (end_s - start_s) / S_PER_H;
        change.is_finite().then(|| DetectionLimit { cause, change, unit: cause.unit() })
    };
    Ok(Decision {
        detected,
        alone: probabilities(alone.chain([(None, 0.0)]).collect()),
        limits: (0..candidates.all.len()).filter(is_steady).filter_map(limit).collect(),
        left_out: (left_out, readings.segments.len()),
        own,
    })
}

fn detected(candidates: &Candidates, member: &Member) -> DetectedCause {
    let cause = candidates.cause(member.index);
    let others = member
        .alternatives
        .iter()
        .map(|(family, relative)| (Some(candidates.causes[*family]), relative.ln()));
    let all = probabilities(others.chain([(Some(cause), 0.0), (None, -member.ln_odds)]).collect());
    let (own, alternatives): (Vec<_>, Vec<_>) = all.into_iter().partition(|one| one.cause == Some(cause));
    DetectedCause {
        cause,
        history: candidates.all[member.index].history,
        probability: own.first().map_or(0.0, |own| own.probability),
        alternatives,
    }
}

/// Probabilities from ln of the odds, most probable first.
fn probabilities(ln_odds: Vec<(Option<Cause>, f64)>) -> Vec<Alternative> {
    let (causes, ln_odds): (Vec<_>, Vec<f64>) = ln_odds.into_iter().unzip();
    let each = causes.into_iter().zip(shares(&ln_odds, 1.0));
    let mut all: Vec<Alternative> =
        each.map(|(cause, probability)| Alternative { cause, probability }).collect();
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    all
}

/// Excludes segments that are outliers even for the best explanation: the model cannot follow the machine there (surge, a valve at its stop).
/// Returns their number, the noise without them, and the residual of the best explanation.
pub(crate) fn leave_out(
    own: &mut [DMatrix<f64>],
    readings: &Readings,
    constants: &DMatrix<f64>,
    candidates: &Candidates,
) -> Result<(usize, LowRank, DMatrix<f64>), Unsolvable> {
    let count = readings.columns.len();
    let mut out = vec![false; own.len()];
    let mut noise = LowRank::new(own, constants)?;
    let mut residual = unexplained(&noise, &readings.difference, candidates);
    for _ in 0..ROUNDS {
        let sizes: Vec<f64> = (0..own.len())
            .map(|segment| {
                residual.rows(segment * count, count).iter().map(|value| value * value).sum::<f64>()
                    / count as f64
            })
            .collect();
        let kept = (0..own.len()).filter(|segment| !out[*segment]).map(|segment| sizes[segment]);
        let usual = median(kept).unwrap_or(1.0).max(1.0);
        let far: Vec<usize> = (0..own.len())
            .filter(|segment| !out[*segment] && sizes[*segment] > EXCLUDE_SIGMAS * EXCLUDE_SIGMAS * usual)
            .collect();
        if far.is_empty() {
            break;
        }
        for segment in far {
            out[segment] = true;
            own[segment] *= UNINFORMATIVE * UNINFORMATIVE;
        }
        noise = LowRank::new(own, constants)?;
        residual = unexplained(&noise, &readings.difference, candidates);
    }
    Ok((out.iter().filter(|out| **out).count(), noise, residual))
}

/// Residual after constants and the most probable causes, whitened.
fn unexplained(noise: &LowRank, difference: &DMatrix<f64>, candidates: &Candidates) -> DMatrix<f64> {
    let explained = candidates.likelihood(noise, difference).explain(&candidates.priors).unwrap_or_default();
    let mut residual = difference.clone();
    for member in explained.members {
        residual -= candidates.columns.columns(member.index, 1) * member.value;
    }
    noise.inverse_times(&noise.whiten(residual))
}

/// Minimum share of the degrees of freedom that constants leave. Bound: with fewer, the residual does not show the noise.
const MIN_FREE_SHARE: f64 = 0.2;

/// Increases each channel's noise to match the residual of the best explanation, whitened by `noise`.
pub(crate) fn inflate(
    own: &mut [DMatrix<f64>],
    readings: &Readings,
    noise: &LowRank,
    residual: &DMatrix<f64>,
) {
    let count = readings.columns.len();
    let rows = residual.nrows() as f64;
    // Constants use up their share of the degrees of freedom.
    let free = (1.0 - noise.degrees_of_freedom() / rows).max(MIN_FREE_SHARE);
    let factors: Vec<f64> = (0..count)
        .map(|column| {
            let own: Vec<f64> =
                residual.iter().skip(column).step_by(count).map(|value| value * value).collect();
            (own.iter().sum::<f64>() / own.len().max(1) as f64 / free).max(1.0).sqrt()
        })
        .collect();
    let scale = DMatrix::from_diagonal(&DVector::from_vec(factors));
    for covariance in own {
        *covariance = &scale * &*covariance * &scale;
    }
}
