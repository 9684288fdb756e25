//! Results of gap and drift diagnosis for the engineer: probable causes, next steps, checked predictions, corrected points.

pub(crate) mod corrected_points;
pub(crate) mod correction_text;
pub(crate) mod drift_text;
pub(crate) mod gap_next;
pub(crate) mod gap_text;
pub(crate) mod gap_warning_text;
pub(crate) mod prediction_check_text;
pub(crate) mod recordings_text;
pub(crate) mod stand_actions;
