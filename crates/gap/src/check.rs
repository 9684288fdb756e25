//! Whether a recording can be diagnosed at all, before any fit: a clear word instead of a confident culprit.

use crate::declared::Declared;
use crate::nuisance::{DRIVERS, OUTPUTS};
use crate::study::Study;
use crate::table::Table;
use mapper_core::{Channel, Dimension, Recording};

/// What forbids a diagnosis.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Problem {
    /// Nothing measured.
    #[error("the recording has no measured channel with samples; check its channel map")]
    Empty,
    /// No steps.
    #[error(
        "the recording has {steps} step(s), and no jump of P3 or valve is seen: a diagnosis needs jumps between at least 3 points; record a campaign, and map P3_command and valve_command"
    )]
    NoJumps {
        /// Steps found.
        steps: usize,
    },
    /// Too few outputs.
    #[error(
        "too little is measured: of N, m_c, P2, T2, Tc, m_t, T4 and Tt only {present}; at least N, P2 and T2 are needed"
    )]
    TooFewOutputs {
        /// What is there.
        present: String,
    },
    /// Far from what the nominal machine does under the recorded inputs.
    #[error(
        "{channel} lies {percent:.0} % off what the nominal machine gives under the recorded P3, T3 and valve, at half of the steps or more: this is a recording of another machine, or a scale is wrong; check machine and map of the campaign"
    )]
    OtherMachine {
        /// The channel that is farthest off.
        channel: Channel,
        /// By how much, % of the nominal value (signed).
        percent: f64,
    },
    /// A channel in another unit than it is said to be.
    #[error("{channel} reads {value:.4} {unit} in the middle, which no rig has; {guess}")]
    Unit {
        /// The channel.
        channel: Channel,
        /// Median.
        value: f64,
        /// Unit it is said to have.
        unit: &'static str,
        /// What it looks like.
        guess: String,
    },
    /// A driver is missing altogether.
    #[error("{channel} ({}) drives the model and is not recorded; without it no cause can be told", .channel.info().description)]
    NoDriver {
        /// The channel.
        channel: Channel,
    },
    /// Measured P3 is nowhere near its command.
    #[error(
        "measured P3 is {measured_pa:.0} Pa where {commanded_pa:.0} Pa is commanded: the two do not belong together; check the channel map and the units"
    )]
    NotCommanded {
        /// Median of the measured P3 in a step, Pa.
        measured_pa: f64,
        /// Its command, Pa.
        commanded_pa: f64,
    },
}

/// Looks at a recording; warnings for what can be lived with.
///
/// # Errors
/// [`Problem`] for what cannot.
pub fn check(recording: &Recording, table: &Table, declared: &Declared) -> Result<Vec<String>, Problem> {
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
    units(table)?;
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
        warnings.push(format!(
            "{channel} ({}) is not recorded: what shows in it alone cannot be found",
            channel.info().description
        ));
    }
    for channel in DRIVERS {
        if table.column(channel).is_none() {
            warnings.push(format!("{channel} is not recorded: the campaign's value stands for it"));
        }
    }
    warnings.extend(gaps(table));
    for channel in &present {
        if declared.noise_sigma(*channel) <= 0.0 {
            warnings.push(format!("no noise is declared for {channel}: a thousandth of its value is taken"));
        }
    }
    Ok(warnings)
}

