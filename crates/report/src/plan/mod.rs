//! Plans for review before a run, as text and picture: speed lines, order, single jumps, and expected verdicts.

pub(crate) mod campaign_check;
pub(crate) mod plan_document;
pub(crate) mod plan_remark_text;
