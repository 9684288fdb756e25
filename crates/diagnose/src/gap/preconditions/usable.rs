//! Checks whether a recording can be diagnosed, before any fit.

use crate::gap::findings::warning::GapWarning;
use crate::gap::preconditions::problem::{GapError, Problem};
use crate::gap::residuals::actuators::Actuators;
use crate::gap::residuals::nuisance::OUTPUTS;
use crate::gap::residuals::study::Study;
use mapper_core::{Channel, Recording};
use mapper_numerics::statistics::median;
use mapper_observe::averages::time_table::{GAP_INTERVALS, Table};
use mapper_observe::channels::INPUT_CHANNELS;
use mapper_observe::declared::Declared;
use mapper_observe::plausible::check_running;
use mapper_physics::rig::effect::Effect;
use mapper_physics::simulation::model::Model;
use std::sync::Arc;

/// Checks a recording and prepares its study; returns warnings for tolerable defects.
///
/// # Errors
/// [`GapError`] if the recording is unusable.
pub fn checked_study(
    recording: &Recording,
    declared: Declared,
    model: Model,
    effects: Vec<Arc<dyn Effect>>,
    tolerances_declared: bool,
) -> Result<(Study, Vec<GapWarning>), GapError> {
    let table = Table::new(recording).ok_or(Problem::Empty)?;
    let warnings = usable(recording, &table, &declared)?;
    let actuators = Actuators::of(&table, recording, &declared, tolerances_declared);
    Ok((Study::with_actuators(recording, table, declared, model, effects, actuators), warnings))
}

/// Checks a recording; returns warnings for tolerable defects.
///
/// # Errors
/// [`Problem`] for others.
pub fn usable(recording: &Recording, table: &Table, declared: &Declared) -> Result<Vec<GapWarning>, Problem> {
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
    let jumps = recording
        .steps
        .windows(2)
        .filter(|pair| {
            let moved = |a: f64, b: f64| (a - b).abs() > 0.01 * a.abs().max(b.abs());
            moved(pair[0].p3_pa, pair[1].p3_pa)
                || moved(pair[0].valve_opening_ratio, pair[1].valve_opening_ratio)
        })
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
        // The last fifth: any actuator has arrived by then.
        let range = table.range(step.end_s - 0.2 * (step.end_s - step.start_s), step.end_s);
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
        Some((share, measured_pa, commanded_pa)) if *share > 0.1 => {
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
