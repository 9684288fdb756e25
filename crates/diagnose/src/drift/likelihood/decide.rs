//! Selects the most probable set of causes and time histories, in addition to constants.

use crate::drift::causes::cause::Cause;
use crate::drift::likelihood::candidates::Candidates;
use crate::drift::likelihood::low_rank::LowRank;
use crate::drift::likelihood::residuals::{inflate, leave_out};
use crate::drift::report::{Alternative, DetectionLimit};
use crate::drift::runs::request::{DriftError, Unsolvable};
use crate::drift::sensitivity::readings::Readings;
use mapper_inference::hypotheses::Member;
use mapper_inference::posterior::shares;
use mapper_inference::time_history::{Shape, TimeHistory};
use nalgebra::DMatrix;

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
        let change = rate_per_h * (end_s - start_s) / 3600.0;
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
