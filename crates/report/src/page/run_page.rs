//! Input of the page of a run or of identified recordings.

use crate::RunReport;
use mapper_core::CompressorMap;
use mapper_identify::T2History;
use maud::Markup;

/// The content of the page.
pub struct RunPage<'a> {
    /// The content that it shares with the Markdown report.
    pub report: &'a RunReport<'a>,
    /// T2 computed from the numbers of each point.
    pub t2_histories: &'a [T2History],
    /// The diagnosis of the gap to the nominal model, if there is one.
    pub gap: Option<Markup>,
    /// Maps for comparison.
    pub others: &'a [OtherRun<'a>],
}

/// Another run's map.
pub struct OtherRun<'a> {
    /// Its name on the page.
    pub name: String,
    /// Its map.
    pub map: &'a CompressorMap,
}
