//! Proposal of a channel map for a log, from names, units, ranges and physics, with the certainty of each entry.

mod channel_proposal;
mod names;
mod physics;
mod propose;
mod remark;
mod shared_units;
mod tag_stations;
mod yaml;

pub use channel_proposal::{Ambient, Certainty, NominalFlows, Proposal, ProposedChannel};
pub use propose::propose;
pub use remark::ProposalRemark;
pub(crate) use remark::short;
pub use yaml::channel_map_text;
