//! The page of a run: one self-contained HTML file for a browser, a phone and print.
//!
//! Everything that can be read stands in the page itself, as headings and tables; the drawings are made by its script from
//! the data beside them. No request leaves the page: its content policy allows none. `docs/report.md` says where each number
//! comes from.

#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod advice;
mod drawn_map;
mod drawn_points;
mod drawn_steps;
mod live_page;
mod page;
mod prose;
mod run_page;
mod sections;
mod shell;
mod table;

pub use live_page::{LiveMap, LivePoint, Planned, live_map, live_page, live_point, planned};
pub use page::run_page;
pub use run_page::{OtherRun, RunPage};
