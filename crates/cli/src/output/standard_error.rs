//! Standard error.

use mapper_core::terminal_text;
use std::io::Write;

/// Writes text to standard error. A failure to write is ignored.
pub fn say(text: &str) {
    say_rendered(&terminal_text(text));
}

/// Writes coloured text whose file names and keys are already free of control characters.
pub fn say_rendered(text: &str) {
    let _ = write!(std::io::stderr().lock(), "{text}");
}
