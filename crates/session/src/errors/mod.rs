//! Errors of all session commands, their categories by who has to act, and the words that their messages share.

pub(crate) mod error;
pub(crate) mod error_kind;
pub(crate) mod error_words;
pub(crate) mod first_map_error;
pub(crate) mod fmu_error;
pub(crate) mod map_work_error;
