//! `mapper map fmu`: the machine as an FMU.

use crate::command_line::shared_arguments::{channel_map, given_campaign};
use crate::output::failure::Failure;
use crate::output::standard_output::Replace;
use crate::{output::standard_output, registry};
use clap::Args;
use mapper_session::{Recorded, Session};
use std::path::PathBuf;

/// Write the machine as an FMU (FMI 2.0 co-simulation, C source): map, heat transfer, housings, shaft
#[derive(Debug, Args)]
pub struct Fmu {
    /// Run directory or recording, which is identified, or a campaign (.yaml) for its nominal machine
    pub machine: PathBuf,
    /// New file
    #[arg(long, value_name = "FILE.fmu")]
    pub out: PathBuf,
    /// Compile the sources for this computer too, by the compiler in CC [default: cc]
    #[arg(long)]
    pub compile: bool,
    /// Channel map: where a recording made by another program holds the rig's channels (YAML)
    #[arg(long, value_name = "FILE")]
    pub channels: Option<PathBuf>,
    /// Campaign with machine, sensors and window, instead of the one attached to the recording
    #[arg(long, value_name = "FILE")]
    pub campaign: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub replace: Replace,
}

impl Fmu {
    pub fn run(&self) -> Result<(), Failure> {
        let (registry, existing) = (registry::registry(), self.replace.existing());
        let session = Session::new(&registry);
        let nominal = self.machine.extension().is_some_and(|ending| ending == "yaml" || ending == "yml");
        let written = if nominal {
            let campaign = mapper_campaign::load(&self.machine).map_err(Failure::of_campaign)?;
            session.nominal_fmu(&campaign, self.compile, &self.out, existing)?
        } else {
            let given = given_campaign(self.campaign.as_deref())?;
            let map = channel_map(self.channels.as_deref())?;
            let recorded = Recorded::read_run(&registry, &self.machine, &map, given.as_ref())?;
            session.identified_fmu(recorded, &map, self.compile, &self.out, existing)?
        };
        if self.json {
            return standard_output::print_json(&written);
        }
        let library = written.binary.as_deref().unwrap_or("none; the importer compiles the sources");
        standard_output::print(&format!(
            "{}\norigin     {}\nstart      {:.0} rpm\nlibrary    {library}\n",
            written.file.display(),
            written.origin,
            written.start_speed_rpm
        ))
    }
}
