//! From a recording to points: one for each step.

use crate::dynamic::Estimate;
use crate::end_state::{EndState, end_state};
use crate::findings::{Findings, code};
use crate::joint::AsFitted;
use crate::needs::missing;
use crate::nominal_map::{NominalRig, Offset, doubt, off_the_map, offset, reach};
use crate::objections::housing::Balance;
use crate::objections::objection::Objection;
use crate::objections::objections;
use crate::two_parameter::TwoParameter;
use crate::{IdentifyConfig, IdentifyError, PressureTap, StepError, dynamic, joint, steady};
use mapper_core::{
    Channel, CommonErrors, EstimateUncertainty, Event, EventKind, IdentifiedPoint, Method, Recording,
    StepMarker, ThermalModel, Verdict, WindowRule, confidence_interval_95,
};

/// Standard deviations of an offset by `dynamic` from which on it is worth asking `joint`, which tells it better: one sound recording in three.
const HINT_SIGMAS: f64 = 1.0;

/// Identifies every step of a recording, in order. Steps of which not even the place on the map is known are left
/// out; [`identify_each`] says which and why.
///
/// The state of a point (speed, flow, pressure ratio, T1, P1) is the mean over the last
/// [`end_mean_s`](crate::Thresholds::end_mean_s) of its step.
///
/// # Errors
/// [`IdentifyError`] where a channel that the method needs is missing, there are no steps, or the configuration is out
/// of range.
pub fn identify(
    recording: &Recording,
    config: &IdentifyConfig,
) -> Result<Vec<IdentifiedPoint>, IdentifyError> {
    Ok(identify_each(recording, config)?.into_iter().filter_map(Result::ok).collect())
}

/// As [`identify`], with the reason for every step that gives no point.
///
/// # Errors
/// As [`identify`].
pub fn identify_each(
    recording: &Recording,
    config: &IdentifyConfig,
) -> Result<Vec<Result<IdentifiedPoint, StepError>>, IdentifyError> {
    Ok(identify_recording(recording, config)?.points)
}

/// What a recording gives.
#[derive(Debug)]
pub struct Identified {
    /// One for each step, in order; with the reason where a step gives no point.
    pub points: Vec<Result<IdentifiedPoint, StepError>>,
    /// What the points share; `None` where the method finds nothing of the kind.
    pub thermal: Option<ThermalModel>,
    /// What the two-parameter method makes of the same steps, where it makes anything of them and was not the one asked for.
    pub two_parameter: Vec<TwoParameter>,
}

/// As [`identify_each`], with what the points share (joint method alone).
///
/// # Errors
/// As [`identify`].
pub fn identify_recording(
    recording: &Recording,
    config: &IdentifyConfig,
) -> Result<Identified, IdentifyError> {
    identify_beside(recording, config, None)
}

/// As [`identify_recording`], beside a rig that is declared to be known: flow, speed and efficiencies that lie off it by more than
/// its tolerances make the points doubtful.
///
/// # Errors
/// As [`identify`].
pub fn identify_beside(
    recording: &Recording,
    config: &IdentifyConfig,
    nominal: Option<NominalRig<'_>>,
) -> Result<Identified, IdentifyError> {
    let mut found = identified(recording, config, nominal.as_ref(), Balance::Asked)?;
    let any_good = found.points().any(|point| point.verdict == Verdict::Good);
    let Some(nominal) = nominal.filter(|_| any_good) else { return Ok(found.identified) };
    let said = beside_the_nominal_map(recording, config, &nominal, &found);
    let points = &mut found.identified.points;
    match said {
        None => {}
        Some(Said::Against(message)) => doubt(
            points
                .iter_mut()
                .flatten()
                .filter(|point| config.method == Method::Steady || point.eta.is_some()),
            &message,
        ),
        Some(Said::Likely(offset)) => reach(points, offset, &config.thresholds),
    }
    Ok(found.identified)
}

/// What the nominal map says of a recording's points.
enum Said {
    /// They are not to be trusted, and why.
    Against(String),
    /// An offset that their intervals have to reach to.
    Likely(Offset),
}

