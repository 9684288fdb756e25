//! Files that several commands take: campaigns and channel maps.

use crate::failure::Failure;
use mapper_campaign::Campaign;
use mapper_record::ChannelMap;
use std::path::Path;

/// The campaign of an option, where it was given.
pub fn given_campaign(path: Option<&Path>) -> Result<Option<Campaign>, Failure> {
    path.map(|path| mapper_campaign::load(path).map_err(Failure::of_campaign)).transpose()
}

/// The channel map of an option; that of our own recordings where none was given.
pub fn channel_map(path: Option<&Path>) -> Result<ChannelMap, Failure> {
    Ok(path.map(mapper_session::channel_map).transpose()?.unwrap_or_else(ChannelMap::native))
}
