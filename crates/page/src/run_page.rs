//! What the page of a run or of identified recordings is made from.

use mapper_core::CompressorMap;
use mapper_identify::T2Course;
use mapper_report::RunReport;
use maud::Markup;

/// Everything that the page shows.
pub struct RunPage<'a> {
    /// What the report in Markdown says too.
    pub report: &'a RunReport<'a>,
    /// T2 by the numbers of each point.
    pub courses: &'a [T2Course],
    /// The diagnosis of the gap to the nominal model, where one was made.
    pub gap: Option<Markup>,
    /// Maps to hold this one against.
    pub others: &'a [OtherRun<'a>],
}

/// Another run's map.
pub struct OtherRun<'a> {
    /// How it is called on the page.
    pub name: String,
    /// Its map.
    pub map: &'a CompressorMap,
}
