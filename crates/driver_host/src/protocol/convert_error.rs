//! Conversion between errors of a rig and refusals.

use crate::protocol::message::{Code, Failure};
use mapper_core::BackendError;

/// The failure as the driver reports it.
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
