//! Selects the most probable set of causes and time histories, in addition to constants.

use crate::drift::causes::cause::Cause;
use crate::drift::causes::time_history::{Course, CourseKind};
use crate::drift::likelihood::candidates::{Candidates, ONSETS};
use crate::drift::likelihood::low_rank::LowRank;
use crate::drift::likelihood::residuals::{inflate, leave_out};
use crate::drift::report::{Alternative, DetectionLimit};
use crate::drift::runs::request::{DriftError, Unsolvable};
use crate::drift::sensitivity::readings::Readings;
use mapper_inference::hypotheses::Member;
use nalgebra::DMatrix;

/// A detected cause, before its time history is fitted closely.
#[derive(Debug, Clone)]
pub(crate) struct FoundDrifts {
    pub cause: Cause,
    pub course: Course,
    /// Its probability relative to alternatives and to none in its place.
    pub probability: f64,
    /// The alternatives, most probable first.
    pub alternatives: Vec<Alternative>,
}

impl Decision {
    /// The detected causes, with their time histories.
    pub fn courses(&self) -> Vec<(Cause, Course)> {
        self.found.iter().map(|found| (found.cause, found.course)).collect()
    }
}

/// Result of the decision.
pub(crate) struct Decision {
    /// Empty if nothing drifts.
    pub found: Vec<FoundDrifts>,
    /// No drift and each single cause, most probable first.
    pub alone: Vec<Alternative>,
    pub limits: Vec<DetectionLimit>,
    /// Number of segments that the model cannot follow, and of all.
    pub left_out: (usize, usize),
    /// Estimated covariance of each segment, without constants.
    pub own: Vec<DMatrix<f64>>,
}

/// `own` is the declared covariance of each segment; onsets near those already `known` are tried more closely.
pub(crate) fn decide(
    readings: &Readings,
    mut own: Vec<DMatrix<f64>>,
    columns: &DMatrix<f64>,
    known: &[(Cause, Course)],
) -> Result<Decision, DriftError> {
    let candidates = Candidates::new(readings, ONSETS, known)?;
    let difference = DMatrix::from_column_slice(readings.difference.len(), 1, &readings.difference);
    let (left_out, noise, left) = leave_out(&mut own, readings, columns, &difference, &candidates)?;
    // The residual of the best explanation shows how much noise exceeds its declaration.
    inflate(&mut own, readings, &noise, &left);
    let noise = LowRank::new(&own, columns)?;

    let likelihood = candidates.likelihood(&noise, &difference);
    let explanation = likelihood.explain(&candidates.priors).ok_or(Unsolvable::NotFinite)?;
    let alone =
        explanation.alone.iter().map(|(family, ln_odds)| (Some(candidates.causes[*family]), *ln_odds));
    let found = explanation.members.iter().map(|member| found(&candidates, member)).collect();
    let (start_s, end_s) = readings.span_s();
    let whole = |index: &usize| {
        let Course { kind, onset_s } = candidates.all[*index].course;
        kind == CourseKind::Ramp && onset_s <= start_s
    };
    let limit = |index: usize| {
        let rate_per_h = likelihood.smallest_seen(&candidates.priors, index)?;
        let cause = candidates.cause(index);
        let change = rate_per_h * (end_s - start_s) / 3600.0;
        change.is_finite().then(|| DetectionLimit { cause, change, unit: cause.unit() })
    };
    Ok(Decision {
        found,
        alone: probabilities(alone.chain([(None, 0.0)]).collect()),
        limits: (0..candidates.all.len()).filter(whole).filter_map(limit).collect(),
        left_out: (left_out, readings.blocks.len()),
        own,
    })
}

fn found(candidates: &Candidates, member: &Member) -> FoundDrifts {
    let cause = candidates.cause(member.index);
    let others = member
        .alternatives
        .iter()
        .map(|(family, relative)| (Some(candidates.causes[*family]), relative.ln()));
    let all = probabilities(others.chain([(Some(cause), 0.0), (None, -member.ln_odds)]).collect());
    let (own, alternatives): (Vec<_>, Vec<_>) = all.into_iter().partition(|one| one.cause == Some(cause));
    FoundDrifts {
        cause,
        course: candidates.all[member.index].course,
        probability: own.first().map_or(0.0, |own| own.probability),
        alternatives,
    }
}

/// Probabilities from ln of the odds, most probable first; they sum to 1.
fn probabilities(ln_odds: Vec<(Option<Cause>, f64)>) -> Vec<Alternative> {
    let largest = ln_odds.iter().map(|(_, ln_odds)| *ln_odds).fold(f64::NEG_INFINITY, f64::max);
    let sum: f64 = ln_odds.iter().map(|(_, ln_odds)| (ln_odds - largest).exp()).sum();
    let mut all: Vec<Alternative> = ln_odds
        .into_iter()
        .map(|(cause, ln_odds)| Alternative { cause, probability: (ln_odds - largest).exp() / sum })
        .collect();
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    all
}