/// `None` where nothing speaks against the points.
fn beside_the_nominal_map(
    recording: &Recording,
    config: &IdentifyConfig,
    nominal: &NominalRig<'_>,
    found: &Found,
) -> Option<Said> {
    let map = nominal.model.map.as_ref();
    let off = |found: &Found| {
        let points: Vec<IdentifiedPoint> = found.points().cloned().collect();
        off_the_map(&points, map, config.reference, nominal.tolerances)
    };
    let offset = |points: Vec<IdentifiedPoint>| offset(&points, map, config.reference, nominal.tolerances);
    let of_offset = |told: Offset| match told.objection() {
        Some(message) => Some(Said::Against(message)),
        None => told.is_likely().then_some(Said::Likely(told)),
    };
    if config.method == Method::Joint {
        return off(found).map(Said::Against).or_else(|| of_offset(offset(found.as_fitted())?));
    }
    recording.require(Channel::Tc).ok()?;
    let by = |method: Method| {
        identified(recording, &IdentifyConfig { method, ..config.clone() }, None, Balance::NotAsked).ok()
    };
    let other = if config.method == Method::Dynamic { None } else { Some(by(Method::Dynamic)?) };
    let dynamic = other.as_ref().unwrap_or(found);
    let by_dynamic = off(dynamic);
    if let (Method::Dynamic, Some(message)) = (config.method, &by_dynamic) {
        return Some(Said::Against(message.clone()));
    }
    let hint = offset(dynamic.points().cloned().collect());
    if by_dynamic.is_none() && hint.is_some_and(|hint| hint.sigmas().abs() < HINT_SIGMAS) {
        return None;
    }
    let joint = by(Method::Joint)?;
    // An apparent efficiency cannot be held against a map: both methods that see the heat find theirs off it, or the second none that are
    // good. One of them alone may lack what the machine has.
    let none_good = joint.points().all(|point| point.verdict != Verdict::Good);
    if let Some(message) = by_dynamic.filter(|_| none_good || off(&joint).is_some()) {
        return Some(Said::Against(message));
    }
    // `joint` tells an offset better than `dynamic`, which holds h constant.
    let told = offset(joint.as_fitted())?;
    of_offset(told).filter(|_| hint.is_none_or(|hint| hint.found_k * told.found_k > 0.0))
}

/// What a method makes of a recording.
struct Found {
    identified: Identified,
    /// Efficiencies of `joint` before the smoothness of the map had its say, one for each step; empty where there are none.
    as_fitted: Vec<Option<AsFitted>>,
}

impl Found {
    fn points(&self) -> impl Iterator<Item = &IdentifiedPoint> {
        self.identified.points.iter().flatten()
    }

    /// The points with the efficiencies before smoothness had its say.
    fn as_fitted(&self) -> Vec<IdentifiedPoint> {
        let steps = self.identified.points.iter().zip(&self.as_fitted);
        let point = |(point, fitted): (&Result<IdentifiedPoint, StepError>, &Option<AsFitted>)| {
            let (mut point, fitted) = (point.as_ref().ok()?.clone(), fitted.as_ref()?);
            let (low, high) = confidence_interval_95(fitted.eta, fitted.error);
            (point.eta, point.eta_low, point.eta_high) = (Some(fitted.eta), Some(low), Some(high));
            point.common.eta_changes.clone_from(&fitted.common);
            Some(point)
        };
        steps.filter_map(point).collect()
    }
}

fn identified(
    recording: &Recording,
    config: &IdentifyConfig,
    nominal: Option<&NominalRig<'_>>,
    balance: Balance,
) -> Result<Found, IdentifyError> {
    check(config)?;
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
    let (alone, told) = if recording.require(Channel::Tc).is_ok() {
        dynamic::alone(recording, &states, config)
    } else {
        Default::default()
    };
    let objections = objections(recording, &alone, config, nominal, balance);
    let (mut thermal, mut two_parameter, mut as_fitted) = (None, Vec::new(), Vec::new());
    let estimates: Vec<Estimate> = match config.method {
        Method::Joint => {
            let known: Vec<Option<EndState>> =
                states.iter().map(|state| state.as_ref().ok().copied()).collect();
            let condemned = !objections.is_empty()
                && (0..known.len())
                    .all(|step| objections.iter().any(|objection| objection.steps.contains(&step)));
            let known = without_the_refused(known, &objections, &mut findings);
            let joint = joint::estimate(recording, &known, (alone, told), config, condemned, &mut findings);
            thermal = joint.thermal;
            two_parameter = joint.two_parameter;
            as_fitted = joint.as_fitted;
            joint.estimates
        }
        Method::Dynamic | Method::Imported => {
            findings.iter_mut().zip(told).for_each(|(findings, told)| findings.take(told));
            alone
        }
        Method::Steady => findings
            .iter_mut()
            .enumerate()
            .map(|(position, findings)| match &states[position] {
                Err(_) => Estimate::default(),
                Ok(_) => steady::estimate(recording, position, config, findings),
            })
            .collect(),
    };
    // First what speaks against the readings: whatever else is said of a point rests on them.
    for objection in objections.iter().rev() {
        for position in &objection.steps {
            findings[*position].doubt_first(objection.code, objection.message.clone());
        }
    }
    let points = recording
        .steps
        .iter()
        .zip(states)
        .zip(estimates)
        .zip(findings)
        .map(|(((step, state), estimate), findings)| Ok(point(step, &state?, &estimate, findings, config)))
        .collect();
    Ok(Found { identified: Identified { points, thermal, two_parameter }, as_fitted })
}

