//! The pages of a run and of a diagnosis: one self-contained HTML file each, for a browser, a phone and print.
//!
//! All text is in the page itself, as headings and tables. Its script makes the drawings from the data in the page.
//! No request leaves the page: its content policy allows none. `docs/how-to/report.md` describes the source of each
//! number.

pub(crate) mod drawn;
pub(crate) mod run_page;
pub(crate) mod studio;
pub(crate) mod widgets;

pub use run_page::{LiveMap, LivePoint, Planned, live_map, live_page, live_point, planned, target_line_name};
pub use studio::{RunList, compare_page, sign_in_page, studio_message, studio_run_page};
