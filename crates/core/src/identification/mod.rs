//! Settings and results of identification: window rule, tolerances, identified points, shared parameters and uncertainty.

pub(crate) mod acceptance;
pub(crate) mod common_errors;
pub(crate) mod identified;
pub(crate) mod inlet_convection;
pub(crate) mod joint_settings;
pub(crate) mod model_tolerances;
pub(crate) mod result_remark;
pub(crate) mod settle_bands;
pub(crate) mod thermal_model;
pub(crate) mod uncertainty_budget;
pub(crate) mod warning;
pub(crate) mod window_rule;
