//! The compressor side of a log without steps.

use crate::files::{Existing, json_text, write_file};
use crate::recorded::{Recorded, same_machine};
use crate::{Session, SessionError};
use mapper_core::ExportError;
use mapper_driven::{DrivenOutcome, Readings, identify};
use mapper_report::{transient_figure, transient_text};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Name of the report's files.
const STEM: &str = "transient";

impl Session<'_> {
    /// Finds what a log without steps says of the compressor side of its campaign's machine: fitted before `fit_until_s`
    /// (time of the log, s; all of it where none is given), predicted from there on.
    ///
    /// # Errors
    /// [`SessionError::MachineUnknown`] where no campaign says what machine it is, [`SessionError::OtherMachine`] where it is
    /// another, [`SessionError::Driven`] where the log has too little.
    pub fn transient(
        &self,
        recorded: &Recorded,
        fit_until_s: Option<f64>,
    ) -> Result<DrivenOutcome, SessionError> {
        let campaign = recorded.known("Give `--campaign FILE` with the machine and its geometry")?;
        same_machine(recorded, campaign)?;
        let rows = Readings::of(&recorded.read.recording)?;
        let fit_until_s = fit_until_s.unwrap_or(f64::INFINITY);
        Ok(identify(&rows, campaign.machine.params, fit_until_s, campaign.seed)?)
    }
}

/// Writes text, JSON and pictures of an outcome into a directory, which is made where it is missing; gives the files.
///
/// # Errors
/// As [`write_file`].
pub fn write_transient(
    outcome: &DrivenOutcome,
    machine: &str,
    directory: &Path,
    existing: Existing,
) -> Result<Vec<PathBuf>, SessionError> {
    let figure = transient_figure(machine, outcome);
    let png = figure.to_png(2.0).map_err(ExportError::failed("png"))?;
    let text = transient_text(outcome);
    let contents: [(String, Vec<u8>); 4] = [
        (format!("{STEM}.json"), json_text(&json!(outcome))?.into_bytes()),
        (format!("{STEM}.txt"), text.into_bytes()),
        (format!("{STEM}.svg"), figure.to_svg().into_bytes()),
        (format!("{STEM}.png"), png),
    ];
    std::fs::create_dir_all(directory).map_err(SessionError::file("create", directory))?;
    let mut files = Vec::new();
    for (name, bytes) in &contents {
        let path = directory.join(name);
        write_file(&path, bytes, existing)?;
        files.push(path);
    }
    Ok(files)
}
