//! The points of a recording: estimates with their state, interval, common errors and budgets.

use crate::allowance;
use crate::faults::found_fault::FoundFault;
use crate::single_step::budgets;
use crate::single_step::dynamic::Estimate;
use crate::step_data::end_state::EndState;
use crate::step_outcome::findings::Findings;
use crate::{IdentifyConfig, StepError};
use mapper_core::{
    Channel, CommonErrors, EstimateUncertainty, IdentifiedPoint, PointBudgets, Recording, StepMarker,
    confidence_interval_95,
};

pub(crate) fn points_with_budgets(
    recording: &Recording,
    found: Vec<(Result<EndState, StepError>, Findings)>,
    estimates: &[Estimate],
    faults: &[FoundFault],
    config: &IdentifyConfig,
) -> (Vec<Result<IdentifiedPoint, StepError>>, Vec<PointBudgets>) {
    let mut all = Vec::new();
    let mut of_step = |step: &StepMarker,
                       (state, findings): (Result<EndState, StepError>, _),
                       estimate: &Estimate| {
        let state = state?;
        let mut point = point(step, &state, estimate, findings, config);
        if let Some(opening_ratio) = faults.iter().find_map(|fault| fault.valve_opening_ratio(step.index)) {
            point.valve_opening_ratio = opening_ratio;
        }
        let start_s = step.end_s - config.thresholds.end_mean_s;
        let samples = |channel: Channel| {
            recording.series.get(&channel).map_or(1, |series| series.range(start_s, step.end_s).len())
        };
        let eta_allowance = point.eta.and_then(|eta| allowance::budget(eta, &state, config));
        all.push(budgets::of_point(&point, eta_allowance, estimate, samples, config));
        Ok(point)
    };
    let steps = recording.steps.iter().zip(found).zip(estimates);
    let points = steps.map(|((step, found), estimate)| of_step(step, found, estimate)).collect();
    (points, all)
}

pub(crate) fn point(
    step: &StepMarker,
    state: &EndState,
    estimate: &Estimate,
    findings: Findings,
    config: &IdentifyConfig,
) -> IdentifiedPoint {
    let interval = |quantity: Option<(f64, Option<EstimateUncertainty>)>| {
        let (value, uncertainty) = quantity?;
        Some(confidence_interval_95(value, uncertainty?.combined_standard_error()))
    };
    let (eta_interval, h_interval) = match estimate.intervals {
        Some([eta, h]) => (Some(eta), Some(h)),
        None => (interval(estimate.eta), interval(estimate.h_w_m2k)),
    };
    IdentifiedPoint {
        step: step.index,
        kind: step.kind,
        target: step.to,
        speed_rpm: state.speed_rpm,
        valve_opening_ratio: step.valve_opening_ratio,
        flow_kg_s: state.flow_kg_s,
        flow_corrected_kg_s: config.corrected_flow_kg_s(state.flow_kg_s, state.t1_k, state.p1_pa),
        speed_corrected_rpm: config.reference.corrected_speed_rpm(state.speed_rpm, state.t1_k),
        pressure_ratio: state.pressure_ratio,
        t1_k: state.t1_k,
        p1_pa: state.p1_pa,
        eta: estimate.eta.map(|(value, _)| value),
        eta_low: eta_interval.map(|(low, _)| low),
        eta_high: eta_interval.map(|(_, high)| high),
        eta_allowance: estimate
            .eta
            .and_then(|(eta, _)| allowance::budget(eta, state, config))
            .map(|budget| budget.expanded_uncertainty),
        eta_uncertainty: estimate.eta.and_then(|(_, uncertainty)| uncertainty),
        h_w_m2k: estimate.h_w_m2k.map(|(value, _)| value),
        h_low_w_m2k: h_interval.map(|(low, _)| low),
        h_high_w_m2k: h_interval.map(|(_, high)| high),
        h_uncertainty: estimate.h_w_m2k.and_then(|(_, uncertainty)| uncertainty),
        common: common_errors(state, estimate, config),
        method: config.method,
        verdict: findings.verdict,
        warnings: findings.warnings,
        window: estimate.window,
        residual_rms_k: estimate.residual_rms_k,
        dt2_k: estimate.dt2_k,
        dtc_k: estimate.dtc_k,
    }
}

/// Common errors of all points: of their numbers as the method reports them, of their position as declared.
fn common_errors(state: &EndState, estimate: &Estimate, config: &IdentifyConfig) -> CommonErrors {
    let relative = |channel: Channel, reading: f64| {
        let declared = config.sensor(channel);
        let relative = (declared.offset_sigma / reading)
            .hypot(declared.gain_sigma_ratio * config.exact_at.gain_error(channel, reading) / reading);
        // A reading of 0 has no relative error and no position on a map.
        if relative.is_finite() { relative } else { 0.0 }
    };
    let flow = relative(Channel::CompressorFlow, state.flow_kg_s);
    let p1 = relative(Channel::P1, state.p1_pa);
    let p2 = relative(Channel::P2, state.p1_pa * state.pressure_ratio);
    let [eta_changes, h_changes_w_m2k] = estimate.common.clone();
    CommonErrors {
        eta_changes,
        h_changes_w_m2k,
        // Corrected flow is proportional to the root of T1 and to 1/P1.
        flow_corrected_standard_error_ratio: flow.hypot(p1).hypot(0.5 * relative(Channel::T1, state.t1_k)),
        // An error of the barometer moves both pressures.
        pressure_ratio_standard_error: state.pressure_ratio
            * p1.hypot(p2)
                .hypot(config.barometer_sigma_pa / state.p1_pa * (1.0 - state.pressure_ratio.recip())),
    }
}
