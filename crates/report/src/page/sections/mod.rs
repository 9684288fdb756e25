//! The sections of the page, in its order.

pub(crate) mod conditions;
pub(crate) mod head;
pub(crate) mod live;
pub(crate) mod map;
pub(crate) mod notes;
pub(crate) mod plan;
pub(crate) mod points;
pub(crate) mod provenance;
pub(crate) mod step;
