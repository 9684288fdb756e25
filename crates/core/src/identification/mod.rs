//! Settings and results of identification: window rule, tolerances, identified points, shared parameters and uncertainty.

pub(crate) mod identified;
pub(crate) mod settings;
pub(crate) mod thermal_model;
pub(crate) mod turbine_point;
pub(crate) mod warning;
