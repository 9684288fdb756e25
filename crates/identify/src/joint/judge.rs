//! Checks of a joint fit: of each step, and of the model as a whole.

use crate::IdentifyConfig;
use crate::joint::fit::solve::{Member, Problem};
use crate::joint::step_model::parameters::{ETA, LN_DEVIATION};
use crate::joint::uncertainty::smoothness::{Smoothed, SmoothedValue};
use crate::reading_checks::bounds::EFFICIENCY;
use crate::step_data::samples::TREND_BLOCK_S;
use crate::step_outcome::findings::Findings;
use crate::step_outcome::interval_width;
use mapper_core::{EstimateUncertainty, LeftOut, ModelDoubt, ModelEvidence, PoorFit, Warning};
use mapper_numerics::statistics::DOUBT_SIGMAS;
use mapper_numerics::statistics::{HINT_SIGMAS, mean, median, rms};

/// Efficiencies that a compressor can have. Bound: 1 is an ideal compression; below 0.05 nearly all work is heat.
const POSSIBLE_ETA: std::ops::RangeInclusive<f64> = 0.05..=1.0;

/// Mean square of the whitened residual's sums over segments of [`TREND_BLOCK_S`], of all steps, above which the model itself is
/// doubtful. Calibrated: `benches/identification.py`; smoothed inputs and fitted parameters reduce it from 1 to about 0.8 if the model
/// fits the rig.
const SLOW_SQUARE: f64 = 1.3;
/// Scatter of the points about the convection law above which the law does not apply, ratio. Bound: twenty times the usual spread.
const LAW_SCATTER_RATIO: f64 = 0.06;

/// Mean square of a step's whitened residual.
pub(crate) fn mean_square(problem: &Problem<'_>, member: &Member<'_>) -> f64 {
    let (residual, _) = problem.residual(member, &problem.shared, &member.local, None);
    residual.iter().map(|r| r * r).sum::<f64>() / (residual.len() as f64).max(1.0)
}

/// Mean square of segment sums of a step's whitened residual, relative to that of independent residuals.
fn slow_square(problem: &Problem<'_>, member: &Member<'_>) -> Option<f64> {
    let (residual, _) = problem.residual(member, &problem.shared, &member.local, None);
    let rows: Vec<(f64, f64)> = member.history.rows.iter().map(|row| row.t_s).zip(residual).collect();
    let block = |t_s: f64| ((t_s - rows[0].0) / TREND_BLOCK_S).floor();
    let segments: Vec<f64> = rows
        .chunk_by(|a, b| block(a.0) == block(b.0))
        .map(|segment| segment.iter().map(|(_, r)| r).sum::<f64>().powi(2) / segment.len() as f64)
        .collect();
    mean(&segments)
}

/// Excludes steps that fit far worse than the others from the shared parameters: their mean square exceeds that of the median step (at least 1)
/// by the square of the ratio that makes a step doubtful.
pub(crate) fn exclude(problem: &mut Problem<'_>, config: &IdentifyConfig) {
    let squares: Vec<f64> = problem
        .members
        .iter()
        .map(|member| if member.excluded { f64::INFINITY } else { mean_square(problem, member) })
        .collect();
    let open = || squares.iter().copied().filter(|square| square.is_finite());
    let Some(middle) = median(open()) else { return };
    let limit = config.thresholds.residual_over_noise_ratio.powi(4) * middle.max(1.0);
    // At most a third is excluded: beyond that, the model is wrong, not the steps.
    let bad = open().filter(|square| *square > limit).count();
    let few = 3 * bad <= open().count();
    for (member, square) in problem.members.iter_mut().zip(&squares) {
        member.contributes = !(member.excluded || few && *square > limit);
    }
}

/// Verdict on one step.
pub(crate) fn judge_step(
    problem: &Problem<'_>,
    index: usize,
    eta_error: EstimateUncertainty,
    dt2_k: Option<f64>,
    config: &IdentifyConfig,
    findings: &mut Findings,
) {
    let Some(member) = problem.members.get(index) else { return };
    let eta = member.local[ETA];
    if !POSSIBLE_ETA.contains(&eta) {
        findings.refuse(Warning::PoorFit(PoorFit::Eta { eta }));
    }
    if eta_error.combined_standard_error() > config.thresholds.sigma_eta {
        interval_width::judge(eta_error, dt2_k.unwrap_or(0.0), true, config, findings);
    }
    let declared = !config.declared.is_empty();
    let square = mean_square(problem, member);
    if declared && square.sqrt() > config.thresholds.residual_over_noise_ratio {
        findings.doubt(Warning::PoorFit(PoorFit::NoiseRatio { residual_ratio: square.sqrt() }));
    }
    if !member.contributes && !member.excluded {
        findings.doubt(Warning::LeftOut(LeftOut::PoorFit));
    }
    let deviation = member.local[LN_DEVIATION];
    if deviation.abs() > LAW_SCATTER_RATIO.max(DOUBT_SIGMAS * member.priors[LN_DEVIATION].sigma) {
        findings.doubt(Warning::OffTheLaw { h_deviation_ratio: deviation.exp_m1() });
    }
}

/// Arguments against the model as a whole.
pub(crate) fn doubts(problem: &Problem<'_>, smoothed: &Smoothed, config: &IdentifyConfig) -> Vec<ModelDoubt> {
    let mut doubts = Vec::new();
    let slow: Vec<f64> = problem
        .members
        .iter()
        .filter(|member| member.contributes)
        .filter_map(|m| slow_square(problem, m))
        .collect();
    let slow = mean(&slow).unwrap_or(0.0);
    if !config.declared.is_empty() && slow > SLOW_SQUARE {
        doubts.push(ModelEvidence::SlowResidual { residual_ratio: slow.sqrt() });
    }
    let scatter = rms(problem.members.iter().map(|member| member.local[LN_DEVIATION])).unwrap_or(0.0);
    if scatter > LAW_SCATTER_RATIO {
        doubts.push(ModelEvidence::Scatter { scatter_ratio: scatter });
    }
    let above = |judged: &&SmoothedValue| {
        judged.value - HINT_SIGMAS * judged.uncertainty.combined_standard_error() > *EFFICIENCY.end()
    };
    let above = smoothed.eta.iter().filter(above).count();
    if above > 0 {
        doubts.push(ModelEvidence::Eta { points: above, max_eta: *EFFICIENCY.end() });
    }
    doubts.into_iter().map(|evidence| ModelDoubt { evidence }).collect()
}
