//! Results of logs without steps: content of the log, prediction of T2, and the cause of a deviation, as text and picture.

pub(crate) mod cause_picture;
pub(crate) mod cause_text;
pub(crate) mod log_text;
pub(crate) mod transient_picture;
pub(crate) mod transient_text;
