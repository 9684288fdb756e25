//! `backend:`, and `readers:`, auxiliary instruments, which are read alongside the rig and never commanded.

use crate::checking::Check;
use mapper_core::Channel;
use mapper_yaml::{FindingKind, steps};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
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

/// An auxiliary instrument.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReaderChoice {
    /// Display name.
    pub name: String,
    /// Backend or driver.
    pub backend: BackendChoice,
    /// Channels to use; `None`: all that it delivers.
    pub channels: Option<Vec<Channel>>,
}

/// An auxiliary instrument: a source that is read alongside the rig and never commanded.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct ReaderFile {
    /// Name of its backend or driver, with its own settings below it.
    #[schemars(length(min = 1, max = 1), extend("minProperties" = 1, "maxProperties" = 1), example = serde_json::json!({"ak": {}}))]
    backend: BTreeMap<String, serde_json::Value>,
    /// Channels to use, even if the rig delivers them too; all channels of the instrument if the list is omitted.
    #[schemars(length(min = 1, max = 19), example = serde_json::json!(["m_c"]))]
    channels: Option<Vec<String>>,
}

/// The readers, sorted by name.
pub(crate) fn readers(file: BTreeMap<String, ReaderFile>) -> Vec<ReaderChoice> {
    let choice = |(name, file): (String, ReaderFile)| ReaderChoice {
        name,
        backend: backend(file.backend),
        // The check has rejected unknown symbols.
        channels: file
            .channels
            .map(|symbols| symbols.iter().filter_map(|symbol| symbol.parse().ok()).collect()),
    };
    file.into_iter().map(choice).collect()
}

/// Checks that names are usable in messages, that channels exist, and that there are no duplicates.
pub(crate) fn check(check: &mut Check<'_>) {
    let tree = check.tree;
    let mut taken: BTreeMap<String, String> = BTreeMap::new();
    for name in tree.keys(&steps!["readers"]) {
        let is_allowed = |byte: u8| byte.is_ascii_alphanumeric() || b"_-".contains(&byte);
        if name.is_empty() || name.len() > 40 || !name.bytes().all(is_allowed) {
            let message = format!("`{name}` cannot be the name of a reader");
            let remedy = "use letters, digits, `_` and `-`, at most 40";
            check.note_key(FindingKind::WrongValue, &steps!["readers"], name, message, remedy);
            continue;
        }
        for index in 0..check.count(&steps!["readers", name, "channels"]) {
            let path = steps!["readers", name, "channels", index];
            let Some(symbol) = check.text(&path).map(str::to_owned) else { continue };
            if let Err(error) = symbol.parse::<Channel>() {
                let remedy = "write the symbol of a measured quantity, e.g. `m_c`";
                check.note(FindingKind::WrongValue, &path, error.to_string(), remedy);
            } else if let Some(other) = taken.insert(symbol.clone(), name.to_owned()) {
                let message = format!("{symbol} is already taken from `{other}`");
                check.note(FindingKind::Conflict, &path, message, "take each channel from one reader");
            }
        }
    }
}
