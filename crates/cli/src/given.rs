//! What several commands are given: campaigns, channel maps, reference states.

use crate::exit_code::Code;
use crate::failure::Failure;
use mapper_campaign::Campaign;
use mapper_core::ReferenceState;
use mapper_formats::parse_reference;
use mapper_record::ChannelMap;
use std::path::Path;

/// The campaign of an option, if given.
pub fn given_campaign(path: Option<&Path>) -> Result<Option<Campaign>, Failure> {
    path.map(|path| mapper_campaign::load(path).map_err(Failure::of_campaign)).transpose()
}

/// The channel map of an option; that of our own recordings by default.
pub fn channel_map(path: Option<&Path>) -> Result<ChannelMap, Failure> {
    Ok(path.map(mapper_session::channel_map).transpose()?.unwrap_or_else(ChannelMap::native))
}

/// The reference state of an option: SAE, Garrett, BorgWarner or "T, P".
pub fn reference(text: Option<&str>) -> Result<Option<ReferenceState>, Failure> {
    text.map(|text| parse_reference(text).map_err(|error| Failure::new(Code::BadInput, error))).transpose()
}
