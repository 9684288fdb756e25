//! Balances that need no jump: standstill, and the conditions of the test cell.
//!
//! The zero subtracts what they read differently, if a campaign asks for it. Here the differences are evidence: one beyond the declared offsets is
//! the fault of a sensor. The cell's thermometer and barometer decide between two sensors, but do not accuse both: they may be far from the machine.

use crate::IdentifyConfig;
use crate::faults::balance_rows::{Rows, common, own};
use crate::faults::end_readings::{CHANNELS, PerChannel, Readings, span_s};
use crate::faults::found_fault::{MACHINE, Machine};
use crate::faults::nominal_rig::NominalRig;
use crate::isothermal_zero::soak_readings::Reading;
use crate::isothermal_zero::zero::{AtRest, all_at_rest};
use mapper_core::{Channel, FaultKind, ModelTolerances, Recording, SeenAtRest, StepMarker, is_reading};
use mapper_numerics::statistics::{EXCLUDE_SIGMAS, HINT_SIGMAS, median};
use mapper_observe::declared::usual_offset_sigma;
use mapper_physics::rig::sensor_fault::SensorFault;
use nalgebra::DMatrix;

/// What a group of sensors reads in a standstill.
#[derive(Debug, Clone)]
pub(crate) struct Standstill {
    pub(crate) rows: Rows,
    seen: SeenAtRest,
}

/// A sensor of the group, or the instrument of the cell.
struct Member {
    channel: Option<Channel>,
    value: f64,
    /// Its error but for the parameters of all balances.
    sigma: f64,
}

/// One balance for each group and standstill: every reading minus that of the first member.
pub(crate) fn standstills(recording: &Recording, config: &IdentifyConfig) -> Vec<Standstill> {
    let Some(span_s) = span_s(recording) else { return Vec::new() };
    all_at_rest(recording, config).iter().filter_map(|at_rest| standstill(at_rest, config, span_s)).collect()
}

fn standstill(
    at_rest: &AtRest,
    config: &IdentifyConfig,
    (first_s, last_s): (f64, f64),
) -> Option<Standstill> {
    let of_cell = at_rest.cell.filter(|(value, sigma)| {
        let agrees = |reading: &Reading| {
            (reading.mean - value).abs()
                <= EXCLUDE_SIGMAS * sigma.hypot(offset_sigma(reading.channel, config))
        };
        at_rest.readings.iter().any(agrees)
    });
    let cell = of_cell.map(|(value, sigma)| Member { channel: None, value, sigma });
    let members: Vec<Member> =
        at_rest.readings.iter().map(|reading| member(reading, config)).chain(cell).collect();
    let (first, others) = members.split_first().filter(|(_, others)| !others.is_empty())?;
    let sign = |of: &Member, channel: Channel| f64::from(u8::from(of.channel == Some(channel)));
    let by = |other: &Member, channel: Channel| sign(other, channel) - sign(first, channel);
    let value = |channel: Channel| {
        members.iter().find(|member| member.channel == Some(channel)).map_or(f64::NAN, |member| member.value)
    };
    let (start_s, end_s) = at_rest.used_s;
    let readings = Readings {
        values: CHANNELS.map(value),
        run_ratio: ((end_s - first_s) / (last_s - first_s)).clamp(0.0, 1.0),
        exact_at: config.exact_at,
        air: config.air,
    };
    let count = others.len();
    let turbine = members.iter().filter_map(|member| member.channel).filter(|own| !CHANNELS.contains(own));
    let offsets = turbine.map(|channel| {
        (channel, FaultKind::Offset, others.iter().map(|other| by(other, channel)).collect::<Vec<f64>>())
    });
    // Gas and wall have one temperature.
    let no_conduction =
        [Channel::T1, Channel::T2].map(|channel| (channel, FaultKind::TowardsWall, vec![0.0; count]));
    Some(Standstill {
        rows: Rows {
            residual: others.iter().map(|other| other.value - first.value).collect(),
            covariance: own(others.iter().map(|other| other.sigma))
                + DMatrix::from_element(count, count, first.sigma * first.sigma),
            readings: vec![readings; count],
            by_reading: others
                .iter()
                .map(|other| -> PerChannel { CHANNELS.map(|channel| by(other, channel)) })
                .collect(),
            by_machine: Vec::new(),
            by_fault: offsets.chain(no_conduction).collect(),
        },
        seen: SeenAtRest { start_s, end_s, is_soak: at_rest.is_soak },
    })
}

