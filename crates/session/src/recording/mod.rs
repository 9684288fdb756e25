//! Files of a run and its recording: run directory, journal, resumption, and reading of recordings for the analysis.

pub(crate) mod export;
pub(crate) mod files;
pub(crate) mod fusing;
pub(crate) mod identification_config;
pub(crate) mod journal;
pub(crate) mod recording_file;
pub(crate) mod resume;
pub mod run_directory;
