//! `sequence:`, a script in place of an order.

use crate::checking::{Check, resolve_path};
use mapper_yaml::{FindingKind, steps};
use serde::Serialize;
use std::io;
use std::path::{Path, PathBuf};

/// A sequence script.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SequenceSource {
    /// Path as written in the campaign.
    #[serde(skip)]
    pub named: String,
    /// Path as resolved from the campaign file. Not part of the canonical JSON: only the text identifies the script.
    #[serde(skip)]
    pub path: PathBuf,
    /// The script.
    pub text: String,
}

/// Reads the script that a campaign names.
///
/// # Errors
/// If it can no longer be read.
pub(crate) fn sequence(
    name: Option<&str>,
    origin: &Path,
    files: &dyn Fn(&Path) -> io::Result<String>,
) -> io::Result<Option<SequenceSource>> {
    let source = |name: &str| {
        let path = resolve_path(origin, name);
        let text = files(&path)?;
        Ok(SequenceSource { named: name.to_owned(), path, text })
    };
    name.map(source).transpose()
}

/// Checks that the script can be read.
pub(crate) fn check(check: &mut Check<'_>) {
    let steps = steps!["sequence"];
    let Some(name) = check.text(&steps).filter(|name| name.ends_with(".rhai")) else { return };
    if let (path, Err(error)) = check.file(name) {
        let message = format!("the sequence script `{}` cannot be read: {error}", path.display());
        let remedy = "write its path relative to the campaign file, or remove `sequence`";
        check.note(FindingKind::MissingFile, &steps, message, remedy);
    }
}
