//! A map corrected for the causes that a gap diagnosis names: identification of the readings without them.

use crate::analysis::gap::Gap;
use crate::analysis::identification::Identified;
use crate::recording::recording_file::Recorded;
use crate::{Session, SessionError, SessionEvent};
use mapper_campaign::Campaign;
use mapper_core::{BudgetRow, IdentifiedPoint, Method, UncertaintyBudget, half_width_95};
use mapper_diagnose::gap::correction::{
    Changes, CorrectedMap, NotCorrected, PointCorrection, one_sigma_away,
};
use mapper_diagnose::gap::diagnose::GapError;
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
    /// Identification of the corrected readings, the uncertainty of the correction in its intervals; that of the readings as recorded if
    /// nothing was corrected.
    pub identified: Identified,
}

impl Session<'_> {
    /// Diagnoses a recording and identifies it again without the causes found. With `directory`, the corrected results are written there as
    /// those of an identification.
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
        let before = identify(recorded.clone())?;
        let without = |hypothesis: &Hypothesis| -> Result<Identified, SessionError> {
            let changes = Changes::of(&gap.diagnosed.study, hypothesis).map_err(GapError::from)?;
            let mut recorded = recorded.clone();
            recorded.read.recording = changes.subtracted_from(recorded.read.recording);
            identify(recorded)
        };
        let causes = match gap.diagnosed.causes_to_correct() {
            Ok(causes) => causes,
            Err(refused) => {
                let map = CorrectedMap {
                    causes: Vec::new(),
                    refused: Some(refused),
                    points: before
                        .points_alone()
                        .map(|point| correction_of(Some(point), None, 0.0))
                        .collect(),
                };
                return Ok(GapCorrection { gap, map, identified: before });
            }
        };
        let mut after = Vec::with_capacity(causes.len());
        for (_, fit) in &causes {
            after.push(without(&fit.hypothesis)?);
        }
        let mut moved = Vec::new();
        for hypothesis in one_sigma_away(&gap.diagnosed.study, causes[0].1) {
            moved.push(without(&hypothesis)?);
        }
        let others = after.split_off(1);
        let Some(mut identified) = after.pop() else { return Err(SessionError::NoRecording) };
        let refused = ambiguous(&identified, &others);
        let named: Vec<_> = causes.iter().map(|(candidate, _)| (*candidate).clone()).collect();
        let mut points = Vec::new();
        for (place, scored) in identified.points.iter_mut().enumerate() {
            let step = scored.point.step;
            let at = |other: &Identified| other.points_alone().find(|point| point.step == step).cloned();
            let of = |read: fn(&IdentifiedPoint) -> Option<f64>| {
                let here = read(&scored.point)?;
                let differences = |others: &[Identified]| {
                    others.iter().filter_map(&at).filter_map(|p| Some(read(&p)? - here)).collect::<Vec<_>>()
                };
                let parameters = differences(&moved).iter().map(|d| d * d).sum::<f64>();
                let equivalents = differences(&others).iter().map(|d| d * d).fold(0.0, f64::max);
                Some((parameters + equivalents).sqrt())
            };
            let (eta_sigma, h_sigma) = (of(|point| point.eta), of(|point| point.h_w_m2k));
            let as_recorded = at(&before);
            if refused.is_none() {
                widen(&mut scored.point, eta_sigma.unwrap_or(0.0), h_sigma.unwrap_or(0.0));
                if let Some(budgets) =
                    identified.budgets.get_mut(place).filter(|budgets| budgets.step == step)
                {
                    add_row(&mut budgets.eta, eta_sigma.unwrap_or(0.0), "");
                    add_row(&mut budgets.h_w_m2k, h_sigma.unwrap_or(0.0), "W/(m2 K)");
                }
            }
            let corrected = refused.is_none().then_some(&scored.point);
            points.push(correction_of(
                as_recorded.as_ref().or(Some(&scored.point)),
                corrected,
                eta_sigma.unwrap_or(0.0),
            ));
        }
        let map = CorrectedMap { causes: named, refused, points };
        if map.refused.is_some() {
            return Ok(GapCorrection { gap, map, identified: before });
        }
        identified.remarks.extend(map.causes.iter().map(|cause| {
            format!(
                "corrected for {}, which the diagnosis of this recording names with {:.0} %: without its correction the efficiencies are \
                 others",
                cause.names.join(" + "),
                100.0 * cause.probability
            )
        }));
        let Some(directory) = directory else { return Ok(GapCorrection { gap, map, identified }) };
        let mut kept = None;
        self.identified_into(vec![recorded.clone()], directory, |_| {
            kept = Some(identified.clone());
            Ok(identified)
        })?;
        let identified = kept.ok_or(SessionError::NoRecording)?;
        Ok(GapCorrection { gap, map, identified })
    }
}

/// Whether the causes that a recording does not distinguish differ at any good point by more than its interval.
fn ambiguous(best: &Identified, others: &[Identified]) -> Option<NotCorrected> {
    let differences =
        best.points_alone().filter(|point| point.verdict == mapper_core::Verdict::Good).filter_map(|point| {
            let (eta, half) = (point.eta?, 0.5 * (point.eta_high? - point.eta_low?));
            let there = |other: &Identified| other.points_alone().find(|other| other.step == point.step)?.eta;
            let difference =
                others.iter().filter_map(there).map(|other| (other - eta).abs()).reduce(f64::max)?;
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
