//! Why a file is no map.

use mapper_core::ReferenceState;

/// Why a file is no map.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// Larger than any map.
    #[error("the file has {bytes} bytes; a map has at most {most}")]
    TooLarge {
        /// Its size.
        bytes: usize,
        /// Largest size read.
        most: usize,
    },
    /// Not UTF-8.
    #[error("line {line} is not text (UTF-8); save the map as text")]
    NotText {
        /// Line, from 1.
        line: usize,
    },
    /// A row that cannot be read.
    #[error("line {line}: {message}")]
    Syntax {
        /// Line, from 1.
        line: usize,
        /// What is wrong and what would be right.
        message: String,
    },
    /// A value without physical meaning.
    #[error("line {line}: {quantity} = {value} has no meaning; it must be {needed}")]
    Value {
        /// Line, from 1.
        line: usize,
        /// Which column.
        quantity: &'static str,
        /// What stands there.
        value: f64,
        /// What is allowed.
        needed: &'static str,
    },
    /// Not a map in JSON.
    #[error("not a map as `mapper` writes it: {0}")]
    Json(#[from] serde_json::Error),
    /// A field of a JSON map is no sensible number.
    #[error("{place}: {quantity} = {value} has no meaning; it must be {needed}")]
    Field {
        /// Which line and point of the map.
        place: String,
        /// Which field.
        quantity: &'static str,
        /// What stands there.
        value: f64,
        /// What is allowed.
        needed: &'static str,
    },
    /// The corrected quantities refer to nothing.
    #[error(
        "the map does not say to which state its corrected flows and speeds refer; give `--reference`: {}, or \"298 K, 100 kPa\"",
        mapper_core::usual_references()
    )]
    NoReference,
    /// File and user disagree.
    #[error(
        "the map says that it refers to {found}, `--reference` says {given}; leave `--reference` out, or correct the file"
    )]
    ReferenceConflict {
        /// In the file.
        found: ReferenceState,
        /// Given.
        given: ReferenceState,
    },
    /// A reference state that cannot be one.
    #[error(
        "`{text}` is no reference state; write {}, or a temperature and a pressure, e.g. \"298 K, 100 kPa\" (200 to 400 K, 50 to 200 kPa)",
        mapper_core::usual_references()
    )]
    Reference {
        /// What was given.
        text: String,
    },
    /// Nothing in it.
    #[error("the file holds no points")]
    Empty,
    /// More points than any map has.
    #[error("line {line}: the file has more than {most} points; no map has that many")]
    TooMany {
        /// Line at which the limit was passed.
        line: usize,
        /// The limit.
        most: usize,
    },
}
