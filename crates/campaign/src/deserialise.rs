//! The one place that knows serde_yaml.
//!
//! It reads a text that has already been found right, by another reader which keeps positions. Where the two
//! should ever disagree, its error becomes a finding like any other.

use serde::de::DeserializeOwned;

/// Why a text that was found right cannot be read.
#[derive(Debug)]
pub(crate) struct ReadError {
    pub message: String,
    /// Index of the character, if known.
    pub character: Option<usize>,
}

/// YAML text -> value.
pub(crate) fn any<T: DeserializeOwned>(text: &str) -> Result<T, ReadError> {
    serde_yaml::from_str(text).map_err(|error| ReadError {
        message: error.to_string(),
        character: error.location().map(|location| location.index()),
    })
}

/// As [`any`], with a reader that is no `Deserialize` of its own, such as a `serde` remote.
#[cfg(test)]
pub(crate) fn any_with<T>(
    text: &str,
    read: impl FnOnce(serde_yaml::Deserializer<'_>) -> Result<T, serde_yaml::Error>,
) -> Result<T, serde_yaml::Error> {
    read(serde_yaml::Deserializer::from_str(text))
}
