//! Prepares a diagnosis, and checks its preconditions.

use crate::drift::{self, CauseKind, DriftReport, DriftRequest, RecordedRun, without_drift};
use crate::gap::best_fit::fit::{Effort, adequacy, fit};
use crate::gap::best_fit::normal::Selection;
use crate::gap::causes::additions::Calibration;
use crate::gap::experiment::{GapWarning, OffsetAtRest};
use crate::gap::request::RigRecording;
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::{PredictError, Study};
use crate::gap::residuals::true_inputs::Actuators;
use crate::gap::residuals::whiten::Linearised;
use mapper_core::unit_factors::{PA_PER_KPA, PERCENT};
use mapper_core::{
    Channel, DeclaredUncertainty, Implausible, Recording, Soak, StepMarker, check_running, is_commanded_jump,
    step_number,
};
use mapper_identify::{ZeroOutcome, ZeroSettings};
use mapper_numerics::statistics::median;
use mapper_observe::averages::{GAP_INTERVALS, INPUT_CHANNELS, Table};
use mapper_observe::declared::Declared;
use mapper_observe::model_inputs::lagged_command::Response;
use mapper_physics::rig::effect::Effect;
use mapper_physics::simulation::model::Model;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Minimum predicted rise for a ratio to it, in its unit. Bound: avoids a division by zero.
const MIN_RISE: f64 = 1e-9;
/// Part of a step at its end in which actuators have arrived, as a share. Bound: steps are several times longer than an actuator moves.
const ARRIVED_SHARE: f64 = 0.2;
/// Maximum median deviation of P3 from its command, as a share. Bound: controllers and regulators hold a few per cent.
const MAX_COMMAND_ERROR_SHARE: f64 = 0.1;

pub(crate) fn assumed(study: &Study) -> Vec<String> {
    let t = &study.declared.tolerances;
    let tolerances = [
        ("gain of the flow meter", t.flow_meter_gain_ratio),
        ("flow of the compressor map", t.flow_map_ratio),
        ("compressor efficiency", t.compressor_efficiency_ratio),
        ("shape of the efficiency map", t.efficiency_shape_ratio),
        ("turbine efficiency", t.turbine_efficiency_ratio),
        ("valve area", t.valve_area_ratio),
        ("convection", t.convection_ratio),
        ("external convection", t.external_convection_ratio),
        ("conductance to the oil", t.oil_conductance_ratio),
    ]
    .map(|(tolerance, ratio)| format!("{tolerance} {} %", PERCENT * ratio));
    let lag_and_rate = |response: Response, scale: f64, unit: &str| {
        let mut lag = format!("a lag of {:.2} s", response.lag_s);
        if response.dead_time_s > 0.0 {
            lag = format!("{lag} after a dead time of {:.2} s", response.dead_time_s);
        }
        if response.slew_per_s.is_finite() {
            format!("{lag} and at most {:.3} {unit}", scale * response.slew_per_s)
        } else {
            lag
        }
    };
    vec![
        format!(
            "the campaign declares no tolerances; default tolerances, one sigma: {}",
            tolerances.join(", ")
        ),
        format!(
            "the responses of the actuators are estimated from the recording and not diagnosed: P3 has {}, the valve {}",
            lag_and_rate(study.actuators.p3, 1.0 / PA_PER_KPA, "kPa/s"),
            lag_and_rate(study.actuators.valve, 1.0, "openings/s"),
        ),
    ]
}

/// Deviations at the end of a step that no rig effect causes: of speed, flows, and the compressor's pressure and temperature rise.
/// Bound: twice what the worst effect of the library does to each; another machine of the same class differs more.
const ANOTHER_MACHINE_RATIO: [(Channel, f64); 5] = [
    (Channel::ShaftSpeed, 0.25),
    (Channel::CompressorFlow, 0.4),
    (Channel::TurbineFlow, 0.4),
    (Channel::P2, 0.4),
    (Channel::T2, 0.6),
];

/// Rejects a recording that is far from the nominal prediction.
pub(crate) fn another_machine(study: &Study, predicted: &[f64]) -> Result<(), Problem> {
    let mut worst: Option<(f64, Channel, f64)> = None;
    for (channel, limit) in ANOTHER_MACHINE_RATIO {
        let nominal = &study.declared.nominal;
        // Compare rises, not levels.
        let zero = match channel {
            Channel::P2 => nominal.p1_pa,
            Channel::T2 => nominal.t1_k,
            _ => 0.0,
        };
        let mut away: Vec<f64> = study
            .groups
            .iter()
            .filter(|group| OUTPUTS[group.output] == channel)
            .filter_map(|group| group.rows.clone().last())
            .map(|row| (study.measured[row] - zero) / (predicted[row] - zero).max(MIN_RISE) - 1.0)
            .collect();
        away.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let Some(median) = away.get(away.len() / 2) else { continue };
        if median.abs() > limit && worst.is_none_or(|(most, ..)| median.abs() / limit > most) {
            worst = Some((median.abs() / limit, channel, PERCENT * median));
        }
    }
    worst.map_or(Ok(()), |(_, channel, percent)| Err(Problem::OtherMachine { channel, percent }))
}

