//! The consequence of a diagnosis for the map: identified again without the causes if they are certain enough, else with wider intervals.

use crate::drift::without_drift;
use crate::gap::best_fit::fitted_causes::{CauseFit, Changes, one_sigma_away};
use crate::gap::diagnose::Diagnosed;
use crate::gap::preconditions::GapError;
use crate::gap::report::Candidate;
use crate::gap::residuals::nuisance::Hypothesis;
use mapper_core::{
    BudgetRow, IdentifiedPoint, PointBudgets, Recording, UncertaintyBudget, half_width_95, step_number,
};
use serde::Serialize;

/// A map before and after its correction for causes.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CorrectedMap {
    /// The causes, most probable first; more than one if a recording does not distinguish them.
    pub causes: Vec<Candidate>,
    /// Why nothing was corrected; `None` if it was.
    pub refused: Option<NotCorrected>,
    /// Points in order of their steps.
    pub points: Vec<PointCorrection>,
}

impl CorrectedMap {
    /// Minimum share of the gap that a closure term removes on held-out steps if a map is corrected for it. Bound: the rest then has at most
    /// 45 % of the amplitude, which is added to the uncertainty of the correction.
    pub const NEEDED_GAP_REDUCTION: f64 = 0.8;
    /// Minimum probability of the causes by which a map is corrected. Judgement: of the diagnoses with a higher probability, 94 % are right on 2000 simulated
    /// campaigns (docs/validation/gap.md).
    pub const NEEDED_PROBABILITY: f64 = 0.9;
}

/// Why a map is not corrected.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "reason", rename_all = "snake_case")]
pub enum NotCorrected {
    /// The diagnosis names no cause.
    NoCause,
    /// The causes change no reading from which the efficiency follows: they are properties of the machine itself.
    OfTheMachine,
    /// The closure term removes less of the gap on held-out steps than [`CorrectedMap::NEEDED_GAP_REDUCTION`].
    NotClosed {
        /// The share that it removes.
        gap_reduction: f64,
    },
    /// The open causes together are less probable than [`CorrectedMap::NEEDED_PROBABILITY`].
    Improbable {
        /// Probability of all causes together.
        probability: f64,
    },
    /// The recording does not determine how large the causes are.
    Undetermined,
    /// The corrections for causes that the recording does not distinguish differ by more than the interval.
    Ambiguous {
        /// Number of the step where they differ most, relative to its interval.
        step: usize,
        /// Their largest difference there, fraction.
        difference: f64,
        /// Half of the 95 % interval there, fraction.
        half_interval: f64,
    },
}

/// A map without the causes of a gap.
#[derive(Debug, Clone)]
pub struct Correction<T> {
    /// Identification of the corrected readings; that of the readings as recorded if nothing was corrected.
    pub identified: T,
    /// Before and after, point by point.
    pub map: CorrectedMap,
    /// What the causes add to the uncertainty of each point, in order of its points.
    pub added: Vec<AddedUncertainty>,
}

/// What a correction, or causes that are not corrected, add to the standard uncertainty of a point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AddedUncertainty {
    /// Efficiency, fraction.
    pub eta_sigma: f64,
    /// Heat-transfer coefficient, W/(m2 K).
    pub h_sigma_w_m2k: f64,
}

/// Efficiency of a point before and after: value and ends of the 95 % interval, fraction.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PointCorrection {
    /// Number of the step, from 1.
    pub step: usize,
    /// Shaft speed, rpm.
    pub speed_rpm: f64,
    /// Valve opening.
    pub valve: f64,
    /// As recorded; `None` without a result.
    pub before: Option<[f64; 3]>,
    /// Without the causes; `None` without a result or a correction.
    pub after: Option<[f64; 3]>,
    /// Standard uncertainty of the correction, fraction.
    pub correction_sigma: f64,
}

/// Identified points, as a correction reads them.
type Points<'a, T> = &'a dyn Fn(&T) -> Vec<IdentifiedPoint>;

