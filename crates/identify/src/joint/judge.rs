//! Judges the points of the joint fit, and the regions that its steps cover.

use crate::IdentifyConfig;
use crate::joint::fit::solve::{Covariance, Problem};
use crate::joint::fit::start::{LAW_SIGMA, STEP_HEAT_SIGMA_W, SURFACE_SIGMA};
use crate::joint::fit::step_noise;
use crate::joint::step_model::parameters::{
    ETA, EXPONENT, LN_COEFFICIENT, LN_DEVIATION, REFINEMENTS, STEP_HEAT, SurfaceScale,
};
use crate::joint::step_model::rows::{Row, StepRows};
use crate::joint::uncertainty::{Number, Numbers};
use crate::reading_checks::bounds::EFFICIENCY;
use crate::step_data::samples::TREND_BLOCK_S;
use crate::step_outcome::findings::{Findings, judge_interval};
use mapper_core::{EstimateUncertainty, LeftOut, MapRegion, ModelDoubt, ModelEvidence, PoorFit, Warning};
use mapper_numerics::statistics::{DOUBT_SIGMAS, EXCLUDE_SIGMAS, HINT_SIGMAS, MIN_VALUES, mean, median, rms};

/// Efficiencies that a compressor can have. Bound: 1 is an ideal compression; below 0.05 nearly all work is heat.
const POSSIBLE_ETA: std::ops::RangeInclusive<f64> = 0.05..=1.0;

/// Mean square of the whitened residual's sums over segments of [`TREND_BLOCK_S`] if the model fits the rig. Calibrated:
/// `benches/identification.py`; smoothed inputs and fitted parameters reduce it from 1.
const FITTING_SQUARE: f64 = 0.8;
/// The same of all steps, above which the model itself is doubtful. Calibrated: as above.
const SLOW_SQUARE: f64 = 1.6;
/// The same of Tc: above it the housing is not one, two or three masses. Calibrated: `benches/identification.py`; 0.8 if the model fits the rig, with a
/// largest value of 0.98 in 69 recordings.
const SLOW_TC_SQUARE: f64 = 1.25;
/// Spread of the heat that the steps' balances do not have above which the housing is not one, two or three masses, W. Calibrated: as above; 2 W, the
/// largest 2.9 W.
const STEP_HEAT_W: f64 = 6.0;
/// Mean square of slow residuals above which more parts are tried. Bound: independent residuals have 1.
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
fn slow_squares(problem: &Problem<'_>) -> (f64, Option<f64>) {
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

/// Whether a fit of one part leaves anything that more parts could explain. Otherwise its evidence is that of the noise, and another fit would
/// only cost time.
pub(crate) fn may_have_parts(problem: &Problem<'_>) -> bool {
    let (slow, slow_tc) = slow_squares(problem);
    let prior = |index: usize| problem.members.first().map_or(0.0, |member| member.priors[index].sigma);
    slow > SUSPECT_SQUARE
        || slow_tc.is_some_and(|square| square > SUSPECT_SQUARE)
        || prior(LN_DEVIATION) > SUSPECT_SPREADS * LAW_SIGMA
        || prior(STEP_HEAT) > SUSPECT_SPREADS * STEP_HEAT_SIGMA_W
        || problem.surface_sigma > SUSPECT_SPREADS * SURFACE_SIGMA
        || problem.members.iter().any(|member| !(member.contributes || member.excluded))
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
        judge_interval(eta_error, dt2_k.unwrap_or(0.0), true, config, findings);
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

// Finds a region of the map whose steps disagree with the others on the shared parameters, so that they do not invalidate the recording.
// The search runs if the fit of all steps has warnings. A region is one end of the map (near choke, near surge, slowest, fastest). It is excluded if
// the warnings disappear without it and the shared parameters change by more than their own uncertainty explains. Without an error,
// the remaining steps only carry less information: the variance of the difference is then the difference of the variances (Hausman,
// Econometrica 46, 1978, eq. 2.10).

/// Shares of the steps in a region; the smallest one that helps is excluded. Bound: fewer steps are excluded one by one, more would leave
/// too few.
const SHARES: [f64; 2] = [1.0 / 6.0, 1.0 / 3.0];

/// Steps at one end of the map.
pub(crate) struct Region {
    pub(crate) region: MapRegion,
    pub(crate) steps: Vec<usize>,
}

/// Sort key of a position (scaled speed and flow): the lowest come first in a region.
type Rank = fn(&(f64, f64)) -> f64;

/// All regions, the small ones first; those of equal size are adjacent.
pub(crate) fn regions(steps: &[StepRows]) -> Vec<Vec<Region>> {
    let places: Vec<(f64, f64)> = steps.iter().map(|step| step.end.place).collect();
    let Some(scale) = SurfaceScale::of(&places).filter(|_| steps.len() > MIN_VALUES) else {
        return Vec::new();
    };
    let coordinates: Vec<(f64, f64)> = places.iter().map(|place| scale.coordinates(*place)).collect();
    let sorted = |of: Rank| {
        let mut order: Vec<usize> = (0..coordinates.len()).collect();
        order.sort_by(|a, b| of(&coordinates[*a]).total_cmp(&of(&coordinates[*b])));
        order
    };
    let ends: [(MapRegion, Rank); 4] = [
        (MapRegion::Choke, |place| -place.1),
        (MapRegion::Surge, |place| place.1),
        (MapRegion::LowestSpeeds, |place| place.0),
        (MapRegion::HighestSpeeds, |place| -place.0),
    ];
    let of_size = |share: f64| {
        let count = (share * steps.len() as f64).ceil() as usize;
        ends.iter()
            .map(|(region, of)| {
                let steps = sorted(*of).into_iter().take(count).collect();
                Region { region: *region, steps }
            })
            .collect()
    };
    SHARES.into_iter().map(of_size).collect()
}

/// Largest difference between the remaining steps and all steps over the shared parameters, in standard errors; `None` if as expected.
pub(crate) fn disagreement(
    all: (&Problem<'_>, &Covariance),
    rest: (&Problem<'_>, &Covariance),
) -> Option<f64> {
    let error = |(problem, covariance): (&Problem<'_>, &Covariance), index: usize| {
        // A parameter fixed as declared has no error.
        if problem.active[index] { covariance.error_of(index) } else { Some(0.0) }
    };
    // Small model errors change a parameter by as much, and the spread of the points about the law changes the law.
    let with_priors = REFINEMENTS.into_iter().map(|refinement| (refinement.index, refinement.model_error));
    with_priors
        .chain([(EXPONENT, LAW_SIGMA), (LN_COEFFICIENT, LAW_SIGMA)])
        .filter_map(|(index, floor)| {
            let (of_all, of_rest) = (error(all, index)?, error(rest, index)?);
            let variance = (of_rest * of_rest - of_all * of_all).max(0.0) + floor * floor;
            Some((all.0.shared[index] - rest.0.shared[index]).abs() / variance.sqrt())
        })
        .filter(|sigmas| *sigmas > EXCLUDE_SIGMAS)
        .reduce(f64::max)
}
