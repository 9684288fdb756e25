//! Refusals of requests, conversion of errors and panics of the code of the author, and failures that last: each is reported once for each reason, and once when it is over.

use mapper_core::BackendError;
use mapper_driver_host::protocol::{Code, Failure, write_error};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::BTreeSet;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Why a request is refused.
pub(crate) type Refusal = Box<Failure>;

pub(crate) fn refusal(code: Code, message: impl Into<String>) -> Refusal {
    Box::new(Failure::new(code, message))
}

pub(crate) fn missing_settings() -> Refusal {
    refusal(Code::OutOfOrder, "no settings were sent; send `configure` first")
}

pub(crate) fn read_params<T: DeserializeOwned>(params: &Value) -> Result<T, Refusal> {
    T::deserialize(params).map_err(|error| refusal(Code::Params, error.to_string()))
}

pub(crate) fn write_result(value: &impl serde::Serialize) -> Result<Value, Refusal> {
    serde_json::to_value(value).map_err(|error| refusal(Code::Failed, error.to_string()))
}

/// Calls the author's code and returns its errors and panics as refusals.
pub(crate) fn call_author_code<T>(call: impl FnOnce() -> Result<T, BackendError>) -> Result<T, Refusal> {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(answer) => answer.map_err(|error| Box::new(write_error(&error))),
        Err(_) => Err(refusal(Code::Lost, "the driver failed; its standard error has the reason")),
    }
}

/// Time without a failure after which it is over, s: long enough that a failure of every second sample is one.
const QUIET_S: f64 = 3.0;
/// Maximum number of reported reasons: a reason may contain a number that always differs.
const MAX_REASONS: usize = 5;

/// A failure of one kind.
#[derive(Debug, Default)]
pub struct Outage {
    reasons: BTreeSet<String>,
    samples: usize,
    last_s: f64,
}

impl Outage {
    /// Takes the failure of the sample at this run time, s, or `None` without one. Returns a message that begins with `what`, if there is something to report.
    pub fn update(&mut self, what: &str, t_s: f64, failure: Option<String>) -> Option<String> {
        if let Some(reason) = failure {
            (self.samples, self.last_s) = (self.samples + 1, t_s);
            let message = format!("{what}: {reason}");
            let is_new = self.reasons.len() < MAX_REASONS && self.reasons.insert(reason);
            return is_new.then_some(message);
        }
        if self.samples == 0 || t_s - self.last_s < QUIET_S {
            return None;
        }
        let ended = std::mem::take(self);
        Some(format!(
            "{what}: over since {:.1} s; number of affected samples: {}",
            ended.last_s, ended.samples
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_that_comes_and_goes_is_reported_once() {
        let mut outage = Outage::default();
        let mut messages = Vec::new();
        for sample in 0..200_u32 {
            let failure = match sample {
                100.. => None,
                _ if sample.is_multiple_of(2) => None,
                50.. => Some(format!("late by {sample} ms")),
                _ => Some("busy".to_owned()),
            };
            messages.extend(outage.update("missing readings", 0.1 * f64::from(sample), failure));
        }
        assert_eq!(messages.len(), MAX_REASONS + 1, "{messages:?}");
        assert_eq!(messages[0], "missing readings: busy");
        assert_eq!(
            messages[MAX_REASONS],
            "missing readings: over since 9.9 s; number of affected samples: 50"
        );
    }
}
