//! Cases of the blind test: random causes and strengths, laboratory equations, hidden truth, and stored form.

pub(crate) mod case;
pub(crate) mod cause;
pub(crate) mod equations;
pub(crate) mod kind;
pub(crate) mod stored_case;
pub(crate) mod strength;
pub(crate) mod truth;
