//! One mistake of a file: what is wrong, where, and the remedy.

use serde::Serialize;
use std::ops::Range;

/// What kind of mistake it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FindingKind {
    /// The text is not YAML, or not UTF-8.
    Syntax,
    /// YAML that our files do not use: anchors, aliases, merge keys, tags, several documents.
    Unsupported,
    /// The file, its nesting or its grid is too large.
    TooLarge,
    /// A key that does not exist.
    UnknownKey,
    /// A key that occurs twice in one mapping.
    DuplicateKey,
    /// A key that is needed and not there.
    MissingKey,
    /// Text where a number is needed, a list where a mapping is needed, and the like.
    WrongType,
    /// A value that is none of those allowed, or not of the form it needs.
    WrongValue,
    /// A quantity without its unit, or with one that does not measure it.
    Unit,
    /// A value outside its range.
    Range,
    /// A point, speed or opening that occurs twice.
    Duplicate,
    /// Two statements that contradict each other.
    Conflict,
    /// A file that is named and cannot be read.
    MissingFile,
    /// A point that the machine cannot reach within the limits.
    Unreachable,
    /// Values that no machine has, or that cannot give a result.
    Implausible,
    /// A warning: valid, but rarely intended.
    Unusual,
}

impl FindingKind {
    /// Whether it is a warning: the file can be used as it is.
    pub fn is_warning(self) -> bool {
        self == FindingKind::Unusual
    }
}

/// One mistake.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Finding {
    /// What kind of mistake it is.
    pub kind: FindingKind,
    /// Path of keys, e.g. `grid.points[3].speed`; empty for the file as a whole.
    pub path: String,
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1, in characters.
    pub column: usize,
    /// What is wrong, with values and units.
    pub message: String,
    /// What would be right.
    pub remedy: String,
    /// Byte range in the text, within one line.
    #[serde(skip)]
    pub span: Range<usize>,
}

/// Maximum number of findings shown; further ones are counted.
pub(crate) const SHOWN_LIMIT: usize = 100;
