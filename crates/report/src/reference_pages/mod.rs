//! Generated pages of the documentation: campaign keys, script functions, and the reproduction of the paper's figures.

pub(crate) mod campaign_page;
pub(crate) mod sequence_page;
