//! A mistake in a file: what, where and the remedy; and the closest valid name.

use serde::Serialize;
use std::ops::Range;

/// Kind of mistake.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// The text is not YAML, or not UTF-8.
    Syntax,
    /// YAML that is not supported: anchors, aliases, merge keys, tags, several documents.
    Unsupported,
    /// The file, its nesting or its grid is too large.
    TooLarge,
    /// A key that does not exist.
    UnknownKey,
    /// A key that occurs twice in one mapping.
    DuplicateKey,
    /// A required key is missing.
    MissingKey,
    /// Text where a number is needed, a list where a mapping is needed, and the like.
    WrongType,
    /// A value that is not allowed, or does not have the required form.
    WrongValue,
    /// A quantity without a unit, or with one of another kind of quantity.
    Unit,
    /// A value outside its range.
    Range,
    /// A point, speed or opening that occurs twice.
    Duplicate,
    /// Two statements that contradict each other.
    Conflict,
    /// A referenced file cannot be read.
    MissingFile,
    /// A point that the machine cannot reach within the limits.
    Unreachable,
    /// Values that are impossible for a machine, or that cannot give a result.
    Implausible,
    /// A warning: valid, but rarely intended.
    Unusual,
}

impl FindingKind {
    /// Whether the finding is a warning, and the file can be used.
    pub fn is_warning(self) -> bool {
        self == FindingKind::Unusual
    }
}

/// A mistake.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// Kind of mistake.
    pub kind: FindingKind,
    /// Path of keys, e.g. `grid.points[3].speed`; empty for the file as a whole.
    pub path: String,
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1, in characters.
    pub column: usize,
    /// Description, with values and units.
    pub message: String,
    /// Remedy.
    pub remedy: String,
    /// Byte range in the text, within one line.
    #[serde(skip)]
    pub span: Range<usize>,
}

/// Maximum number of findings shown; further ones are counted.
pub(crate) const SHOWN_LIMIT: usize = 100;

/// The candidate closest to a mistyped word, with at most a third of its letters wrong; case is ignored.
pub fn closest<'a>(word: &str, candidates: &[&'a str]) -> Option<&'a str> {
    // A very long word is not a typing error, and the cost of the distance grows with its square.
    if word.len() > 64 {
        return None;
    }
    let lower = word.to_lowercase().replace('-', "_");
    candidates
        .iter()
        .map(|candidate| (strsim::osa_distance(&lower, &candidate.to_lowercase()), *candidate))
        .filter(|(distance, candidate)| {
            let length = candidate.chars().count().max(lower.chars().count());
            // A word with no correct letter is a different word.
            *distance <= length.div_ceil(3) && *distance < length
        })
        .min()
        .map(|(_, candidate)| candidate)
}

/// `did you mean ...? `, or nothing.
pub(crate) fn guess(word: &str, candidates: &[&str]) -> String {
    closest(word, candidates).map(|guess| format!("did you mean `{guess}`? ")).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slip_is_recognised_and_another_word_is_not() {
        let keys = ["inlet_pressure", "T_oil", "N"];
        for (word, meant) in [
            ("inlet_presure", Some("inlet_pressure")),
            ("Inlet-Pressure", Some("inlet_pressure")),
            ("t_oil", Some("T_oil")),
            ("speed", None),
            ("", None),
        ] {
            assert_eq!(closest(word, &keys), meant, "{word}");
        }
    }
}