/// Condition that prevents a diagnosis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum Problem {
    #[error("the recording has no measured channel with samples; check its channel map")]
    Empty,
    #[error(
        "the recording has {steps} step(s) and too few jumps of P3 or valve: a diagnosis needs jumps between at least 3 points; record a campaign, and map P3_command and valve_command"
    )]
    NoJumps { steps: usize },
    #[error(
        "too few channels are measured: of N, m_c, P2, T2, Tc, m_t, T4 and Tt only {present}; record at least N, P2 and T2"
    )]
    TooFewOutputs { present: String },
    /// `percent`: signed, of the nominal value, for the channel that deviates most.
    #[error(
        "{channel} deviates by {percent:.0} % from the nominal machine under the recorded P3, T3 and valve, in at least half of the steps: the recording is of another machine, or a scale is wrong; check machine and map of the campaign"
    )]
    OtherMachine { channel: Channel, percent: f64 },
    #[error(transparent)]
    Implausible(#[from] Implausible),
    #[error("{channel} ({}) drives the model and is not recorded: record it and map its column", .channel.info().description)]
    NoDriver { channel: Channel },
    #[error(
        "the valve opening of step {} is not recorded, but it drives the model: map the commanded or measured opening as `valve_command`, or give it among `constants`; without it, `mapper transient` diagnoses the compressor side from its measured neighbours",
        step_number(*step)
    )]
    NoValve { step: usize },
    /// Medians of a step.
    #[error(
        "measured P3 is {measured_pa:.0} Pa where {commanded_pa:.0} Pa is commanded: the two do not belong together; check the channel map and the units"
    )]
    NotCommanded { measured_pa: f64, commanded_pa: f64 },
    #[error(
        "the baseline has {baseline} step(s), the recording under diagnosis {recorded}, but only equal steps can be compared: record a baseline of the same plan"
    )]
    OtherSteps { baseline: usize, recorded: usize },
    #[error(
        "step {} of the baseline differs: its {what} is {baseline:.3} {unit}, that of the recording under diagnosis {recorded:.3} {unit} (allowed difference {within:.3} {unit}); record a baseline of the same plan",
        step_number(*step)
    )]
    OtherStep {
        step: usize,
        what: &'static str,
        baseline: f64,
        recorded: f64,
        unit: &'static str,
        within: f64,
    },
}

/// Why a recording cannot be diagnosed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum GapError {
    #[error(transparent)]
    Recording(#[from] Problem),
    #[error(
        "the nominal model cannot follow this recording: {0}; check that the recording is of this machine"
    )]
    Predict(#[from] PredictError),
}

/// Checks a recording and prepares its study; returns warnings for tolerable defects.
pub(crate) fn checked_study(
    recording: &Recording,
    declared: Declared,
    model: Model,
    effects: Vec<Arc<dyn Effect>>,
    tolerances_declared: bool,
) -> Result<(Study, Vec<GapWarning>), GapError> {
    let table = Table::new(recording).ok_or(Problem::Empty)?;
    let warnings = usable(recording, &table, &declared)?;
    let actuators = Actuators::of(&table, recording, (&declared, &model), tolerances_declared);
    Ok((Study::with_actuators(recording, table, declared, model, effects, actuators), warnings))
}

