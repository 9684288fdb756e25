//! Proposal of a channel map for a log, from names, units, ranges and physics, with the certainty of each entry.

mod channel_proposal;
mod physics;
mod propose;
mod shared_units;
mod tag_stations;

pub(crate) use channel_proposal::short;
pub use channel_proposal::{
    Ambient, Certainty, NominalFlows, Proposal, ProposalRemark, ProposedChannel, channel_map_text,
};
pub use propose::propose;
