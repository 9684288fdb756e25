//! Proposal of a channel map for a log, from names, units, ranges and physics, with the certainty of each entry.

mod channel_proposal;
mod physics;
mod propose;
mod remark;
mod shared_units;
mod tag_stations;

pub use channel_proposal::{Ambient, Certainty, NominalFlows, Proposal, ProposedChannel, channel_map_text};
pub use propose::propose;
pub use remark::ProposalRemark;
pub(crate) use remark::short;
