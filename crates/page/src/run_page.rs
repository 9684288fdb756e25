//! What the page of a run or of identified recordings is made from.

use mapper_core::{CompressorMap, Recording};
use mapper_identify::{T2Course, ZeroOutcome};
use mapper_report::RunReport;
use maud::Markup;

/// Everything that the page shows.
pub struct RunPage<'a> {
    /// What the report in Markdown says too.
    pub report: &'a RunReport<'a>,
    /// The map; `None` where there is none.
    pub map: Option<&'a CompressorMap>,
    /// What was read, as it was identified.
    pub recording: &'a Recording,
    /// T2 by the numbers of each point.
    pub courses: &'a [T2Course],
    /// What came of the isothermal zero.
    pub zero: &'a ZeroOutcome,
    /// When the test was run, as it is to be shown; `None` where nobody knows.
    pub tested_at: Option<&'a str>,
    /// Program and version.
    pub program: &'a str,
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
