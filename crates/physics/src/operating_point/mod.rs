//! Operating points for campaign, plan and sequence: reach, places on a speed line, settling, and forecast of a step.

pub mod forecast;
pub mod line_points;
pub mod reach;
pub mod settled;
pub mod transition;
pub mod transition_forecast;
