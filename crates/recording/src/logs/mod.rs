//! Logs of other programs: the interface of log formats, the survey of a log, and the proposed channel map.
//!
//! A [`LogFormat`] recognises a file by its first bytes and opens it as a [`Log`]: a [`Layout`] of groups and columns, and the rows of
//! the requested columns, one after the other.

mod error;
mod file;
mod finding;
mod format;
mod layout;
pub mod limits;
mod options;
pub mod plausible;
pub mod proposal;
mod survey;
mod trace;

pub use error::LogError;
pub use file::{LogFile, ReadSeek};
pub use finding::LogFinding;
pub use format::{Log, LogFormat, LogFormats, OpenLog, Row, RowSink};
pub use layout::{Column, Group, Layout};
pub use mapper_table::{difference, kind_of};
pub use options::{LogOptions, OPTION_KEYS};
pub use survey::{ColumnSurvey, Gap, GroupSurvey, Restart, Survey, survey};
pub use trace::{Trace, sparkline};
