//! Campaign keys of the virtual lab: settings, drifts, effects of the true machine, and sensor faults.

pub(crate) mod effects_file;
pub(crate) mod elements_file;
pub(crate) mod setting_problem;
pub(crate) mod settings_file;
