//! Planning of a campaign before its run: order of steps, forecasts of duration and verdicts, rehearsal of scripts.

pub(crate) mod campaign_forecast;
pub(crate) mod planning;
pub(crate) mod rehearsal;
