//! Errors that prevent a diagnosis.

use crate::gap::preconditions::problem::Problem;
use crate::gap::residuals::study::PredictError;

/// Why a recording cannot be diagnosed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum GapError {
    /// The recording does not fit the campaign, or required data are missing.
    #[error(transparent)]
    Recording(#[from] Problem),
    /// The nominal model cannot follow the recording.
    #[error("the nominal model cannot follow this recording: {0}; is it of this machine?")]
    Predict(#[from] PredictError),
}
