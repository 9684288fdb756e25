//! Errors of a script.

use std::path::{Path, PathBuf};

/// Maximum length of a shown line or message, characters.
const MAX_SHOWN_CHARS: usize = 200;

/// A script that is not an effect.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{}{}: {message}{}", path.display(), place(*line), shown(source_line))]
pub struct ScriptEffectError {
    /// The script's file.
    pub path: PathBuf,
    /// Line, from 1; `None` for the whole script.
    pub line: Option<usize>,
    /// The line itself.
    pub source_line: String,
    /// The error and the correct form.
    pub message: String,
}

impl ScriptEffectError {
    pub(super) fn new(path: &Path, text: &str, line: Option<usize>, message: String) -> Self {
        let source_line = line.and_then(|line| text.lines().nth(line.checked_sub(1)?)).unwrap_or_default();
        let clean = |text: &str| text.chars().filter(|c| !c.is_control()).take(MAX_SHOWN_CHARS).collect();
        ScriptEffectError {
            path: path.to_owned(),
            line,
            source_line: clean(source_line),
            message: clean(&message),
        }
    }
}

fn place(line: Option<usize>) -> String {
    line.map_or_else(String::new, |line| format!(":{line}"))
}

fn shown(source_line: &str) -> String {
    if source_line.is_empty() { String::new() } else { format!("\n  | {source_line}") }
}