fn median(values: &[f64]) -> Option<f64> {
    let mut finite: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    let middle = finite.len() / 2;
    if finite.is_empty() {
        return None;
    }
    Some(*finite.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// What no rig has: a pressure far from an atmosphere's order, a temperature near absolute zero.
fn units(table: &Table) -> Result<(), Problem> {
    for (channel, values) in &table.columns {
        let Some(value) = median(values) else { continue };
        let refuse = |guess: &str| {
            Err(Problem::Unit { channel: *channel, value, unit: channel.unit(), guess: guess.to_owned() })
        };
        match channel.info().dimension {
            Dimension::Pressure if (30.0..2_000.0).contains(&value) => {
                return refuse("it looks like kPa labelled Pa; correct the unit in the channel map");
            }
            Dimension::Pressure if (0.3..30.0).contains(&value) => {
                return refuse("it looks like bar labelled Pa; correct the unit in the channel map");
            }
            Dimension::Pressure if !(30e3..2e6).contains(&value) => {
                return refuse(
                    "an absolute pressure between 30 kPa and 2 MPa is expected; check unit and sensor",
                );
            }
            Dimension::Temperature if (0.0..200.0).contains(&value) => {
                return refuse("it looks like degC labelled K; correct the unit in the channel map");
            }
            Dimension::Temperature if !(200.0..1500.0).contains(&value) => {
                return refuse("between 200 K and 1500 K is expected; check unit and sensor");
            }
            Dimension::RotationalSpeed if (5.0..1_000.0).contains(&value) => {
                return refuse("it looks like krpm or 1/s labelled rpm; correct the unit in the channel map");
            }
            Dimension::RotationalSpeed if !(5e3..5e5).contains(&value) => {
                return refuse("a turbocharger turns between 5 and 500 krpm; check unit and sensor");
            }
            Dimension::MassFlow if value > 2.0 => {
                return refuse(
                    "it looks like g/s or kg/h labelled kg/s; correct the unit in the channel map",
                );
            }
            Dimension::MassFlow if value < 1e-4 => {
                return refuse("no flow is measured; check unit and sensor");
            }
            _ => {}
        }
    }
    Ok(())
}

fn commanded(recording: &Recording, table: &Table) -> Result<(), Problem> {
    let Some(values) = table.column(Channel::P3) else { return Ok(()) };
    let mut away: Vec<(f64, f64, f64)> = Vec::new();
    for step in &recording.steps {
        // The last fifth: whatever the actuator does, it has arrived.
        let range = table.range(step.end_s - 0.2 * (step.end_s - step.start_s), step.end_s);
        if let (Some(measured_pa), true) = (median(&values[range]), step.p3_pa.is_finite()) {
            away.push(((measured_pa / step.p3_pa - 1.0).abs(), measured_pa, step.p3_pa));
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

fn gaps(table: &Table) -> Option<String> {
    let gap = |pair: &[f64]| pair[1] - pair[0] > 2.5 * table.interval_s;
    let missing_s: f64 = table.t_s.windows(2).filter(|pair| gap(pair)).map(|pair| pair[1] - pair[0]).sum();
    let count = table.t_s.windows(2).filter(|pair| gap(pair)).count();
    (count > 0).then(|| {
        format!(
            "the recording has {count} gap(s), {missing_s:.1} s in all; blocks without samples are left out"
        )
    })
}

/// Deviations of a step's end from the nominal machine that no effect of a rig makes: of speed, flows, and the rise of
/// pressure and temperature through the compressor.
const ANOTHER_MACHINE_RATIO: [(Channel, f64); 5] = [
    (Channel::ShaftSpeed, 0.25),
    (Channel::CompressorFlow, 0.4),
    (Channel::TurbineFlow, 0.4),
    (Channel::P2, 0.4),
    (Channel::T2, 0.6),
];

/// Refuses a recording that is nowhere near the nominal machine, by its prediction without any deviation.
///
/// # Errors
/// [`Problem::OtherMachine`].
pub fn same_machine(study: &Study, predicted: &[f64]) -> Result<(), Problem> {
    let mut worst: Option<(f64, Channel, f64)> = None;
    for (channel, limit) in ANOTHER_MACHINE_RATIO {
        let nominal = &study.declared.nominal;
        // Rises are compared, not levels.
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
            .map(|row| (study.measured[row] - zero) / (predicted[row] - zero).max(1e-9) - 1.0)
            .collect();
        away.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let Some(median) = away.get(away.len() / 2) else { continue };
        if median.abs() > limit && worst.is_none_or(|(most, ..)| median.abs() / limit > most) {
            worst = Some((median.abs() / limit, channel, 100.0 * median));
        }
    }
    worst.map_or(Ok(()), |(_, channel, percent)| Err(Problem::OtherMachine { channel, percent }))
}
