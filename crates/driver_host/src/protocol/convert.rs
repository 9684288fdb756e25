//! Conversion between messages and the types of the core.

use crate::protocol::message::{ChannelDescription, Description, Ranges};
use mapper_core::{Channel, GuardName, RigDescription, SetpointRange, SetpointRanges, UnknownChannel};
use std::collections::BTreeSet;

/// Maximum sample rate of a rig, Hz: a hundred times that of the fastest logs of gas stands, and a second of it fits into memory.
const MAX_RATE_HZ: f64 = 100_000.0;

/// Invalid or inconsistent data from a driver.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum InvalidData {
    #[error("it describes an unknown channel: {0}")]
    Channel(#[from] UnknownChannel),
    #[error("it sends {channel} in {unit}; the unit of {channel} is {right}")]
    Unit { channel: Channel, unit: String, right: &'static str },
    #[error("it sends {0} twice")]
    Duplicate(String),
    #[error("it requires an unknown guard `{0}`; this program may be older than the driver")]
    Guard(String),
    #[error("its {name} is {value} {unit}, which is impossible")]
    Number { name: &'static str, value: f64, unit: &'static str },
    #[error("{name} has {length} values for {count} samples")]
    ColumnLength { name: String, length: usize, count: usize },
    #[error("a sample at {t_s} s after one at {before_s} s")]
    Time { before_s: f64, t_s: f64 },
    #[error("expected sample {expected}, received sample {found}{}", describe_missing(*expected, *found))]
    Sequence { expected: u64, found: u64 },
    #[error("it sends more samples than were requested")]
    TooMany,
}

fn describe_missing(expected: u64, found: u64) -> String {
    match found.saturating_sub(expected) {
        0 => String::new(),
        count => format!("; {count} are missing, lost by the driver or not read in time"),
    }
}

/// Reads a driver's description of its rig. `backend` and `version` are those of its hello.
///
/// # Errors
/// [`InvalidData`] for unknown channels or guards, and for impossible numbers.
pub fn read_description(
    wire: &Description,
    backend: &str,
    version: &str,
) -> Result<RigDescription, InvalidData> {
    let mut channels = Vec::new();
    for described in &wire.channels {
        let channel: Channel = described.name.parse()?;
        let right = channel.unit();
        if described.unit != right {
            return Err(InvalidData::Unit { channel, unit: described.unit.clone(), right });
        }
        channels.push(channel);
    }
    let different: BTreeSet<_> = channels.iter().collect();
    if different.len() < channels.len() {
        return Err(InvalidData::Duplicate("a channel".to_owned()));
    }
    check_number("sample rate", wire.sample_rate_hz, "Hz", f64::MIN_POSITIVE..=MAX_RATE_HZ)?;
    let safe = &wire.safe;
    check_number("duration of the safe shutdown", safe.within_s, "s", f64::MIN_POSITIVE..=600.0)?;
    check_number("valve opening during the safe shutdown", safe.valve_opening_ratio, "", 0.0..=10.0)?;
    if let Some(slew_pa_s) = safe.p3_slew_pa_s {
        check_number("slew of P3 during the safe shutdown", slew_pa_s, "Pa/s", f64::MIN_POSITIVE..=1e9)?;
    }
    let guard = |name: &String| name.parse::<GuardName>().map_err(|_| InvalidData::Guard(name.clone()));
    Ok(RigDescription {
        backend: backend.to_owned(),
        version: version.to_owned(),
        channels,
        sample_rate_hz: wire.sample_rate_hz,
        simulated_time: wire.simulated_time,
        controls: wire.controls,
        exclusive: wire.exclusive.clone(),
        reached_at: wire.reached_at.clone(),
        needs_guarded: wire.needs_guarded.iter().map(guard).collect::<Result<_, _>>()?,
        accepts: wire.accepts.as_ref().map(read_ranges),
        safe: wire.safe,
    })
}

fn check_number(
    name: &'static str,
    value: f64,
    unit: &'static str,
    range: std::ops::RangeInclusive<f64>,
) -> Result<(), InvalidData> {
    if range.contains(&value) { Ok(()) } else { Err(InvalidData::Number { name, value, unit }) }
}

fn read_ranges(wire: &Ranges) -> SetpointRanges {
    let range = |(low, high): (f64, f64)| SetpointRange { low, high };
    SetpointRanges {
        p3_pa: range(wire.p3_pa),
        t3_k: range(wire.t3_k),
        valve_opening_ratio: range(wire.valve_opening_ratio),
        oil_temperature_k: range(wire.oil_temperature_k),
    }
}

/// Writes the description of a rig as a driver sends it.
pub fn write_description(rig: &RigDescription) -> Description {
    let channel = |channel: &Channel| ChannelDescription {
        name: channel.to_string(),
        unit: channel.unit().to_owned(),
        sensors: None,
    };
    let range = |range: SetpointRange| (range.low, range.high);
    Description {
        channels: rig.channels.iter().map(channel).collect(),
        sample_rate_hz: rig.sample_rate_hz,
        simulated_time: rig.simulated_time,
        controls: rig.controls,
        exclusive: rig.exclusive.clone(),
        reached_at: rig.reached_at.clone(),
        needs_guarded: rig.needs_guarded.iter().map(ToString::to_string).collect(),
        accepts: rig.accepts.map(|accepts| Ranges {
            p3_pa: range(accepts.p3_pa),
            t3_k: range(accepts.t3_k),
            valve_opening_ratio: range(accepts.valve_opening_ratio),
            oil_temperature_k: range(accepts.oil_temperature_k),
        }),
        safe: rig.safe,
    }
}
