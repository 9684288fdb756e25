//! Plans for review before a run, as text and picture: speed lines, order, single jumps, and expected verdicts.

pub(crate) mod campaign_check_text;
pub(crate) mod comparison_text;
pub(crate) mod jump_text;
pub(crate) mod plan_picture;
pub(crate) mod plan_remark_text;
pub(crate) mod plan_text;
pub(crate) mod speed_lines_text;
pub(crate) mod verdict_forecast_text;
