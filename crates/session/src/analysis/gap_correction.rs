//! A map corrected for the causes that a gap diagnosis names: identification of the readings without them.

use crate::analysis::gap::{Gap, subtract_drift};
use crate::analysis::identification::Identified;
use crate::recording::recording_file::Recorded;
use crate::{Session, SessionError, SessionEvent};
use mapper_campaign::Campaign;
use mapper_core::{BudgetRow, IdentifiedPoint, Method, ResultRemark, UncertaintyBudget, half_width_95};
use mapper_diagnose::gap::correction::{
    Changes, CorrectedMap, NEEDED_PROBABILITY, NotCorrected, PointCorrection, one_sigma_away,
};
use mapper_diagnose::gap::diagnose::GapError;
use mapper_diagnose::gap::findings::report::Candidate;
use mapper_diagnose::gap::residuals::study::Hypothesis;
use mapper_physics::rig::effect::Effect;
use mapper_recording::ChannelMap;
use std::path::Path;
use std::sync::Arc;

/// A recording with its diagnosis and the map without the causes.
pub struct GapCorrection {
    /// The diagnosis.
    pub gap: Gap,
    /// Before and after, point by point.
    pub map: CorrectedMap,
    /// Identification of the corrected readings, the uncertainty of the correction in its intervals; that of the readings as recorded, what
    /// the open causes would change in its intervals, if nothing was corrected.
    pub identified: Identified,
}

impl Session<'_> {
    /// Diagnoses a recording and identifies it again without the causes found. With `directory`, the results are written there as those of an
    /// identification.
    ///
    /// # Errors
    /// As [`Session::diagnose_gap`], [`Session::identify`] and [`Session::identify_into`].
    pub fn correct_gap(
        &self,
        recorded: &Recorded,
        (campaign, map): (&Campaign, &ChannelMap),
        effects: Vec<Arc<dyn Effect>>,
        method: Option<Method>,
        directory: Option<&Path>,
    ) -> Result<GapCorrection, SessionError> {
        let gap = self.diagnose_gap(recorded, campaign, map, effects, None)?;
        self.send(SessionEvent::Progress { done_ratio: 1.0, what: "identification".to_owned() });
        let quiet = Session::new(self.registry);
        let identify = |recorded| quiet.identify(vec![recorded], map, method);
        let mut before = identify(recorded.clone())?;
        // As in the diagnosis, the drift of a sensor is subtracted first.
        let undrifted = subtract_drift(recorded.read.recording.clone(), gap.drift.as_ref());
        let without = |hypothesis: &Hypothesis| -> Result<Identified, SessionError> {
            let changes = Changes::of(&gap.diagnosed.study, hypothesis).map_err(GapError::from)?;
            let mut recorded = recorded.clone();
            recorded.read.recording = changes.subtracted_from(undrifted.clone());
            identify(recorded)
        };
        let (causes, probability) = gap.diagnosed.open_causes();
        let named: Vec<Candidate> = causes.iter().map(|(candidate, _)| (*candidate).clone()).collect();
        let mut after = Vec::with_capacity(causes.len());
        for (_, fit) in &causes {
            after.push(without(&fit.hypothesis)?);
        }
        let (refused, moved) = match causes.first() {
            None => (Some(NotCorrected::NoCause), None),
            Some(_) if probability < NEEDED_PROBABILITY => {
                (Some(NotCorrected::Improbable { probability }), None)
            }
            Some((_, fit)) => match one_sigma_away(&gap.diagnosed.study, fit) {
                None => (Some(NotCorrected::Undetermined), None),
                moved => (ambiguous(&after[0], &after[1..]), moved),
            },
        };
        let (identified, points) = if refused.is_some() {
            let points = widen_by_open_causes(&mut before, &gap, &named, &after);
            before.remarks.extend(widened_remark(&named, &points));
            (before, points)
        } else {
            let hypotheses = moved.unwrap_or_default();
            let mut moved = Vec::with_capacity(hypotheses.len());
            for hypothesis in &hypotheses {
                moved.push(without(hypothesis)?);
            }
            // Nothing is refused: there is a cause.
            let mut identified = after.remove(0);
            let points = widen_intervals(&mut identified, &before, &moved, &after);
            identified.corrections.clone_from(&points);
            identified.remarks.extend(named.iter().map(|cause| ResultRemark::Corrected {
                causes: cause.names.clone(),
                probability: cause.probability,
            }));
            identified.remarks.extend(
                gap.drift
                    .as_ref()
                    .map(|drift| ResultRemark::DriftSubtracted { reason: drift.reason.clone() }),
            );
            (identified, points)
        };
        if let Some(directory) = directory {
            let identified = identified.clone();
            self.write_identification(vec![recorded.clone()], directory, |_| Ok(identified))?;
        }
        Ok(GapCorrection { gap, map: CorrectedMap { causes: named, refused, points }, identified })
    }
}

