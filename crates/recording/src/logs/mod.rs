//! Logs of other programs: the interface of log formats, the survey of a log, and the proposed channel map.
//!
//! A [`LogFormat`] recognises a file by its first bytes and opens it as a [`Log`]: a [`Layout`] of groups and columns, and the rows of
//! the requested columns, one after the other.

pub(crate) mod finding;
mod format;
pub mod limits;
mod options;
pub mod proposal;
mod survey;

pub use finding::LogFinding;
pub use format::{
    Column, Group, Layout, Log, LogError, LogFile, LogFormat, LogFormats, OpenLog, ReadSeek, Row, RowSink,
    SampleColumn, SampleTable, WriteSamples,
};
pub use mapper_table::{difference, kind_of};
pub use options::{LogOptions, OPTION_KEYS};
pub use survey::{ColumnSurvey, Gap, GroupSurvey, Restart, Survey, Trace, sparkline, survey};
