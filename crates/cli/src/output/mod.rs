//! Output of every command: standard output and error, terminal lines, output options, failures, and exit codes.

pub(crate) mod detail_options;
pub(crate) mod exit_code;
pub(crate) mod exit_report;
pub(crate) mod failure;
pub(crate) mod output_options;
pub(crate) mod remedy;
pub(crate) mod standard_error;
pub(crate) mod standard_output;
pub(crate) mod terminal_lines;
