//! Messages of the protocol from and to the types of the program, with the errors of what a driver sends.

use crate::protocol::frame::{ChannelDescription, Code, Description, Failure, Ranges};
use mapper_core::{
    BackendError, Channel, GuardName, RigDescription, SetpointRange, SetpointRanges, UnknownChannel,
};
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

#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct ReportedError(String);

/// Key in `set`, display name, unit.
const SETPOINTS: [(&str, &str, &str); 4] = [
    ("p3_pa", "P3", "Pa"),
    ("t3_k", "T3", "K"),
    ("valve_opening_ratio", "valve opening", "1"),
    ("oil_temperature_k", "T_oil", "K"),
];

/// Writes an error of a rig as a driver sends it.
pub fn write_error(error: &BackendError) -> Failure {
    let failure = |code| Failure::new(code, error.to_string());
    match error {
        BackendError::OutOfOrder { .. } => failure(Code::OutOfOrder),
        BackendError::SetpointOutOfRange { quantity, value, low, high, .. } => {
            let key = SETPOINTS.iter().find(|(_, name, _)| name == quantity).map(|(key, ..)| *key);
            let finite = |value: &f64| value.is_finite().then_some(*value);
            Failure {
                setpoint: key.map(str::to_owned),
                value: finite(value),
                low: finite(low),
                high: finite(high),
                ..failure(Code::SetpointOutOfRange)
            }
        }
        BackendError::Settings { path, source, .. } => {
            Failure { path: Some(path.clone()), ..Failure::new(Code::Settings, source.to_string()) }
        }
        BackendError::Simulation { t_s, source } => {
            Failure { t_s: Some(*t_s), ..Failure::new(Code::Simulation, source.to_string()) }
        }
        BackendError::Lost { t_s, source } => {
            Failure { t_s: Some(*t_s), ..Failure::new(Code::Lost, source.to_string()) }
        }
        BackendError::Deadline { .. } => failure(Code::Lost),
    }
}

/// Reads a refusal as the error of a rig. `backend`: name of the driver; `call`: the refused call; `now_s`: run time, s.
pub fn read_error(failure: Failure, backend: &str, call: &'static str, now_s: f64) -> BackendError {
    let t_s = failure.t_s.filter(|t_s| t_s.is_finite()).unwrap_or(now_s);
    let key = failure.setpoint.as_deref();
    let which = SETPOINTS.iter().find(|(name, ..)| Some(*name) == key);
    let source = Box::new(ReportedError(failure.message));
    match (failure.code, which) {
        (Code::OutOfOrder, _) => {
            let (state, needed) = ("in another state", "in a state in which its driver accepts the call");
            BackendError::OutOfOrder { call, state, needed }
        }
        (Code::SetpointOutOfRange, Some((_, quantity, unit))) => BackendError::SetpointOutOfRange {
            quantity,
            value: failure.value.unwrap_or(f64::NAN),
            unit,
            low: failure.low.unwrap_or(f64::NEG_INFINITY),
            high: failure.high.unwrap_or(f64::INFINITY),
        },
        (Code::Settings, _) => BackendError::Settings {
            backend: backend.to_owned(),
            path: failure.path.unwrap_or_default(),
            source,
        },
        (Code::Simulation, _) => BackendError::Simulation { t_s, source },
        _ => BackendError::Lost { t_s, source },
    }
}
