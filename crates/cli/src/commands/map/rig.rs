//! `mapper map rig`: results of a run in addition to the compressor's map.

use crate::command_line::shared_arguments::{channel_map, given_campaign};
use crate::output::failure::Failure;
use crate::{output::standard_output, registry};
use clap::Args;
use mapper_session::{Recorded, Session};
use std::path::PathBuf;

/// Write the other results of a run: thermal model, turbine, pictures of h and of errors
#[derive(Debug, Args)]
pub struct Rig {
    /// Run directory, MCAP file, or log of another program
    pub recording: PathBuf,
    /// Directory for the files; existing files are not replaced
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Channel map: where a recording made by another program holds the rig's channels (YAML)
    #[arg(long, value_name = "FILE")]
    pub channels: Option<PathBuf>,
    /// Campaign with machine, sensors and window, instead of the one attached to the recording
    #[arg(long, value_name = "FILE")]
    pub campaign: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

impl Rig {
    /// Identifies a recording by its campaign's method and writes thermal model, turbine and pictures.
    pub fn run(&self) -> Result<(), Failure> {
        let given = given_campaign(self.campaign.as_deref())?;
        let map = channel_map(self.channels.as_deref())?;
        let registry = registry::registry();
        let recorded = Recorded::read_run(&registry, &self.recording, &map, given.as_ref())?;
        let written = Session::new(&registry).rig_files(recorded, &map, &self.out)?;
        if self.json {
            return standard_output::print_json(&written);
        }
        let lines: String = written.files.iter().map(|path| format!("{}\n", path.display())).collect();
        standard_output::print(&lines)
    }
}
