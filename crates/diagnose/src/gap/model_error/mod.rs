//! Errors of the model's equations: declared by the campaign, or measured by a fault-free reference recording of the same rig.

pub(crate) mod baseline;
pub(crate) mod structure;
