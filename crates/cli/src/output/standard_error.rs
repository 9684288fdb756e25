//! Text next to the output.

use mapper_core::terminal_text;
use std::io::Write;

/// Writes text to standard error. A failure to write is ignored.
pub fn say(text: &str) {
    say_rendered(&terminal_text(text));
}

/// The same for a text with colours of its own, in which names of files and keys are harmless already.
pub fn say_rendered(text: &str) {
    let _ = write!(std::io::stderr().lock(), "{text}");
}
