//! Diagnosis of the gap between the model and a rig: its location, its cause, the gap reduction and the next step. See `docs/explanation/gap.md` for
//! the method and its limits.

pub mod best_fit;
pub mod calibrated_model;
pub mod causes;
pub mod correction;
pub mod diagnose;
pub mod findings;
pub(crate) mod gap_reduction;
pub mod joint;
pub mod model_error;
pub mod next_experiment;
pub mod preconditions;
pub mod residuals;
