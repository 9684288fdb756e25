//! Diagnosis of the gap between the model and a rig: its location, its cause, the gap reduction and the next step. See `docs/explanation/gap.md` for
//! the method and its limits.

pub mod best_fit;
pub mod calibrated_model;
pub mod causes;
pub mod consequence;
pub mod correction;
pub mod diagnose;
pub mod findings;
pub(crate) mod gap_reduction;
pub mod joint;
pub(crate) mod library_fits;
pub mod model_error;
pub mod next_experiment;
pub mod preconditions;
pub(crate) mod prepare;
pub mod request;
pub mod residuals;
pub mod scores;
pub(crate) mod verdict;

pub use crate::gap::model_error::baseline::{Baseline, Declaration, Lacking};
pub use crate::gap::preconditions::{GapError, Problem};
pub use calibrated_model::{
    CalibratedModelError, ChannelCheck, Expected, ForecastCheck, Found, FoundEffect, FoundTolerance,
    check_forecast, forecast_steps,
};
pub use causes::calibration::{Calibration, Origin, logistic_features};
pub use consequence::{
    AddedUncertainty, CorrectedMap, Correction, NEEDED_PROBABILITY, NotCorrected, PointCorrection,
};
pub use diagnose::Diagnosed;
pub use findings::experiment::{AllowedJump, AlsoChanged, AtRest, Experiment};
pub use findings::report::{
    BalanceClosure, BeyondPrior, Candidate, ChannelGap, ClosureCoefficient, ClosureTerm, Diagnosis, Estimate,
    Gap, JumpPoint, Kind, Next, Onset, Place, PointGap, SmallestSeen, Suggestion, Verdict,
};
pub use findings::warning::{GapWarning, OffsetAtRest};
pub use joint::{Over, Persistence, Value, over_recordings};
pub use request::{BaselineRecording, ClosureSearch, GapRequest, RigRecording};
pub use residuals::nuisance::OUTPUTS;
pub use residuals::study::Study;
pub use scores::{EffectVisibility, Scores};