pub(crate) fn usable(
    recording: &Recording,
    table: &Table,
    declared: &Declared,
) -> Result<Vec<GapWarning>, Problem> {
    let mut warnings = Vec::new();
    let present: Vec<Channel> = OUTPUTS
        .into_iter()
        .filter(|channel| *channel != Channel::P3)
        .filter(|channel| table.column(*channel).is_some_and(|c| c.iter().any(|v| v.is_finite())))
        .collect();
    for needed in [Channel::ShaftSpeed, Channel::P2, Channel::T2] {
        if !present.contains(&needed) {
            let present = present.iter().map(|c| c.symbol()).collect::<Vec<_>>().join(", ");
            return Err(Problem::TooFewOutputs {
                present: if present.is_empty() { "none".into() } else { present },
            });
        }
    }
    for channel in [Channel::P3, Channel::T3, Channel::T1, Channel::P1] {
        if table.column(channel).is_none_or(|c| c.iter().all(|v| !v.is_finite())) {
            return Err(Problem::NoDriver { channel });
        }
    }
    if let Some(step) = recording.steps.iter().find(|step| !step.valve_opening_ratio.is_finite()) {
        return Err(Problem::NoValve { step: step.index });
    }
    // A soak before the first step may be longer than all steps.
    let starts_s = recording.steps.first().map_or(f64::NEG_INFINITY, |step| step.start_s);
    let running = table.range(starts_s, f64::INFINITY);
    for (channel, values) in &table.columns {
        middle(&values[running.clone()]).map_or(Ok(()), |middle| check_running(*channel, middle))?;
    }
    let commands = |step: &StepMarker| (step.p3_pa, step.valve_opening_ratio);
    let jumps = recording
        .steps
        .windows(2)
        .filter(|pair| is_commanded_jump(commands(&pair[0]), commands(&pair[1])))
        .count();
    if jumps < 2 {
        return Err(Problem::NoJumps { steps: recording.steps.len() });
    }
    commanded(recording, table)?;
    for channel in OUTPUTS.into_iter().filter(|channel| *channel != Channel::P3 && !present.contains(channel))
    {
        warnings.push(GapWarning::ChannelNotRecorded { channel });
    }
    for channel in INPUT_CHANNELS {
        if table.column(channel).is_none() {
            warnings.push(GapWarning::InputNotRecorded { channel });
        }
    }
    warnings.extend(gaps(table));
    for channel in &present {
        if declared.of(*channel).noise_sigma <= 0.0 {
            let noise_sigma = declared.noise_sigma(*channel);
            warnings.push(GapWarning::AssumedNoise { channel: *channel, noise_sigma });
        }
    }
    Ok(warnings)
}

fn middle(values: &[f64]) -> Option<f64> {
    median(values.iter().filter(|value| value.is_finite()))
}

fn commanded(recording: &Recording, table: &Table) -> Result<(), Problem> {
    let Some(values) = table.column(Channel::P3) else { return Ok(()) };
    let mut away: Vec<(f64, f64, f64)> = Vec::new();
    for step in &recording.steps {
        // The last part: any actuator has arrived by then.
        let range = table.range(step.end_s - ARRIVED_SHARE * (step.end_s - step.start_s), step.end_s);
        // A speed controller has moved the command since the step began.
        let held_pa =
            recording.series.get(&Channel::P3Command).filter(|_| step.to.is_some()).and_then(|command| {
                let inside =
                    command.range(step.start_s, step.end_s).rfind(|i| command.t_s[*i] < step.end_s)?;
                Some(command.values[inside])
            });
        let commanded_pa = held_pa.unwrap_or(step.p3_pa);
        if let (Some(measured_pa), true) = (middle(&values[range]), commanded_pa.is_finite()) {
            away.push(((measured_pa / commanded_pa - 1.0).abs(), measured_pa, commanded_pa));
        }
    }
    away.sort_by(|a, b| a.0.total_cmp(&b.0));
    match away.get(away.len() / 2) {
        Some((share, measured_pa, commanded_pa)) if *share > MAX_COMMAND_ERROR_SHARE => {
            Err(Problem::NotCommanded { measured_pa: *measured_pa, commanded_pa: *commanded_pa })
        }
        _ => Ok(()),
    }
}

fn gaps(table: &Table) -> Option<GapWarning> {
    let gap = |pair: &[f64]| pair[1] - pair[0] > GAP_INTERVALS * table.interval_s;
    let missing_s: f64 = table.t_s.windows(2).filter(|pair| gap(pair)).map(|pair| pair[1] - pair[0]).sum();
    let gaps = table.t_s.windows(2).filter(|pair| gap(pair)).count();
    (gaps > 0).then_some(GapWarning::GapsInRecording { gaps, missing_s })
}

pub(crate) struct Prepared {
    pub(crate) zeroed: Zeroed,
    /// The drift that was found, if it is credible; that of sensors is subtracted.
    pub(crate) drift: Option<DriftReport>,
    /// Why an apparent drift was not subtracted: tolerances alone explain the recording down to noise.
    pub(crate) rejected_drift: Option<String>,
    /// The recording linearised at the nominal model, if it is known already.
    pub(crate) linearised: Option<Linearised>,
}

pub(crate) struct Zeroed {
    pub(crate) recording: Recording,
    pub(crate) declared: Declared,
    pub(crate) zero: ZeroOutcome,
    pub(crate) offsets_at_rest: Vec<OffsetAtRest>,
}

/// Whether a drift is one of sensors alone, which is subtracted from their readings.
pub(crate) fn is_of_sensors(drift: &DriftReport) -> bool {
    drift.drifts.iter().all(|drift| drift.cause.kind() == CauseKind::Sensor)
}

