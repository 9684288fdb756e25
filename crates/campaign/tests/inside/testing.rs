//! Reads elements from a text, for their tests.

use crate::load::DOCUMENT;
use mapper_yaml::Source;
use serde::de::{DeserializeOwned, Error as _};
use serde_json::Error;
use std::path::Path;

/// The value of a text as an element.
pub(crate) fn any<T: DeserializeOwned>(text: &str) -> Result<T, Error> {
    let tree = mapper_yaml::read(Source::new(&DOCUMENT, Path::new("test.yaml"), text));
    serde_json::from_value(tree.map_err(Error::custom)?.0.value().clone())
}
