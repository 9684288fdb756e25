//! `backend:`, whose settings only the backend itself interprets.

use serde::Serialize;
use std::collections::BTreeMap;

/// A backend by its name, with settings that only it interprets.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BackendChoice {
    /// Name, e.g. `virtual_lab`.
    pub name: String,
    /// Settings, unchecked.
    pub settings: serde_json::Value,
}

/// The single entry of the mapping, which the schema ensures.
pub(crate) fn backend(file: BTreeMap<String, serde_json::Value>) -> BackendChoice {
    let (name, settings) = file.into_iter().next().unwrap_or_default();
    BackendChoice { name, settings }
}
