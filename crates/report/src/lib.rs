//! Output for people: tables for a terminal, the report of a run, pages and pictures.
//!
//! Every function turns data into text or a picture, in the display units of a campaign. This crate reads, writes and
//! decides nothing.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod diagnosis;
pub mod formatting;
mod heat_transfer;
mod history;
mod logs;
mod maps;
pub mod page;
mod plan;
mod point_results;
mod test_report;

pub use diagnosis::corrected_points::corrected_csv;
pub use diagnosis::correction_text::correction_text;
pub use diagnosis::drift_text::drift_text;
pub use diagnosis::gap_text::{doubt_text, gap_text, headline};
pub use diagnosis::prediction_check_text::forecast_check_text;
pub use diagnosis::recordings_text::recordings_text;
pub use formatting::bar_text::{progress_text, short_duration};
pub use formatting::display::Display;
pub use formatting::duration::duration;
pub use formatting::number::{number, percent, significant_digits};
pub use formatting::paint::{Paint, paint_verdict};
pub use formatting::table::with_heads;
pub use formatting::wrapped::wrapped;
pub use heat_transfer::heat_correction_text::heat_correction_text;
pub use heat_transfer::result_pictures::{error_figure, heat_transfer_figure};
pub use heat_transfer::thermal_file::ThermalExport;
pub use heat_transfer::thermal_model::thermal_text;
pub use history::fleet_text::{cost_text, merged_text, status_text, submission_text};
pub use history::history_picture::history_svg;
pub use history::history_text::{groups_text, listed_run_json, runs_text, time};
pub use history::night_text::night_text;
pub use logs::cause_picture::why_figure;
pub use logs::cause_text::why_text;
pub use logs::log_text::log_text;
/// A point with its truth, if known.
pub use mapper_recording::score::ScoredPoint;
pub use maps::imported_map_text::{import_remark_text, imported_map_text};
pub use maps::map_comparison_picture::{distinct_names, map_comparison_figure};
pub use maps::map_comparison_text::map_comparison_text;
pub use maps::map_fit_text::map_fit_text;
pub use maps::reduced_text::reduced_text;
pub use maps::turbine_file::{TurbinePoint, turbine_points, turbine_text};
pub use maps::turbine_map_text::{
    imported_turbine_text, reduced_turbine_text, turbine_comparison_text, turbine_fit_text,
};
pub use plan::campaign_check_text::campaign_check_text;
pub use plan::comparison_text::{comparison_json, comparison_text};
pub use plan::jump_text::{jump_json, jump_text};
pub use plan::plan_picture::plan_svg;
pub use plan::plan_remark_text::guard_trip_text;
pub use plan::plan_text::plan_text;
pub use plan::speed_lines_text::lines_text;
pub use plan::verdict_forecast_text::verdict_forecast_text;
pub use point_results::budget_table::budget_csv;
pub use point_results::disagreement::disagreement_text;
pub use point_results::lines_of_points::{first_doubts_text, points_by_line_text, verdict_sentence};
pub use point_results::points::{opening, points_text, truth_text};
pub use point_results::result_remark_text::result_remark_text;
pub use point_results::shared_errors::shared_errors_text;
pub use point_results::warning_text::{warning_text, with_messages};
pub use test_report::assumed_text::{assumed_text, first_campaign_text};
pub use test_report::ending_text::{PointsOrigin, ending_sentence};
pub use test_report::repeated_jumps::repeated_jumps_text;
pub use test_report::run_report::{ReportSource, RunReport, instant, run_report};
pub use test_report::sensors_text::{declared_sensors_text, sensors_text};
pub use test_report::surge_text::{SurgeReport, surge_columns_text, surge_text};
pub use test_report::zero_text::zero_text;

pub(crate) use diagnosis::gap_text::{NOTHING, OUTSIDE, UNLISTED, suspect_text};
pub(crate) use diagnosis::stand_actions::{next_measurement, stand_actions};
pub(crate) use formatting::number::four_figures;
pub(crate) use point_results::end_readings::{END_S, at_end};
pub(crate) use point_results::point_table::{PointCell, point_cells, point_groups, point_heads};
pub(crate) use point_results::point_warnings::doubts;
pub(crate) use point_results::points::{score_text, step_name, verdict_word};
pub(crate) use test_report::acceptance::{
    ACCEPTANCE_HEADS, BALANCE_HEADS, BALANCE_WORDS, acceptance_rows, acceptance_words, balance_rows,
};
pub(crate) use test_report::conditions::{CONDITION_HEADS, condition_rows};
pub(crate) use test_report::instruments::{
    INSTRUMENT_HEADS, INSTRUMENT_WORDS, REGISTER_HEADS, instrument_rows, register_rows,
};
pub(crate) use test_report::key_figures::key_figures;
pub(crate) use test_report::run_report::{condition_facts, cover_facts, provenance_facts};
pub(crate) use test_report::surge_text::{surge_heads, surge_remarks, surge_rows};
pub(crate) use test_report::zero_text::{ZERO_HEADS, zero_rows, zero_words};
