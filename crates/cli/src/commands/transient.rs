//! `mapper transient`: diagnoses a log without steady steps.

use crate::command_line::RecordingReading;
use crate::environment::registry;
use crate::output::failure::Failure;
use crate::output::standard_output::{self, FileOutput};
use clap::Args;
use mapper_report::Describe;
use mapper_session::{DIAGNOSIS_FORMAT, Recorded, Session, Side, Versioned, write_transient};
use std::path::PathBuf;

/// Identify and diagnose one side of a machine from a log without steps, driven by its measured speed, flow, pressures and inlet temperature
#[derive(Debug, Args)]
pub struct Transient {
    /// Run directory, MCAP file, or log of another program (see `mapper log inspect`)
    pub recording: PathBuf,
    #[command(flatten)]
    pub reading: RecordingReading,
    /// Fit the log up to this time and predict the rest, e.g. "13.2 s" [default: fit everything]
    #[arg(long, value_name = "TIME", value_parser = parse_time_s)]
    pub fit_until: Option<f64>,
    /// Side of the machine
    #[arg(long, default_value = "compressor")]
    pub side: Side,
    /// Also try a suspected effect written in rhai; may be repeated
    #[arg(long = "effect", value_name = "FILE")]
    pub effects: Vec<PathBuf>,
    /// Write text, JSON and pictures to this directory
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub output: FileOutput,
}

/// A time with its unit, s.
fn parse_time_s(text: &str) -> Result<f64, String> {
    let duration = mapper_campaign::units::parse(mapper_campaign::units::Kind::Duration, text);
    duration.map_err(|error| error.to_string())
}

impl Transient {
    pub fn run(&self) -> Result<(), Failure> {
        let (map, given) = self.reading.read()?;
        let registry = registry();
        let recorded = Recorded::read(&registry, &self.recording, &map, given.as_ref())?;
        let effects = registry.effects_with(&self.effects)?;
        let diagnosis =
            Session::new(&registry).transient(&recorded, &map, self.side, self.fit_until, &effects)?;
        let machine = recorded.campaign.as_ref().map_or("", |campaign| &campaign.machine.name);
        let files = match &self.out {
            Some(directory) => write_transient(&diagnosis, machine, directory, self.output.existing())?,
            None => Vec::new(),
        };
        if self.output.json {
            return standard_output::print_json(&Versioned {
                format_version: DIAGNOSIS_FORMAT,
                content: &diagnosis,
            });
        }
        let mut document = diagnosis.document();
        recorded.read.warnings.iter().for_each(|warning| document.text(format!("recording: {warning}")));
        files.iter().for_each(|file| document.text(file.display().to_string()));
        standard_output::show(&document)
    }
}
