//! Results of gap and drift diagnosis for the engineer: probable causes, next steps, checked predictions, corrected points.

pub(crate) mod drift;
pub(crate) mod gap_next;
pub(crate) mod gap_results;
pub(crate) mod gap_text;
pub(crate) mod stand_actions;
