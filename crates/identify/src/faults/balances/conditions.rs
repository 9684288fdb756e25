//! Measured conditions of the rig compared with the declared ones.

use crate::IdentifyConfig;
use crate::faults::balance_rows::{MACHINE, Machine, Rows, common, own};
use crate::faults::end_readings::{CHANNELS, Readings};
use crate::faults::nominal_rig::NominalRig;
use mapper_core::{Channel, ModelTolerances, Recording, StepMarker, is_reading};
use mapper_numerics::statistics::median;

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
pub(crate) fn rows(
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
