//! Results of logs without steps: content of the log, and the cause of a deviation, as text and picture.

pub(crate) mod log_text;
pub(crate) mod side_diagnosis;
