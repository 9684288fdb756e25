//! The command line as the user sees it: commands grouped by task, and arguments that several commands share.

pub(crate) mod shared_arguments;
pub(crate) mod subcommands;
pub(crate) mod tasks;