impl Diagnosed {
    /// Identifies the readings again without the causes found, by `identify`; `points` reads the points of its result.
    pub fn correct<T, E: From<GapError>>(
        &self,
        recording: &Recording,
        identify: impl Fn(Recording) -> Result<T, E>,
        points: Points<'_, T>,
    ) -> Result<Correction<T>, E> {
        let before = identify(recording.clone())?;
        // As in the diagnosis, the drift of a sensor is subtracted first.
        let undrifted = self.drift.as_ref().and_then(|drift| without_drift(recording, drift));
        let undrifted = undrifted.unwrap_or_else(|| recording.clone());
        let changes = |hypothesis: &Hypothesis| -> Result<Changes, E> {
            Ok(Changes::of(&self.study, hypothesis).map_err(GapError::from)?)
        };
        let without =
            |hypothesis: &Hypothesis| identify(changes(hypothesis)?.subtracted_from(undrifted.clone()));
        let OpenCauses { causes, fits, probability, gap_reduction } = self.open_causes();
        let is_of_machine = match fits.first() {
            Some(fit) => changes(&fit.hypothesis)?.are_none(),
            None => false,
        };
        let fits = if is_of_machine { Vec::new() } else { fits };
        let after = fits.iter().map(|fit| without(&fit.hypothesis)).collect::<Result<Vec<T>, E>>()?;
        let points_after: Vec<Vec<IdentifiedPoint>> = after.iter().map(points).collect();
        let before_points = points(&before);
        let (refused, moved) = match fits.first() {
            None if is_of_machine => (Some(NotCorrected::OfTheMachine), None),
            None => (Some(NotCorrected::NoCause), None),
            Some(_) if probability < CorrectedMap::NEEDED_PROBABILITY => {
                (Some(NotCorrected::Improbable { probability }), None)
            }
            Some(_) if gap_reduction < CorrectedMap::NEEDED_GAP_REDUCTION => {
                (Some(NotCorrected::NotClosed { gap_reduction }), None)
            }
            Some(fit) => match one_sigma_away(&self.study, fit) {
                None => (Some(NotCorrected::Undetermined), None),
                moved => (ambiguous(&points_after[0], &points_after[1..]), moved),
            },
        };
        // Nothing is refused only if there is a cause.
        let corrected = if refused.is_none() { after.into_iter().next() } else { None };
        let Some(identified) = corrected else {
            let probabilities = causes.iter().map(|cause| cause.probability);
            let mut open: Vec<(f64, Vec<IdentifiedPoint>)> = probabilities.zip(points_after).collect();
            if let Some((weight, fit)) = self.imitation() {
                open.push((weight, points(&without(&fit.hypothesis)?)));
            }
            let added: Vec<AddedUncertainty> =
                before_points.iter().map(|point| self.by_open_causes(point, &open)).collect();
            let rows = before_points.iter().zip(&added);
            let rows = rows.map(|(point, added)| correction_of(Some(point), None, added.eta_sigma)).collect();
            return Ok(Correction {
                identified: before,
                map: CorrectedMap { causes, refused, points: rows },
                added,
            });
        };
        let moved = moved.unwrap_or_default().iter().map(without).collect::<Result<Vec<T>, E>>()?;
        let moved: Vec<Vec<IdentifiedPoint>> = moved.iter().map(points).collect();
        let corrected_points = points(&identified);
        // The misfit is a square; what is left of its root may act on the points as the cause does.
        let left_ratio = (1.0 - gap_reduction).max(0.0).sqrt();
        let added: Vec<AddedUncertainty> = corrected_points
            .iter()
            .map(|point| {
                let left = same_step(&before_points, point.step).map(|before| (before, left_ratio));
                by_correction(point, &moved, &points_after[1..], left)
            })
            .collect();
        let rows = corrected_points.into_iter().zip(&added).map(|(mut point, added)| {
            added.widen(&mut point);
            correction_of(same_step(&before_points, point.step), Some(&point), added.eta_sigma)
        });
        let map = CorrectedMap { causes, refused, points: rows.collect() };
        Ok(Correction { identified, map, added })
    }

