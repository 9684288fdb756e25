//! Planning of a campaign before its run: order of steps, forecasts of duration and verdicts, rehearsal of scripts.

pub(crate) mod calibration_check;
pub(crate) mod campaign_forecast;
pub(crate) mod needed_dwell;
pub(crate) mod planning;
pub(crate) mod predicted_method;
pub(crate) mod rehearsal;
pub(crate) mod scripted_steps;
pub(crate) mod stored_plan;
pub(crate) mod surge;
pub(crate) mod verdict_forecast;
pub(crate) mod zero_forecast;