impl Prepared {
    /// Searches drift, which is subtracted first, and takes the zero.
    pub(crate) fn new(rig: &RigRecording, calibration: &Calibration) -> Prepared {
        let as_recorded = Zeroed::new(rig, None);
        let ready = |zeroed, drift| Prepared { zeroed, drift, rejected_drift: None, linearised: None };
        let Some(drift) = found_drift(rig, &rig.model) else { return ready(as_recorded, None) };
        match as_recorded.linearise_noise(rig, calibration) {
            Ok(Some(linearised)) => Prepared {
                rejected_drift: Some(drift.reason),
                linearised: Some(linearised),
                ..ready(as_recorded, None)
            },
            _ => ready(Zeroed::new(rig, Some(&drift)), Some(drift)),
        }
    }

    /// The recording with its drift left in it; `None` if none was found.
    pub(crate) fn with_drift_left(&self, rig: &RigRecording) -> Option<Prepared> {
        let drift = self.drift.as_ref()?;
        let rejected_drift = Some(drift.reason.clone());
        Some(Prepared { zeroed: Zeroed::new(rig, None), drift: None, rejected_drift, linearised: None })
    }
}

/// The drift between the repeats of a recording, of a machine with this model. A recording that does not permit a drift search may still have a gap.
pub(crate) fn found_drift(rig: &RigRecording, model: &Model) -> Option<DriftReport> {
    if !rig.has_drift_search {
        return None;
    }
    let RigRecording { recording, identification, boundary, tolerances, actuators, .. } = rig;
    let zero = ZeroOutcome::of(recording, identification, rig.zero.map(Into::into));
    let (recording, _) = zero.subtract(recording.clone(), identification.clone());
    let report = drift::diagnose(&DriftRequest {
        runs: &[RecordedRun { recording: &recording, fingerprint: None }],
        model,
        boundary: *boundary,
        tolerances: *tolerances,
        identification,
        actuators: *actuators,
    });
    report.ok().filter(|report| !report.drifts.is_empty())
}

impl Zeroed {
    /// Subtracts the drift of sensors and the zero, which reduces the offset uncertainty.
    pub(crate) fn new(rig: &RigRecording, drift: Option<&DriftReport>) -> Zeroed {
        let config = &rig.identification;
        let undrifted = drift.and_then(|drift| without_drift(&rig.recording, drift));
        let recording = undrifted.unwrap_or_else(|| rig.recording.clone());
        let settings = |soak: Soak| ZeroSettings { allows_a_fault: true, ..soak.into() };
        let zero = ZeroOutcome::of(&recording, config, rig.zero.map(settings));
        let offsets_at_rest = offsets_at_rest(&zero, &config.declared);
        let (recording, zeroed) = zero.subtract(recording, config.clone());
        let common_offsets = zero.found().map_or_else(Vec::new, |zero| zero.common.clone());
        let declared = Declared { sensors: zeroed.declared, common_offsets, ..rig.declared() };
        Zeroed { recording, declared, zero, offsets_at_rest }
    }

    pub(crate) fn study(&self, rig: &RigRecording, effects: Vec<Arc<dyn Effect>>) -> Result<Study, GapError> {
        let (declared, judged) = (self.declared.clone(), rig.tolerances_declared);
        Ok(checked_study(&self.recording, declared, rig.model.clone(), effects, judged)?.0)
    }

    /// The linearised recording if tolerances alone explain it: apparent drift is then not subtracted, because the diagnosis is more sensitive.
    fn linearise_noise(
        &self,
        rig: &RigRecording,
        calibration: &Calibration,
    ) -> Result<Option<Linearised>, GapError> {
        let study = self.study(rig, Vec::new())?;
        let linearised = Linearised::new(&study)?;
        let null = fit(&study, &linearised, &study.nothing(), &Selection::all(&study), Effort::default())?;
        let misfit = adequacy(&study, &linearised, &null);
        Ok((calibration.outside(misfit.features()) < 0.5).then_some(linearised))
    }
}

/// Zero offset, in declared standard deviations, above which a sensor is reported. Source: the usual three sigmas of a control chart (ISO 7870-2).
const BEYOND_SIGMAS: f64 = 3.0;

fn offsets_at_rest(
    zero: &ZeroOutcome,
    declared: &BTreeMap<Channel, DeclaredUncertainty>,
) -> Vec<OffsetAtRest> {
    let ZeroOutcome::Found(zero) = zero else { return Vec::new() };
    let beyond = zero.offsets.iter().filter_map(|(channel, offset)| {
        let declared_sigma = declared.get(channel).map_or(0.0, |declared| declared.offset_sigma);
        let residual_offset = zero.left_sigma.get(channel).copied().unwrap_or(0.0);
        (offset.abs() > BEYOND_SIGMAS * declared_sigma.hypot(residual_offset)).then_some(OffsetAtRest {
            channel: *channel,
            offset: *offset,
            declared_sigma,
        })
    });
    beyond.collect()
}
