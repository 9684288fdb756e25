//! What stands beside the output.

use mapper_core::terminal_text;
use std::io::Write;

/// Writes text to standard error. Nobody is left to tell where this fails.
pub fn say(text: &str) {
    let _ = write!(std::io::stderr().lock(), "{}", terminal_text(text));
}
