//! Text next to the output.

use mapper_core::terminal_text;
use std::io::Write;

/// Writes text to standard error. A failure to write is ignored.
pub fn say(text: &str) {
    let _ = write!(std::io::stderr().lock(), "{}", terminal_text(text));
}
