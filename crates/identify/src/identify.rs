//! From a recording to points: one for each step.

use crate::faults::balances::efficiency::FittedEfficiencies;
use crate::faults::found_fault::{FoundFault, Suspect};
use crate::faults::nominal_rig::NominalRig;
use crate::joint::TwoParameter;
use crate::needs::missing;
use crate::reading_checks::failed_check::FailedCheck;
use crate::reading_checks::failed_checks;
use crate::single_step::dynamic::Estimate;
use crate::step_data::end_state::{EndState, end_state};
use crate::step_data::humidity::with_measured_humidity;
use crate::step_outcome::findings::Findings;
use crate::{
    IdentifyConfig, IdentifyError, PressureTap, StepError, faults, joint,
    single_step::{budgets, dynamic, steady},
};
use mapper_core::{
    Channel, CommonErrors, EstimateUncertainty, Event, EventKind, IdentifiedPoint, LeftOut, Method,
    PointBudgets, Recording, StepMarker, ThermalModel, Warning, WindowRule, confidence_interval_95,
};
use mapper_inference::hypotheses::{Likelihood, Priors};
use mapper_physics::rig::sensor_fault::gain_error;

/// Identifies every step of a recording, in order. Steps without a known position on the map are left out; [`identify_each`] names them with
/// the reason.
///
/// The state of a point (speed, flow, pressure ratio, T1, P1) is the mean over the last
/// [`end_mean_s`](crate::Thresholds::end_mean_s) of its step.
///
/// # Errors
/// [`IdentifyError`] if a channel that the method needs is missing, the recording has no steps, or the configuration is out of range.
pub fn identify(
    recording: &Recording,
    config: &IdentifyConfig,
) -> Result<Vec<IdentifiedPoint>, IdentifyError> {
    Ok(identify_each(recording, config)?.into_iter().filter_map(Result::ok).collect())
}

/// Like [`identify`], with the reason for every step that gives no point.
///
/// # Errors
/// As [`identify`].
pub fn identify_each(
    recording: &Recording,
    config: &IdentifyConfig,
) -> Result<Vec<Result<IdentifiedPoint, StepError>>, IdentifyError> {
    Ok(identify_recording(recording, config, None)?.points)
}

/// Result of the identification of a recording.
#[derive(Debug)]
pub struct Identified {
    /// One for each step, in order; with the reason if a step gives no point.
    pub points: Vec<Result<IdentifiedPoint, StepError>>,
    /// Shared parameters of the points; `None` if the method has none.
    pub thermal: Option<ThermalModel>,
    /// Result of the two-parameter method for the same steps, if it gives one and was not the requested method.
    pub two_parameter: Vec<TwoParameter>,
    /// Faults of sensors or machine that explain contradictions in the recording; empty if there are none.
    pub faults: Vec<FoundFault>,
    /// One standard error of the size of each possible fault, in the fault's unit; infinite if the recording does not determine it. A fault of
    /// six standard errors is found in 95 of 100 recordings.
    pub detectable: Vec<(Suspect, f64)>,
    /// Uncertainty budgets of the points, in order.
    pub budgets: Vec<PointBudgets>,
}

