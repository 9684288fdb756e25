//! Output of every command: standard output and error, terminal lines, output options, failures, and exit codes.

pub(crate) mod failure;
pub(crate) mod output_options;
pub(crate) mod standard_error;
pub(crate) mod standard_output;
