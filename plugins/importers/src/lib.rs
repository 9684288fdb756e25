//! Map files to maps: an importer is a function of a file's text.
//!
//! To add a format, write one module with one function of type [`Importer`], and one line in [`IMPORTERS`]. Importers do
//! no IO. A map without a reference state is refused: a wrong one shifts speeds by 1.7 % and more, and nobody sees it.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod csv;
mod error;
mod json;
mod lines;
mod reference;
mod sae;

pub use error::ImportError;
pub use reference::parse_reference;

use mapper_core::{CompressorMap, ReferenceState};

/// Largest file that is read, bytes: a measured map has some ten thousand.
pub const MOST_BYTES: usize = 32 << 20;
/// Most points that are read.
pub const MOST_POINTS: usize = 100_000;

/// Turns the text of a file into a map; `given` is the reference state that the user names.
pub type Importer = fn(text: &str, given: Option<ReferenceState>) -> Result<CompressorMap, ImportError>;

/// One format.
#[derive(Debug, Clone, Copy)]
pub struct ImporterEntry {
    /// Name as written on the command line.
    pub name: &'static str,
    /// File name extensions without the dot by which the format is guessed.
    pub extensions: &'static [&'static str],
    /// One line for people.
    pub description: &'static str,
    /// The importer.
    pub read: Importer,
}

/// Every format.
pub const IMPORTERS: &[ImporterEntry] = &[
    ImporterEntry {
        name: "csv",
        extensions: &["csv"],
        description: "columns named in a head line, or corrected rpm, corrected kg/s, pressure ratio, efficiency",
        read: csv::read,
    },
    ImporterEntry {
        name: "json",
        extensions: &["json"],
        description: "what `mapper` itself writes",
        read: json::read,
    },
    ImporterEntry {
        name: "sae",
        extensions: &["txt", "map", "sae", "dat"],
        description: "SAE text: corrected rpm, corrected kg/s, pressure ratio, efficiency, separated by blanks",
        read: sae::read,
    },
];

/// The format of a name.
pub fn find(name: &str) -> Option<&'static ImporterEntry> {
    IMPORTERS.iter().find(|entry| entry.name == name)
}

/// The format of a file name extension, whatever its capitals.
pub fn of_extension(extension: &str) -> Option<&'static ImporterEntry> {
    IMPORTERS.iter().find(|entry| entry.extensions.iter().any(|known| known.eq_ignore_ascii_case(extension)))
}

/// Reads a map from the bytes of a file.
///
/// # Errors
/// [`ImportError`]: too large, not text, not a map (with its line), or without a reference state.
pub fn read(
    entry: &ImporterEntry,
    bytes: &[u8],
    given: Option<ReferenceState>,
) -> Result<CompressorMap, ImportError> {
    if bytes.len() > MOST_BYTES {
        return Err(ImportError::TooLarge { bytes: bytes.len(), most: MOST_BYTES });
    }
    let text = std::str::from_utf8(bytes)
        .map_err(|error| ImportError::NotText { line: line_of(bytes, error.valid_up_to()) })?;
    // Spreadsheets begin their files with a byte order mark.
    (entry.read)(text.strip_prefix('\u{feff}').unwrap_or(text), given)
}

fn line_of(bytes: &[u8], offset: usize) -> usize {
    1 + bytes[..offset.min(bytes.len())].iter().filter(|byte| **byte == b'\n').count()
}