/// Like [`identify_each`], with the shared parameters of the points (joint method alone). Compared with a declared rig, if one is given: points
/// are then doubtful if flow, speed or efficiencies differ from it by more than its tolerances.
///
/// # Errors
/// As [`identify`].
pub fn identify_recording(
    recording: &Recording,
    config: &IdentifyConfig,
    nominal: Option<NominalRig<'_>>,
) -> Result<Identified, IdentifyError> {
    check(config)?;
    let config = &with_measured_humidity(recording, config);
    let missing = missing(recording, config.method);
    if !missing.is_empty() {
        return Err(IdentifyError::MissingChannels { method: config.method, missing });
    }
    if recording.steps.is_empty() {
        return Err(IdentifyError::NoSteps);
    }
    let mut findings = vec![Findings::new(); recording.steps.len()];
    let states: Vec<Result<EndState, StepError>> = recording
        .steps
        .iter()
        .zip(&mut findings)
        .map(|(step, findings)| {
            let (start_s, end_s) = (step.start_s, step.end_s);
            if !(start_s.is_finite() && end_s.is_finite() && start_s < end_s) {
                return Err(StepError::NoDuration { step: step.index, start_s, end_s });
            }
            let state = end_state(recording, step, config, findings)?;
            speed_not_reached(recording, step, &state, findings);
            Ok(state)
        })
        .collect();
    let (alone, own_findings) = if recording.require(Channel::Tc).is_ok() {
        dynamic::alone(recording, &states, config)
    } else {
        Default::default()
    };
    let (mut failed_checks, ends) = failed_checks(recording, config);
    // If half of the recording is already refused, the remainder contradicts itself for that reason.
    let whole = failed_checks.iter().all(|failed_check| 2 * failed_check.steps.len() <= ends.len());
    let likelihood = |fitted: Option<&FittedEfficiencies>| {
        whole.then(|| faults::likelihood(recording, &ends, fitted, config, nominal.as_ref()))?
    };
    let find = |(likelihood, priors): &(Likelihood, Priors)| faults::find(likelihood, priors, config.method);
    let mut balances = likelihood(None);
    let mut faults = balances.as_ref().map(find).unwrap_or_default();
    let known: Vec<Option<EndState>> = states.iter().map(|state| state.as_ref().ok().copied()).collect();
    let is_refused = faults.iter().any(|fault| fault.touches_points)
        || (0..known.len())
            .all(|step| failed_checks.iter().any(|failed_check| failed_check.steps.contains(&step)));
    let together = |findings: &mut [Findings], alone: Vec<Estimate>, own_findings: Vec<Findings>| {
        let known = without_the_refused(known.clone(), &failed_checks, findings);
        joint::estimate(recording, &known, (alone, own_findings), config, is_refused, findings)
    };
    let (mut thermal, mut two_parameter, mut fitted) = (None, Vec::new(), None);
    let mut estimates: Vec<Estimate> = match config.method {
        Method::Joint => {
            let joint = together(&mut findings, alone, own_findings);
            (thermal, two_parameter, fitted) = (joint.thermal, joint.two_parameter, joint.fitted);
            joint.estimates
        }
        method => {
            if whole && nominal.is_some() && !alone.is_empty() {
                // Only the joint fit computes the effect of each sensor error on the efficiencies. The points stay those of the method.
                fitted = together(&mut findings.clone(), alone.clone(), own_findings.clone()).fitted;
            }
            if method == Method::Steady {
                let steps = findings.iter_mut().enumerate();
                let estimate = |(position, findings): (usize, &mut Findings)| match &states[position] {
                    Err(_) => Estimate::default(),
                    Ok(_) => steady::estimate(recording, position, config, findings),
                };
                steps.map(estimate).collect()
            } else {
                findings.iter_mut().zip(own_findings).for_each(|(findings, own)| findings.take(own));
                alone
            }
        }
    };
    if let Some(fitted) = &fitted {
        // The efficiencies carry more information, and about more channels.
        balances = likelihood(Some(fitted));
        faults = balances.as_ref().map(find).unwrap_or_default();
    }
    if let (Some(fitted), Some(balances), true) = (&fitted, &balances, nominal.is_some() && faults.is_empty())
    {
        let readings = faults::all_readings(recording, &ends, config.rest_pressure_pa).unwrap_or_default();
        // Without a density of the balances nothing is known of faults.
        let _ = faults::possible::widen(&mut estimates, fitted, &readings, balances, config);
    }
    failed_checks.extend(faults::failed_check(&faults, ends.len()));
    if let Some(remark) = faults::remark(&faults) {
        findings.iter_mut().for_each(|findings| findings.remark(remark.clone()));
    }
    // Doubts about the readings come first: all other findings depend on them.
    for failed_check in failed_checks.iter().rev() {
        for position in &failed_check.steps {
            findings[*position].doubt_first(failed_check.warning.clone());
        }
    }
    let (points, budgets) = points_with_budgets(recording, states, &estimates, findings, config);
    let standard_errors = balances.map(|(likelihood, priors)| faults::standard_errors(&likelihood, &priors));
    let detectable = standard_errors.unwrap_or_default();
    Ok(Identified { points, thermal, two_parameter, faults, detectable, budgets })
}

