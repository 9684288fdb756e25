//! Maps from gas turbine programs: tables over speed and beta, scaled to the design point of an engine.

pub(crate) mod beta_tables;
pub(crate) mod design_point;