    /// A closure term that removes most of the gap in a form other than the true one, and the probability of such a cause times its share.
    fn imitation(&self) -> Option<(f64, &CauseFit)> {
        let Diagnosed { diagnosis, fits, .. } = self;
        let term = diagnosis.closure_terms.first().filter(|_| diagnosis.is_outside_without_closure())?;
        Some((diagnosis.probability_outside * term.gap_reduction, fits.closure.as_ref()?))
    }

    /// What uncorrected causes add to a point: weighted squared changes by their corrections, and T2's residual without a closure term.
    fn by_open_causes(
        &self,
        point: &IdentifiedPoint,
        open: &[(f64, Vec<IdentifiedPoint>)],
    ) -> AddedUncertainty {
        let place = self.study.steps.iter().position(|step| step.marker.index == point.step);
        let residual = place
            .and_then(|place| Some(self.diagnosis.gap.points.get(place)?.eta_residual))
            .filter(|_| self.diagnosis.is_outside_without_closure());
        let sigma = |read: fn(&IdentifiedPoint) -> Option<f64>| {
            let changes = open.iter().filter_map(|(weight, other)| {
                Some(weight * (read(same_step(other, point.step)?)? - read(point)?).powi(2))
            });
            changes.sum::<f64>().sqrt()
        };
        AddedUncertainty {
            eta_sigma: sigma(|point| point.eta).hypot(residual.unwrap_or(0.0)),
            h_sigma_w_m2k: sigma(|point| point.h_w_m2k),
        }
    }

    /// The causes that together reach [`CorrectedMap::NEEDED_PROBABILITY`].
    fn open_causes(&self) -> OpenCauses<'_> {
        let Diagnosed { diagnosis, fits, .. } = self;
        let closure = diagnosis.probable_closure_term();
        let gap_reduction = closure.map_or(1.0, |term| term.gap_reduction);
        let mut open = OpenCauses { gap_reduction, ..OpenCauses::default() };
        if closure.is_none() && !diagnosis.verdict.names_a_cause() {
            return open;
        }
        for (candidate, fit) in diagnosis.candidates.iter().zip(&fits.causes) {
            if open.probability >= CorrectedMap::NEEDED_PROBABILITY {
                break;
            }
            open.probability += candidate.probability;
            open.causes.push(candidate.clone());
            open.fits.push(fit);
        }
        open
    }
}

/// The causes that a map may be corrected for, best first, with their fits.
#[derive(Default)]
struct OpenCauses<'a> {
    causes: Vec<Candidate>,
    fits: Vec<&'a CauseFit>,
    /// Of all together.
    probability: f64,
    /// Share of the gap that a closure term removes on held-out steps; 1 for causes of the library, whose rest is noise.
    gap_reduction: f64,
}

fn same_step(points: &[IdentifiedPoint], step: usize) -> Option<&IdentifiedPoint> {
    points.iter().find(|point| point.step == step)
}

/// Uncertainty of the correction of a point: `moved` are the results one standard deviation away in each direction, `others` those of causes that
/// the recording does not distinguish, `left` the point as recorded with the share of its change that may be left.
fn by_correction(
    point: &IdentifiedPoint,
    moved: &[Vec<IdentifiedPoint>],
    others: &[Vec<IdentifiedPoint>],
    left: Option<(&IdentifiedPoint, f64)>,
) -> AddedUncertainty {
    let sigma = |read: fn(&IdentifiedPoint) -> Option<f64>| {
        let here = read(point)?;
        let square =
            |other: &Vec<IdentifiedPoint>| Some((read(same_step(other, point.step)?)? - here).powi(2));
        let by_size: f64 = moved.iter().filter_map(square).sum();
        let by_rest = left.and_then(|(before, ratio)| Some((ratio * (read(before)? - here)).powi(2)));
        Some((by_size + by_rest.unwrap_or(0.0) + others.iter().filter_map(square).fold(0.0, f64::max)).sqrt())
    };
    AddedUncertainty {
        eta_sigma: sigma(|point| point.eta).unwrap_or(0.0),
        h_sigma_w_m2k: sigma(|point| point.h_w_m2k).unwrap_or(0.0),
    }
}

