//! Output for people: every subject as a [`Document`] for terminal, Markdown and HTML, pages, pictures, and the sentences of typed messages.
//!
//! Data that [`Describe`] themselves become a document by one function; its renderers ([`Document::terminal`], [`Document::markdown`], pages)
//! show the same facts. A warning, remark or finding is a variant with values; [`Message`] gives its sentence. This crate reads, writes and
//! decides nothing.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod diagnosis;
mod document;
mod formatting;
mod log_text;
mod map_documents;
mod nights;
pub mod page;
mod pictures;
mod plan;
mod point_results;
mod side_diagnosis;
mod test_report;
mod thermal_model;
mod turbine;

pub use diagnosis::drift::corrected_csv;
pub use diagnosis::gap_results::{correction, forecast_check};
pub use diagnosis::gap_text::headline;
pub use document::{Cell, Describe, Document, Paint, Table, markdown_table, markdown_text, wrapped};
pub use formatting::{
    Display, Message, progress_text, sentence, short_duration, significant_digits, with_messages,
};
pub use log_text::log_contents;
pub use map_documents::{map_fit, reduced_map, reduced_turbine, turbine_fit};
pub use nights::{listed_run_json, listed_runs, night_comparison, night_groups, study_status};
pub use page::run_page::gap_page;
pub use page::widgets::OtherRun;
pub use pictures::{distinct_names, error_figure, heat_transfer_figure, history_svg, map_comparison_figure};
pub use plan::campaign_check::{
    CheckedCampaign, commissioning_document, commissioning_json, values_to_declare,
};
pub use plan::plan_document::{
    comparison_json, jump_forecast, jump_json, plan_comparison, plan_document, plan_svg,
};
pub use plan::plan_remark_text::guard_trip_text;
pub use point_results::point_tables::{budget_csv, wheel_coefficients};
pub use point_results::summary::PointResults;
pub use side_diagnosis::why_figure;
pub use test_report::key_figures::{PointsOrigin, first_campaign};
pub use test_report::run_report::{ReportSource, RunReport, instant};
pub use test_report::zero_and_sensors::SurgeReport;
pub use thermal_model::ThermalExport;
pub use turbine::turbine_figure;
