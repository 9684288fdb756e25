//! `mapper gap correct`: corrects the map of a recording for its diagnosed causes.

use crate::command_line::channel_map;
use crate::commands::identify::MethodArgument;
use crate::environment::registry;
use crate::interrupt;
use crate::output::failure::Failure;
use crate::output::{output_options, standard_output};
use clap::Args;
use mapper_core::Method;
use mapper_report::{correction, with_messages};
use mapper_session::{Recorded, Session, SessionError};
use serde_json::json;
use std::path::PathBuf;

/// Identify a recording again without the causes of its diagnosis, and show the map before and after
#[derive(Debug, Args)]
pub struct Correct {
    /// Campaign with machine, declared uncertainties and tolerances (YAML)
    pub campaign: PathBuf,
    /// Run directory, MCAP file, or log of another program
    pub recording: PathBuf,
    /// Write points, map, pictures and report to this directory, corrected if a correction is allowed; existing files are not replaced
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// Diagnosis, as `gap diagnose` writes it [default: the one next to the recording if it belongs to it, otherwise a new one]
    #[arg(long, value_name = "FILE")]
    pub diagnosis: Option<PathBuf>,
    /// Channel map: where a recording made by another program holds the rig's channels (YAML)
    #[arg(long, value_name = "MAP")]
    pub channels: Option<PathBuf>,
    /// Also try a suspected effect written in rhai; may be repeated
    #[arg(long = "effect", value_name = "FILE")]
    pub effects: Vec<PathBuf>,
    /// How to identify [default: the campaign's method, or joint]
    #[arg(long, value_enum)]
    pub method: Option<MethodArgument>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Correct {
    pub fn run(&self) -> Result<(), Failure> {
        let campaign = mapper_campaign::load(&self.campaign).map_err(Failure::of_campaign)?;
        let map = channel_map(self.channels.as_deref())?;
        let registry = registry();
        let effects = registry.effects_with(&self.effects)?;
        let recorded = Recorded::read(&registry, &self.recording, &map, Some(&campaign))?;
        let progress = output_options::progress();
        let on_event = |event: &_| progress.show(event);
        let session = Session { on_event: &on_event, ..Session::new(&registry) };
        let method = self.method.map(Method::from);
        interrupt::end_at_once()?;
        let gap = session.gap(&recorded, (&campaign, &map), effects, self.diagnosis.as_deref())?;
        standard_output::warn_of_unused(&gap);
        let corrected = session.correct_gap(gap, &recorded, &map, method, self.out.as_deref())?;
        progress.clear();
        if self.json {
            let warnings: Vec<String> = recorded.read.warnings.iter().map(ToString::to_string).collect();
            let values = || {
                Ok::<_, SessionError>(json!({
                    "correction": corrected.map,
                    "diagnosis_file": corrected.gap.stored,
                    "diagnosis": corrected.gap.json()?,
                    "identified": corrected.identified.json(Some(&recorded.path), &warnings),
                }))
            };
            return standard_output::print_json(&with_messages(values)?);
        }
        standard_output::show(&correction(&corrected.map, &corrected.gap.diagnosed.diagnosis))
    }
}