/// Whether the causes that a recording does not distinguish differ at any good point by more than its interval.
fn ambiguous(best: &[IdentifiedPoint], others: &[Vec<IdentifiedPoint>]) -> Option<NotCorrected> {
    let differences =
        best.iter().filter(|point| point.verdict == mapper_core::Verdict::Good).filter_map(|point| {
            let (eta, half) = (point.eta?, 0.5 * (point.eta_high? - point.eta_low?));
            let eta_of = |other: &Vec<IdentifiedPoint>| same_step(other, point.step)?.eta;
            let difference =
                others.iter().filter_map(eta_of).map(|other| (other - eta).abs()).reduce(f64::max)?;
            Some((step_number(point.step), difference, half))
        });
    let (step, difference, half_interval) = differences.max_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2)))?;
    (difference > half_interval).then_some(NotCorrected::Ambiguous { step, difference, half_interval })
}

impl AddedUncertainty {
    pub fn widen(&self, point: &mut IdentifiedPoint) {
        let AddedUncertainty { eta_sigma, h_sigma_w_m2k } = *self;
        let wider = |value: Option<f64>, end: &mut Option<f64>, sigma: f64| {
            if let (Some(value), Some(end)) = (value, end.as_mut()) {
                let distance = *end - value;
                *end = value + distance.hypot(half_width_95(sigma)).copysign(distance);
            }
        };
        wider(point.eta, &mut point.eta_low, eta_sigma);
        wider(point.eta, &mut point.eta_high, eta_sigma);
        wider(point.h_w_m2k, &mut point.h_low_w_m2k, h_sigma_w_m2k);
        wider(point.h_w_m2k, &mut point.h_high_w_m2k, h_sigma_w_m2k);
        for (uncertainty, sigma) in
            [(&mut point.eta_uncertainty, eta_sigma), (&mut point.h_uncertainty, h_sigma_w_m2k)]
        {
            if let Some(uncertainty) = uncertainty {
                uncertainty.bias_standard_error = uncertainty.bias_standard_error.hypot(sigma);
            }
        }
    }

    /// Adds the correction to the uncertainty budgets of a point.
    pub fn add_to(&self, budgets: &mut PointBudgets) {
        add_row(&mut budgets.eta, self.eta_sigma, "");
        add_row(&mut budgets.h_w_m2k, self.h_sigma_w_m2k, "W/(m2 K)");
    }
}

fn add_row(budget: &mut Option<UncertaintyBudget>, sigma: f64, unit: &str) {
    let Some(known) = budget.take() else { return };
    let mut rows = known.rows;
    rows.push(BudgetRow {
        source: "correction for the causes of the gap".to_owned(),
        standard_uncertainty: sigma,
        unit: unit.to_owned(),
        sensitivity: 1.0,
        contribution: sigma,
        degrees_of_freedom: None,
    });
    let expanded = known.expanded_uncertainty.hypot(half_width_95(sigma));
    *budget = Some(UncertaintyBudget::of(known.value, rows, expanded));
}

fn correction_of(
    before: Option<&IdentifiedPoint>,
    after: Option<&IdentifiedPoint>,
    correction_sigma: f64,
) -> PointCorrection {
    let eta = |point: &IdentifiedPoint| Some([point.eta?, point.eta_low?, point.eta_high?]);
    let place = before.or(after);
    PointCorrection {
        step: place.map_or(0, |point| step_number(point.step)),
        speed_rpm: place.map_or(f64::NAN, |point| point.speed_rpm),
        valve: place.map_or(f64::NAN, |point| point.valve_opening_ratio),
        before: before.and_then(eta),
        after: after.and_then(eta),
        correction_sigma,
    }
}
