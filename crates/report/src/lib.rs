//! Output for people: every subject as a [`Document`] for terminal, Markdown and HTML, pages, pictures, and the sentences of typed messages.
//!
//! Data that [`Describe`] themselves become a document by one function; its renderers ([`Document::terminal`], [`Document::markdown`], pages)
//! show the same facts. A warning, remark or finding is a variant with values; [`Message`] gives its sentence. This crate reads, writes and
//! decides nothing.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod diagnosis;
mod document;
mod formatting;
mod heat_transfer;
mod history;
mod logs;
mod maps;
pub mod page;
mod plan;
mod point_results;
mod test_report;

pub use diagnosis::drift::corrected_csv;
pub use diagnosis::gap_results::compared_recordings;
pub use diagnosis::gap_results::correction;
pub use diagnosis::gap_results::forecast_check;
pub use diagnosis::gap_text::headline;
pub use document::{Cell, Describe, Document, Paint, Table, markdown_table, markdown_text, wrapped};
pub use formatting::Display;
pub use formatting::significant_digits;
pub use formatting::{Message, sentence, with_messages};
pub use formatting::{progress_text, short_duration};
pub use heat_transfer::result_pictures::{error_figure, heat_transfer_figure};
pub use heat_transfer::thermal_model::ThermalExport;
pub use history::history_picture::history_svg;
pub use history::nights::night_comparison;
pub use history::nights::{listed_run_json, listed_runs, night_groups};
pub use history::studies::study_status;
pub use logs::log_text::log_contents;
pub use logs::side_diagnosis::why_figure;
pub use maps::map_comparison_picture::{distinct_names, map_comparison_figure};
pub use maps::map_documents::map_fit;
pub use maps::map_documents::reduced_map;
pub use maps::map_documents::{reduced_turbine, turbine_fit};
pub use maps::turbine_file::{TurbinePoint, turbine_points, turbine_text};
pub use page::run_page::OtherRun;
pub use page::shell::gap_page;
pub use plan::campaign_check::CheckedCampaign;
pub use plan::plan_document::plan_document;
pub use plan::plan_document::{comparison_json, plan_comparison};
pub use plan::plan_document::{jump_forecast, jump_json};
pub use plan::plan_picture::plan_svg;
pub use plan::plan_remark_text::guard_trip_text;
pub use point_results::budget_table::budget_csv;
pub use point_results::summary::PointResults;
pub use test_report::key_figures::PointsOrigin;
pub use test_report::key_figures::first_campaign;
pub use test_report::run_report::{ReportSource, RunReport, instant};
pub use test_report::zero_and_sensors::SurgeReport;
