//! Standard output, whose reader may go away at any time.

use crate::exit_code::Code;
use crate::failure::Failure;
use serde::Serialize;
use std::io::{ErrorKind, Write};

/// Writes text to standard output. A closed pipe ends the command quietly.
pub fn print(text: &str) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    out.write_all(text.as_bytes()).and_then(|()| out.flush()).map_err(|error| match error.kind() {
        ErrorKind::BrokenPipe => Failure::closed_pipe(),
        _ => Failure::new(Code::Failure, format!("failed to write to standard output: {error}")),
    })
}

/// Writes what is already laid out to standard error: warnings, which no program reads.
#[allow(clippy::print_stderr, reason = "beside the output, as errors are")]
pub fn warn(text: &str) {
    eprint!("{text}");
}

/// Writes one JSON object and a line end to standard output.
pub fn print_json(value: &impl Serialize) -> Result<(), Failure> {
    print(&mapper_session::json_text(value)?)
}
