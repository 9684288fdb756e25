//! Analysis of a finished recording: identified points, result files, gap diagnosis, drift check, and calibrated models.

pub(crate) mod calibrated_model;
pub(crate) mod catalogue;
pub(crate) mod diagnosis_file;
pub(crate) mod drift;
pub(crate) mod gap;
pub(crate) mod identification;
pub(crate) mod pdf;
pub(crate) mod results;
pub(crate) mod transient;
