//! Reads elements from a text, for their tests.

use crate::load::DOCUMENT;
use mapper_yaml::Source;
use serde::de::{DeserializeOwned, Error as _};
use serde_json::{Error, Value};
use std::path::Path;

/// The value of a text as an element.
pub(crate) fn any<T: DeserializeOwned>(text: &str) -> Result<T, Error> {
    any_with(text, serde_json::from_value)
}

/// As [`any`], with a reader that is not a `Deserialize` of its own, such as a `serde` remote.
pub(crate) fn any_with<T>(text: &str, read: impl FnOnce(Value) -> Result<T, Error>) -> Result<T, Error> {
    let tree = mapper_yaml::read(Source::new(&DOCUMENT, Path::new("test.yaml"), text));
    read(tree.map_err(Error::custom)?.0.value().clone())
}
