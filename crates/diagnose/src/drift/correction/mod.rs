//! Map points and recordings corrected for a detected drift, and the visits of a repeated jump.

pub(crate) mod corrected;
pub(crate) mod subtract_drift;
pub(crate) mod visits;