/// The points, and the budgets of those that there are.
fn points_with_budgets(
    recording: &Recording,
    states: Vec<Result<EndState, StepError>>,
    estimates: &[Estimate],
    findings: Vec<Findings>,
    config: &IdentifyConfig,
) -> (Vec<Result<IdentifiedPoint, StepError>>, Vec<PointBudgets>) {
    let points: Vec<Result<IdentifiedPoint, StepError>> = recording
        .steps
        .iter()
        .zip(states)
        .zip(estimates)
        .zip(findings)
        .map(|(((step, state), estimate), findings)| Ok(point(step, &state?, estimate, findings, config)))
        .collect();
    let of_steps = points.iter().zip(estimates).zip(&recording.steps);
    let budgets = of_steps
        .filter_map(|((point, estimate), step)| {
            let start_s = step.end_s - config.thresholds.end_mean_s;
            let samples = |channel: Channel| {
                recording.series.get(&channel).map_or(1, |series| series.range(start_s, step.end_s).len())
            };
            Some(budgets::of_point(point.as_ref().ok()?, estimate, samples, config))
        })
        .collect();
    (points, budgets)
}

/// The steps that contribute to the shared parameters: steps with a failed check would bias the others. Samples of a temporarily frozen
/// channel are omitted, and the rest of the step is used.
fn without_the_refused(
    mut known: Vec<Option<EndState>>,
    failed_checks: &[FailedCheck],
    findings: &mut [Findings],
) -> Vec<Option<EndState>> {
    let mut refused = vec![false; known.len()];
    let whole = failed_checks.iter().filter(|failed_check| !failed_check.samples_left_out);
    whole.flat_map(|failed_check| &failed_check.steps).for_each(|position| refused[*position] = true);
    let few = refused.iter().any(|refused| !refused);
    for (position, _) in refused.iter().enumerate().filter(|(_, refused)| few && **refused) {
        if known[position].take().is_some() {
            findings[position].doubt(Warning::LeftOut(LeftOut::Readings));
        }
    }
    known
}

/// Adds the run's remarks that a step's speed was not reached: the point is valid, but elsewhere on the map.
fn speed_not_reached(recording: &Recording, step: &StepMarker, state: &EndState, findings: &mut Findings) {
    let reported = |event: &Event| {
        event.kind == EventKind::SpeedNotReached && event.t_s > step.start_s && event.t_s <= step.end_s
    };
    if let (Some(asked), true) = (step.to, recording.events.iter().any(reported)) {
        findings.remark(Warning::SpeedNotReached {
            requested_rpm: asked.speed_rpm,
            reached_rpm: state.speed_rpm,
        });
    }
}

pub(crate) fn check(config: &IdentifyConfig) -> Result<(), IdentifyError> {
    let share = |name, value: f64| (name, value, (0.0..=1.0).contains(&value), "a share from 0 to 1");
    let positive = |name, value: f64, expected| (name, value, value.is_finite() && value > 0.0, expected);
    let colour = config.noise_colour;
    let mut checks = vec![
        share("alpha_area_ratio", config.alpha_area_ratio),
        share("alpha_area_sigma_ratio", config.alpha_area_sigma_ratio),
        share("internal_area_sigma_ratio", config.internal_area_sigma_ratio),
        positive("internal_area_m2", config.internal_area_m2, "a positive area, m2"),
        positive("time_constant_s", colour.time_constant_s, "a positive time, s"),
        share("first_order_share_ratio", colour.first_order_share_ratio),
    ];
    for tap in [config.inlet_tap, config.outlet_tap] {
        if let PressureTap::Static { pipe_diameter_m } = tap {
            checks.push(positive("pipe_diameter_m", pipe_diameter_m, "a positive diameter, m"));
        }
    }
    if let WindowRule::Fixed { start_s, end_s } = config.window {
        checks.push(("start_s", start_s, start_s >= 0.0, "0 s or more after the jump"));
        checks.push(("end_s", end_s, end_s > start_s, "later than the window's start"));
    }
    match checks.into_iter().find(|(_, _, usable, _)| !usable) {
        Some((name, value, _, expected)) => Err(IdentifyError::Config { name, value, expected }),
        None => Ok(()),
    }
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
        let relative = (declared.offset_sigma / reading).hypot(
            declared.gain_sigma_ratio * gain_error(channel, reading, config.rest_pressure_pa) / reading,
        );
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