fn member(reading: &Reading, config: &IdentifyConfig) -> Member {
    let Reading { channel, mean, own, .. } = *reading;
    let declared = config.sensor(channel);
    let is_parameter = CHANNELS.contains(&channel) && declared.offset_sigma == offset_sigma(channel, config);
    let gain = declared.gain_sigma_ratio * config.exact_at.gain_error(channel, mean);
    let other = if is_parameter { 0.0 } else { offset_sigma(channel, config).hypot(gain) };
    Member { channel: Some(channel), value: mean, sigma: own.hypot(other) }
}

/// The declared offset, before a zero: a smaller difference is not a fault. Without a declaration, that of a usual sensor.
fn offset_sigma(channel: Channel, config: &IdentifyConfig) -> f64 {
    let declared = config.offsets_before_zero.get(&channel).copied();
    let declared = declared.unwrap_or_else(|| config.sensor(channel).offset_sigma);
    if declared > 0.0 { declared } else { usual_offset_sigma(channel) }
}

/// The first standstill in which a fault of this size moves a reading visibly.
pub(crate) fn seen(standstills: &[Standstill], fault: &SensorFault, value: f64) -> Option<SeenAtRest> {
    let shows = |at_rest: &&Standstill| {
        let effect = at_rest.rows.by_fault(fault);
        let errors = at_rest.rows.covariance.diagonal();
        effect.iter().zip(&errors).any(|(effect, error)| (effect * value).abs() > HINT_SIGMAS * error.sqrt())
    };
    standstills.iter().find(shows).map(|at_rest| at_rest.seen)
}

/// Tolerance of a condition, in the channel's unit; `None` if the channel is not a condition.
pub(crate) fn tolerance(channel: Channel, tolerances: &ModelTolerances) -> Option<f64> {
    Some(match channel {
        Channel::P1 => tolerances.inlet_pressure_pa,
        Channel::T1 => tolerances.inlet_temperature_k,
        Channel::T3 => tolerances.turbine_inlet_temperature_k,
        Channel::TOil => tolerances.oil_temperature_k,
        Channel::TAmb => tolerances.ambient_temperature_k,
        _ => return None,
    })
}

/// One balance for each condition that is declared and measured. `readings`: of all steps, by position.
pub(crate) fn condition_rows(
    recording: &Recording,
    readings: &[Option<Readings>],
    config: &IdentifyConfig,
    nominal: &NominalRig<'_>,
) -> Vec<Rows> {
    let steps: Vec<(&StepMarker, Readings)> = recording
        .steps
        .iter()
        .zip(readings)
        .filter_map(|(step, readings)| Some((step, (*readings)?)))
        .collect();
    let last_s = config.thresholds.steady_mean_s;
    let of = |machine: &Machine| {
        let Machine::Condition(channel) = *machine else { return None };
        let tolerance = tolerance(channel, nominal.tolerances)?;
        let declared = *nominal.conditions.get(&channel)?;
        let series = recording.series.get(&channel)?;
        let at_end = |step: &StepMarker| {
            let values = series.slice((step.end_s - last_s).max(step.start_s), step.end_s).1;
            median(values.iter().filter(|value| is_reading(channel, **value)))
        };
        let known: Vec<(f64, Readings)> = steps
            .iter()
            .filter_map(|(step, readings)| {
                // Total pressures are among the readings.
                let own = CHANNELS.iter().position(|other| *other == channel);
                let measured = own.map_or_else(|| at_end(step), |own| Some(readings.values[own]))?;
                Some((measured - declared, *readings))
            })
            .collect();
        let count = known.len();
        let all = vec![1.0; count];
        let offset_sigma = match CHANNELS.contains(&channel) {
            // These are parameters of all balances.
            true => 0.0,
            false => config.sensor(channel).offset_sigma,
        };
        let by_reading = CHANNELS.map(|other| f64::from(u8::from(other == channel)));
        (count > 0).then(|| Rows {
            residual: known.iter().map(|(off, _)| *off).collect(),
            // A condition wanders from step to step as much as it is off throughout.
            covariance: common(&all, tolerance.hypot(offset_sigma)) + own(vec![tolerance; count].into_iter()),
            readings: known.iter().map(|(_, readings)| *readings).collect(),
            by_reading: vec![by_reading; count],
            by_machine: vec![(*machine, all)],
            by_fault: Vec::new(),
        })
    };
    MACHINE.iter().filter_map(of).collect()
}
