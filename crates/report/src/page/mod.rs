//! The pages of a run and of a diagnosis: one self-contained HTML file each, for a browser, a phone and print.
//!
//! All text is in the page itself, as headings and tables. Its script makes the drawings from the data in the page.
//! No request leaves the page: its content policy allows none. `docs/how-to/report.md` describes the source of each
//! number.

mod advice;
mod document;
mod drawn_map;
mod drawn_points;
mod drawn_steps;
mod gap_page;
mod live_page;
mod prose;
mod run_page;
mod sections;
mod shell;
mod table;

pub use document::run_page;
pub use gap_page::{gap_page, gap_part};
pub use live_page::{
    LiveMap, LivePoint, Planned, live_map, live_page, live_point, planned, target_line_name,
};
pub use run_page::{OtherRun, RunPage};
