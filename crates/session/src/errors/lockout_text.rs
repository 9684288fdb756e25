//! The run of a lockout in messages.

use std::path::Path;

/// The run of a lockout; empty if it is unknown, because the entry cannot be read.
pub fn since_text(run: &Path) -> String {
    if run.as_os_str().is_empty() { String::new() } else { format!(" since the run {}", run.display()) }
}
