//! Checks of a joint fit: of each step, and of the model as a whole.

use crate::IdentifyConfig;
use crate::joint::fit::solve::Problem;
use crate::joint::fit::start::{LAW_SIGMA, STEP_HEAT_SIGMA_W, SURFACE_SIGMA};
use crate::joint::fit::step_noise;
use crate::joint::step_model::parameters::{ETA, LN_DEVIATION, STEP_HEAT};
use crate::joint::step_model::rows::Row;
use crate::joint::uncertainty::numbers::Numbers;
use crate::joint::uncertainty::quantity::Number;
use crate::reading_checks::bounds::EFFICIENCY;
use crate::step_data::samples::TREND_BLOCK_S;
use crate::step_outcome::findings::Findings;
use crate::step_outcome::interval_width;
use mapper_core::{EstimateUncertainty, LeftOut, ModelDoubt, ModelEvidence, PoorFit, Warning};
use mapper_numerics::statistics::DOUBT_SIGMAS;
use mapper_numerics::statistics::{HINT_SIGMAS, mean, median, rms};

/// Efficiencies that a compressor can have. Bound: 1 is an ideal compression; below 0.05 nearly all work is heat.
const POSSIBLE_ETA: std::ops::RangeInclusive<f64> = 0.05..=1.0;

/// Mean square of the whitened residual's sums over segments of [`TREND_BLOCK_S`] if the model fits the rig. Calibrated:
/// `benches/identification.py`; smoothed inputs and fitted parameters reduce it from 1.
const FITTING_SQUARE: f64 = 0.8;
/// The same of all steps, above which the model itself is doubtful. Calibrated: as above.
const SLOW_SQUARE: f64 = 1.6;
/// The same of Tc: above it the housing is not one or two masses. Calibrated: `benches/identification.py`; 0.8 if the model fits the rig, with a
/// largest value of 0.98 in 69 recordings.
const SLOW_TC_SQUARE: f64 = 1.25;
/// Spread of the heat that the steps' balances do not have above which the housing is not one or two masses, W. Calibrated: as above; 2 W, the
/// largest 2.9 W.
const STEP_HEAT_W: f64 = 6.0;
/// Mean square of slow residuals above which an inner wall is tried. Bound: independent residuals have 1.
const SUSPECT_SQUARE: f64 = 1.0;
/// The same for the spreads of h, heat and efficiency, over the expected ones. Bound: a tenth more than noise gives.
const SUSPECT_SPREADS: f64 = 1.1;
/// Scatter of the points about the convection law above which the law does not apply, ratio. Bound: twenty times the usual spread.
const LAW_SCATTER_RATIO: f64 = 0.06;

/// Mean square of segment sums of a whitened residual along its rows, relative to that of independent residuals.
fn slow_square(rows: &[Row], whitened: &[f64]) -> Option<f64> {
    let rows: Vec<(f64, f64)> = rows.iter().map(|row| row.t_s).zip(whitened.iter().copied()).collect();
    let first_s = rows.first()?.0;
    let block = |t_s: f64| ((t_s - first_s) / TREND_BLOCK_S).floor();
    let segments: Vec<f64> = rows
        .chunk_by(|a, b| block(a.0) == block(b.0))
        .map(|segment| segment.iter().map(|(_, r)| r).sum::<f64>().powi(2) / segment.len() as f64)
        .collect();
    mean(&segments)
}

/// Mean squares of segment sums of the contributing steps: of T2, and of Tc given T2.
pub(crate) fn slow_squares(problem: &Problem<'_>) -> (f64, Option<f64>) {
    let (mut t2, mut tc) = (Vec::new(), Vec::new());
    for (member, whitened) in problem.members.iter().zip(problem.whitened()) {
        let rows = &member.history.step.rows;
        if !member.contributes || whitened.len() < rows.len() {
            continue;
        }
        let (of_t2, of_tc) = whitened.split_at(rows.len());
        t2.extend(slow_square(rows, of_t2));
        tc.extend(slow_square(rows, of_tc).filter(|_| !of_tc.is_empty()));
    }
    (mean(&t2).unwrap_or(0.0), mean(&tc))
}

