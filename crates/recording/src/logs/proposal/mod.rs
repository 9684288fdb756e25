//! The channel map that a log suggests: by names, units, ranges and physics, with what is sure of it and what is not.

mod choose;
mod names;
mod physics;
mod proposed;
mod shared_units;
mod yaml;

pub use choose::propose;
pub use proposed::{Ambient, Certainty, NominalFlows, Proposal, ProposedChannel};
pub use yaml::channel_map_text;
