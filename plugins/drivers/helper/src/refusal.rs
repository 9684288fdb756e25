//! Refusals of requests, and conversion of errors and panics of the author's code.

use mapper_core::BackendError;
use mapper_driver_host::protocol::{Code, Failure, write_error};
use serde::de::DeserializeOwned;
use serde_json::Value;
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
