//! Refusals of requests, and results of an author's code as answers.

use mapper_core::BackendError;
use mapper_driver_host::protocol::{Code, Failure, error_on_the_wire};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Why a request is refused.
pub(crate) type Refusal = Box<Failure>;

pub(crate) fn refused(code: Code, message: impl Into<String>) -> Refusal {
    Box::new(Failure::new(code, message))
}

pub(crate) fn no_settings() -> Refusal {
    refused(Code::OutOfOrder, "the settings have not come")
}

pub(crate) fn read<T: DeserializeOwned>(params: &Value) -> Result<T, Refusal> {
    T::deserialize(params).map_err(|error| refused(Code::Params, error.to_string()))
}

pub(crate) fn write(value: &impl serde::Serialize) -> Result<Value, Refusal> {
    serde_json::to_value(value).map_err(|error| refused(Code::Failed, error.to_string()))
}

/// Calls the author's code and returns its errors and panics as refusals.
pub(crate) fn guarded<T>(call: impl FnOnce() -> Result<T, BackendError>) -> Result<T, Refusal> {
    match catch_unwind(AssertUnwindSafe(call)) {
        Ok(answer) => answer.map_err(|error| Box::new(error_on_the_wire(&error))),
        Err(_) => Err(refused(Code::Lost, "the driver failed; its own words stand on its standard error")),
    }
}
