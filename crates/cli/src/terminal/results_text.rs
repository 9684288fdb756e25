//! Results of a run or an identification, for a terminal.

use clap::Args;
use mapper_campaign::campaign::DisplayUnits;
use mapper_report::{Display, Document, PointResults};
use mapper_session::{Identified, Results};

/// Options of commands that print identified points.
#[derive(Debug, Clone, Copy, Args)]
pub struct DetailLevel {
    /// Show everything: wide tables, common parameters, repeats, sensors, the zero
    #[arg(long)]
    pub full: bool,
    /// Show the simulator's truth next to the points
    #[arg(long)]
    pub truth: bool,
}

impl DetailLevel {
    fn of(
        self,
        units: &DisplayUnits,
        results: &PointResults<'_>,
        command: &str,
        warnings: &[String],
    ) -> Document {
        let display = Display::new(units);
        match self.full {
            true => results.full(&display, warnings, self.truth),
            false => results.short(&display, command, warnings, self.truth),
        }
    }
}

/// The results of a run: a table, notes, verdict and files. `command`: the command that shows the rest, in words.
pub fn results_text(units: &DisplayUnits, results: &Results, command: &str, shown: DetailLevel) -> Document {
    let identified = &results.identified;
    let found = identified.shown(results.compressor_map.as_ref(), &results.repeats, &identified.remarks);
    let mut document = shown.of(units, &found, command, &[]);
    let mut files: Vec<(&str, &std::path::Path)> = Vec::new();
    files.extend(results.map.values().map(|path| ("map", path.as_path())));
    files.extend([("report", results.report.as_path()), ("page", results.page.as_path())]);
    let recordings = std::iter::once(&results.recording).chain(&results.further_recordings);
    files.extend(recordings.map(|path| ("recording", path.as_path())));
    document.facts("", files.into_iter().map(|(what, path)| (what, path.display().to_string())));
    document
}

/// The results of an identification without files. `command`: shows the rest, in words; `warnings`: of the recordings.
pub fn identified_text(
    units: &DisplayUnits,
    identified: &Identified,
    command: &str,
    warnings: &[String],
    shown: DetailLevel,
) -> Document {
    shown.of(units, &identified.shown(None, &[], &identified.remarks), command, warnings)
}
