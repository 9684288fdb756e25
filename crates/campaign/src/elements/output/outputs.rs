//! `outputs:`

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

const DEFAULT_DIRECTORY: &str = "runs";
const DEFAULT_FORMATS: [&str; 4] = ["csv", "json", "svg", "fitted"];

/// Formats and directory of the results.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Outputs {
    /// Parent directory of the run directories; `runs` if none is given.
    #[schemars(length(min = 1), example = &"runs")]
    pub directory: String,
    /// Formats of the map, each once; csv, json, svg and fitted if none is given. docs/reference/maps.md lists all supported formats.
    #[schemars(extend("uniqueItems" = true, "examples" = [["csv", "json", "svg"]]))]
    pub formats: Vec<FormatName>,
}

/// Name of a map format, e.g. `csv`. The caller knows the valid names; [`crate::format_mistake`] reports any other one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
pub struct FormatName(#[schemars(length(min = 1), example = &"csv")] pub String);

impl FormatName {
    /// The name.
    pub fn name(&self) -> &str {
        &self.0
    }
}

impl std::fmt::Display for FormatName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl Default for Outputs {
    fn default() -> Self {
        Outputs {
            directory: DEFAULT_DIRECTORY.to_owned(),
            formats: DEFAULT_FORMATS.map(|name| FormatName(name.to_owned())).to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_has_its_default() {
        let read = |text| crate::testing::any::<Outputs>(text).unwrap();
        assert_eq!(read("{}"), Outputs::default());
        let one = Outputs { formats: vec![FormatName("npss".to_owned())], ..Outputs::default() };
        assert_eq!(read("{formats: [npss]}"), one);
        assert_eq!(read("{directory: elsewhere}").formats, Outputs::default().formats);
    }
}