/// The steps that may have a say in what all share: where an objection is to a few, they would spoil the others. Samples of a channel that
/// is frozen for a while are left out by themselves, and the rest of the step speaks.
fn without_the_refused(
    mut known: Vec<Option<EndState>>,
    objections: &[Objection],
    findings: &mut [Findings],
) -> Vec<Option<EndState>> {
    let mut refused = vec![false; known.len()];
    let whole = objections.iter().filter(|objection| !objection.samples_left_out);
    whole.flat_map(|objection| &objection.steps).for_each(|position| refused[*position] = true);
    let few = refused.iter().any(|refused| !refused);
    for (position, _) in refused.iter().enumerate().filter(|(_, refused)| few && **refused) {
        if known[position].take().is_some() {
            let message =
                "this step does not count in what the points share, and has no numbers of its own".to_owned();
            findings[position].doubt(code::LEFT_OUT, message);
        }
    }
    known
}

/// Remarks that the run has told that a step's speed was not reached: the point is as good as any, but elsewhere on the map.
fn speed_not_reached(recording: &Recording, step: &StepMarker, state: &EndState, findings: &mut Findings) {
    let told = |event: &Event| {
        event.kind == EventKind::SpeedNotReached && event.t_s > step.start_s && event.t_s <= step.end_s
    };
    if let (Some(asked), true) = (step.to, recording.events.iter().any(told)) {
        let message = format!(
            "{:.2} krpm were asked for and {:.2} krpm reached",
            asked.speed_rpm / 1e3,
            state.speed_rpm / 1e3
        );
        findings.remark(code::SPEED_NOT_REACHED, message);
    }
}

pub(crate) fn check(config: &IdentifyConfig) -> Result<(), IdentifyError> {
    let mut checks = vec![
        (
            "alpha_area_ratio",
            config.alpha_area_ratio,
            (0.0..=1.0).contains(&config.alpha_area_ratio),
            "a share from 0 to 1",
        ),
        (
            "alpha_area_sigma_ratio",
            config.alpha_area_sigma_ratio,
            (0.0..=1.0).contains(&config.alpha_area_sigma_ratio),
            "a share from 0 to 1",
        ),
        (
            "internal_area_m2",
            config.internal_area_m2,
            config.internal_area_m2.is_finite() && config.internal_area_m2 > 0.0,
            "a positive area, m2",
        ),
        (
            "time_constant_s",
            config.noise_colour.time_constant_s,
            config.noise_colour.time_constant_s.is_finite() && config.noise_colour.time_constant_s > 0.0,
            "a positive time, s",
        ),
        (
            "first_order_share_ratio",
            config.noise_colour.first_order_share_ratio,
            (0.0..=1.0).contains(&config.noise_colour.first_order_share_ratio),
            "a share from 0 to 1",
        ),
    ];
    for tap in [config.inlet_tap, config.outlet_tap] {
        if let PressureTap::Static { pipe_diameter_m } = tap {
            let usable = pipe_diameter_m.is_finite() && pipe_diameter_m > 0.0;
            checks.push(("pipe_diameter_m", pipe_diameter_m, usable, "a positive diameter, m"));
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

fn point(
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
        flow_corrected_kg_s: config.reference.corrected_flow_kg_s(state.flow_kg_s, state.t1_k, state.p1_pa),
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

/// What all points share: of their numbers as the method has it, of their place as declared.
fn common_errors(state: &EndState, estimate: &Estimate, config: &IdentifyConfig) -> CommonErrors {
    let relative = |channel: Channel, reading: f64| {
        let declared = config.declared.get(&channel).copied().unwrap_or_default();
        let relative = (declared.offset_sigma / reading).hypot(declared.gain_sigma_ratio);
        // A reading of 0 has no relative error, and no place on a map.
        if relative.is_finite() { relative } else { 0.0 }
    };
    let flow = relative(Channel::CompressorFlow, state.flow_kg_s);
    let p1 = relative(Channel::P1, state.p1_pa);
    let p2 = relative(Channel::P2, state.p1_pa * state.pressure_ratio);
    let [eta_changes, h_changes_w_m2k] = estimate.common.clone();
    CommonErrors {
        eta_changes,
        h_changes_w_m2k,
        // Corrected flow goes with the root of T1 and with 1/P1.
        flow_corrected_standard_error_ratio: flow.hypot(p1).hypot(0.5 * relative(Channel::T1, state.t1_k)),
        pressure_ratio_standard_error: state.pressure_ratio * p1.hypot(p2),
    }
}