/// Whether the slow residuals are nearer to those of a model that fits than to those of a doubtful one. An error of all steps is not made good by
/// leaving out those in which it is largest.
pub(crate) fn fits(problem: &Problem<'_>) -> bool {
    let is_near = |square: f64, doubtful: f64| square * square < FITTING_SQUARE * doubtful;
    let (slow, slow_tc) = slow_squares(problem);
    is_near(slow, SLOW_SQUARE) && slow_tc.is_none_or(|square| is_near(square, SLOW_TC_SQUARE))
}

/// Whether a fit of one node leaves anything that an inner wall could explain. Otherwise its evidence is that of the noise, and another fit would
/// only cost time.
pub(crate) fn may_have_inner_wall(problem: &Problem<'_>) -> bool {
    let (slow, slow_tc) = slow_squares(problem);
    let prior = |index: usize| problem.members.first().map_or(0.0, |member| member.priors[index].sigma);
    slow > SUSPECT_SQUARE
        || slow_tc.is_some_and(|square| square > SUSPECT_SQUARE)
        || prior(LN_DEVIATION) > SUSPECT_SPREADS * LAW_SIGMA
        || prior(STEP_HEAT) > SUSPECT_SPREADS * STEP_HEAT_SIGMA_W
        || problem.surface_sigma > SUSPECT_SPREADS * SURFACE_SIGMA
        || problem.members.iter().any(|member| !member.contributes)
}

/// Excludes steps that fit far worse than the others from the shared parameters: their mean square exceeds that of the median step (at least 1)
/// by the square of the ratio that makes a step doubtful.
pub(crate) fn exclude(problem: &mut Problem<'_>, config: &IdentifyConfig) {
    let squares: Vec<f64> = problem
        .members
        .iter()
        .zip(problem.whitened())
        .map(|(member, whitened)| {
            let (t2, tc) = step_noise::mean_squares(member, &whitened);
            if member.excluded { f64::INFINITY } else { t2.max(tc.unwrap_or(0.0)) }
        })
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
    (index, whitened): (usize, &[f64]),
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
    let (square, _) = step_noise::mean_squares(member, whitened);
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
pub(crate) fn doubts(problem: &Problem<'_>, numbers: &Numbers, config: &IdentifyConfig) -> Vec<ModelDoubt> {
    let mut doubts = Vec::new();
    let (slow, slow_tc) = slow_squares(problem);
    if !config.declared.is_empty() && slow > SLOW_SQUARE {
        doubts.push(ModelEvidence::SlowResidual { residual_ratio: slow.sqrt() });
    }
    let heat_w = problem.members.first().map_or(0.0, |member| member.priors[STEP_HEAT].sigma);
    if let Some(slow_tc) = slow_tc.filter(|_| !config.declared.is_empty())
        && (slow_tc > SLOW_TC_SQUARE || heat_w > STEP_HEAT_W)
    {
        doubts.push(ModelEvidence::Housing { residual_ratio: slow_tc.sqrt(), heat_w });
    }
    let scatter = rms(problem.members.iter().map(|member| member.local[LN_DEVIATION])).unwrap_or(0.0);
    if scatter > LAW_SCATTER_RATIO {
        doubts.push(ModelEvidence::Scatter { scatter_ratio: scatter });
    }
    let above = |judged: &&Number| {
        judged.value - HINT_SIGMAS * judged.uncertainty.combined_standard_error() > *EFFICIENCY.end()
    };
    let above = numbers.eta.iter().filter(above).count();
    if above > 0 {
        doubts.push(ModelEvidence::Eta { points: above, max_eta: *EFFICIENCY.end() });
    }
    doubts.into_iter().map(|evidence| ModelDoubt { evidence }).collect()
}
