//! Arguments that several commands share: campaigns, channel maps, reference states.

use crate::output::exit_code::Code;
use crate::output::failure::Failure;
use clap::Args;
use mapper_campaign::Campaign;
use mapper_core::{MapDescription, ReferenceState};
use mapper_maps::table::parse_reference;
use mapper_recording::ChannelMap;
use mapper_session::map_description;
use std::path::{Path, PathBuf};

/// Refuses an option that has another name now.
pub fn renamed(new: &'static str) -> impl Fn(&str) -> Result<PathBuf, String> + Clone {
    move |_| Err(format!("this option is now called {new}"))
}

/// Statements about a map file.
#[derive(Debug, Default, Args)]
pub struct MapReading {
    /// Reference state of the file's corrected quantities, if the file does not give it: SAE, Garrett, BorgWarner or "T, P"
    #[arg(long, value_name = "STATE")]
    pub reference: Option<String>,
    /// Corrected speed of the design point, for a file with relative speeds (NPSS, pyCycle), e.g. "150000 rpm"
    #[arg(long, value_name = "SPEED")]
    pub design_speed: Option<String>,
    /// Map description (YAML) with data that are not in the file; `mapper map inspect --write-description` writes one
    #[arg(long, value_name = "FILE")]
    pub description: Option<PathBuf>,
    /// One entry of a map description, e.g. `flow=lb/min`, `speed=#1 [krpm]`; may be repeated
    #[arg(long = "with", value_name = "KEY=VALUE", value_parser = key_and_value)]
    pub with: Vec<(String, String)>,
}

impl MapReading {
    /// All statements together.
    pub fn description(&self) -> Result<MapDescription, Failure> {
        let with = self.with.iter().map(|(key, value)| (key.as_str(), value.as_str()));
        let design = self.design_speed.iter().map(|speed| ("design_speed", speed.as_str()));
        let stated = map_description(self.description.as_deref(), with.chain(design))?;
        Ok(MapDescription { reference: reference(self.reference.as_deref())?.or(stated.reference), ..stated })
    }
}

/// `KEY=VALUE`.
pub fn key_and_value(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("write KEY=VALUE, e.g. `separator=;`")?;
    Ok((key.trim().to_owned(), value.to_owned()))
}

/// The campaign of an option, if given.
pub fn given_campaign(path: Option<&Path>) -> Result<Option<Campaign>, Failure> {
    path.map(|path| mapper_campaign::load(path).map_err(Failure::of_campaign)).transpose()
}

/// The channel map of an option; by default the one for recordings of this program.
pub fn channel_map(path: Option<&Path>) -> Result<ChannelMap, Failure> {
    Ok(path.map(mapper_session::channel_map).transpose()?.unwrap_or_else(ChannelMap::native))
}

/// The reference state of an option: SAE, Garrett, BorgWarner or "T, P".
pub fn reference(text: Option<&str>) -> Result<Option<ReferenceState>, Failure> {
    text.map(|text| parse_reference(text).map_err(|error| Failure::new(Code::BadInput, error))).transpose()
}
