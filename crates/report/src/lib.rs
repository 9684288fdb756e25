//! Output for people: tables for a terminal, the report of a run, pages and pictures.
//!
//! Every function turns data into text or a picture, in the display units of a campaign. This crate reads, writes and
//! decides nothing.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod comparison_text;
mod conditions;
mod corrected_points;
mod disagreement;
mod display;
mod doubts;
mod drift_text;
mod duration;
mod fleet_text;
mod gap_next;
mod gap_page;
mod gap_text;
mod heat_correction_text;
mod heat_picture;
mod held_text;
mod history_picture;
mod history_text;
mod instruments;
mod jump_text;
mod key_figures;
mod lines_of_points;
mod lines_text;
mod log_text;
mod map_comparison_picture;
mod map_comparison_text;
mod map_fit_text;
pub mod markdown;
mod measured;
mod night_text;
mod number;
mod paint;
mod plan_picture;
mod plan_text;
mod point_table;
mod points;
mod production_text;
mod recordings_text;
mod repeated_jumps;
mod reproduction_page;
mod run_report;
mod sensors_text;
mod sequence_page;
mod shared_errors;
mod surge_text;
mod table;
mod thermal_file;
mod thermal_model;
mod transient_picture;
mod transient_text;
mod turbine_file;
mod why_picture;
mod why_text;
mod wrapped;
mod zero_text;

pub use comparison_text::{comparison_json, comparison_text};
pub use conditions::{CONDITION_HEADS, condition_rows};
pub use corrected_points::corrected_csv;
pub use disagreement::disagreement_text;
pub use display::Display;
pub use doubts::{Doubt, doubts};
pub use drift_text::drift_text;
pub use duration::duration;
pub use fleet_text::{cost_text, merged_text, status_text, submission_text};
pub use gap_page::{gap_page, gap_part};
pub use gap_text::{gap_text, headline};
pub use heat_correction_text::heat_correction_text;
pub use heat_picture::{ErrorAtGradient, error_figure, heat_transfer_figure};
pub use held_text::held_text;
pub use history_picture::history_svg;
pub use history_text::{groups_text, listed_run_json, runs_text, time};
pub use instruments::{INSTRUMENT_HEADS, INSTRUMENT_WORDS, instrument_rows};
pub use jump_text::{jump_json, jump_text};
pub use key_figures::key_figures;
pub use lines_of_points::{first_doubts_text, points_by_line_text, verdict_sentence};
pub use lines_text::lines_text;
pub use log_text::log_text;
pub use map_comparison_picture::{map_comparison_figure, told_apart};
pub use map_comparison_text::map_comparison_text;
pub use map_fit_text::map_fit_text;
/// A point with its truth, if known.
pub use mapper_record::score::ScoredPoint;
pub use measured::{END_S, at_end};
pub use night_text::night_text;
pub use number::{number, percent};
pub use paint::{Paint, paint_verdict};
pub use plan_picture::plan_svg;
pub use plan_text::plan_text;
pub use point_table::{PointCell, PointGroup, point_cells, point_groups, point_heads};
pub use points::{points_text, score_text, step_name, truth_text, verdict_word};
pub use production_text::production_text;
pub use recordings_text::recordings_text;
pub use repeated_jumps::repeated_jumps_text;
pub use reproduction_page::{figure_json, reproduction_page};
pub use run_report::{
    ReportSource, RunReport, SurgeReport, condition_facts, instant, provenance_facts, run_report,
};
pub use sensors_text::{declared_sensors_text, sensors_text};
pub use sequence_page::sequence_page;
pub use shared_errors::shared_errors_text;
pub use surge_text::{surge_columns_text, surge_heads, surge_remarks, surge_rows, surge_text};
pub use table::with_heads;
pub use thermal_file::ThermalExport;
pub use thermal_model::thermal_text;
pub use transient_picture::transient_figure;
pub use transient_text::transient_text;
pub use turbine_file::{TurbinePoint, turbine_points, turbine_text};
pub use why_picture::why_figure;
pub use why_text::why_text;
pub use wrapped::wrapped;
pub use zero_text::{ZERO_HEADS, zero_rows, zero_text, zero_words};