/// States that intervals are wider because of causes that the map is not corrected for; `None` if none is.
fn widened_remark(causes: &[Candidate], points: &[PointCorrection]) -> Option<ResultRemark> {
    let largest_sigma = points.iter().map(|point| point.correction_sigma).fold(0.0, f64::max);
    let causes = causes.iter().map(|cause| cause.names.join(" + ")).collect();
    (largest_sigma > 0.0).then_some(ResultRemark::WidenedByGap { causes, largest_sigma })
}

/// Widens the intervals of a map that is not corrected: by what a correction for each open cause would change, `after`, squared and
/// weighted with its probability, and by the residual of T2 if no law describes a cause outside the library.
fn widen_by_open_causes(
    identified: &mut Identified,
    gap: &Gap,
    causes: &[Candidate],
    after: &[Identified],
) -> Vec<PointCorrection> {
    let (diagnosis, steps) = (&gap.diagnosed.diagnosis, &gap.diagnosed.study.steps);
    let residual = |step: usize| {
        let place = steps.iter().position(|other| other.marker.index == step)?;
        Some(diagnosis.gap.points.get(place)?.eta_residual).filter(|_| diagnosis.is_outside_without_law())
    };
    let mut points = Vec::with_capacity(identified.points.len());
    for scored in &mut identified.points {
        let recorded = scored.point.clone();
        let sigma = |read: fn(&IdentifiedPoint) -> Option<f64>| {
            let changes = causes.iter().zip(after).filter_map(|(cause, other)| {
                Some(cause.probability * (read(same_step(other, recorded.step)?)? - read(&recorded)?).powi(2))
            });
            changes.sum::<f64>().sqrt()
        };
        let eta_sigma = sigma(|point| point.eta).hypot(residual(recorded.step).unwrap_or(0.0));
        let h_sigma_w_m2k = sigma(|point| point.h_w_m2k);
        widen(&mut scored.point, eta_sigma, h_sigma_w_m2k);
        points.push(correction_of(Some(&recorded), None, eta_sigma));
    }
    points
}

fn same_step(identified: &Identified, step: usize) -> Option<&IdentifiedPoint> {
    identified.points_alone().find(|point| point.step == step)
}

/// Adds the uncertainty of the correction to every point: `moved` are the results one standard deviation away in each direction, `others`
/// those of causes that the recording does not distinguish.
fn widen_intervals(
    identified: &mut Identified,
    before: &Identified,
    moved: &[Identified],
    others: &[Identified],
) -> Vec<PointCorrection> {
    let mut points = Vec::new();
    for scored in &mut identified.points {
        let step = scored.point.step;
        let sigma = |read: fn(&IdentifiedPoint) -> Option<f64>| {
            let here = read(&scored.point)?;
            let square = |other: &Identified| Some((read(same_step(other, step)?)? - here).powi(2));
            let by_size: f64 = moved.iter().filter_map(square).sum();
            Some((by_size + others.iter().filter_map(square).fold(0.0, f64::max)).sqrt())
        };
        let eta_sigma = sigma(|point| point.eta).unwrap_or(0.0);
        let h_sigma_w_m2k = sigma(|point| point.h_w_m2k).unwrap_or(0.0);
        widen(&mut scored.point, eta_sigma, h_sigma_w_m2k);
        for budgets in identified.budgets.iter_mut().filter(|budgets| budgets.step == step) {
            add_row(&mut budgets.eta, eta_sigma, "");
            add_row(&mut budgets.h_w_m2k, h_sigma_w_m2k, "W/(m2 K)");
        }
        points.push(correction_of(same_step(before, step), Some(&scored.point), eta_sigma));
    }
    points
}

/// Whether the causes that a recording does not distinguish differ at any good point by more than its interval.
fn ambiguous(best: &Identified, others: &[Identified]) -> Option<NotCorrected> {
    let differences =
        best.points_alone().filter(|point| point.verdict == mapper_core::Verdict::Good).filter_map(|point| {
            let (eta, half) = (point.eta?, 0.5 * (point.eta_high? - point.eta_low?));
            let eta_of = |other: &Identified| same_step(other, point.step)?.eta;
            let difference =
                others.iter().filter_map(eta_of).map(|other| (other - eta).abs()).reduce(f64::max)?;
            Some((mapper_core::step_number(point.step), difference, half))
        });
    let (step, difference, half_interval) = differences.max_by(|a, b| (a.1 / a.2).total_cmp(&(b.1 / b.2)))?;
    (difference > half_interval).then_some(NotCorrected::Ambiguous { step, difference, half_interval })
}

/// Adds the uncertainty of the correction to a point.
fn widen(point: &mut IdentifiedPoint, eta_sigma: f64, h_sigma_w_m2k: f64) {
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

/// Adds the correction as a source of uncertainty.
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
        step: place.map_or(0, |point| mapper_core::step_number(point.step)),
        speed_rpm: place.map_or(f64::NAN, |point| point.speed_rpm),
        valve: place.map_or(f64::NAN, |point| point.valve_opening_ratio),
        before: before.and_then(eta),
        after: after.and_then(eta),
        correction_sigma,
    }
}
