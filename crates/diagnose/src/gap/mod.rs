//! Diagnosis of the gap between the model and a rig: location, cause, gap reduction, next step. Method: `docs/explanation/gap.md`.

pub(crate) mod baseline;
pub(crate) mod best_fit;
pub(crate) mod calibrated_model;
pub(crate) mod causes;
pub(crate) mod consequence;
pub(crate) mod diagnose;
pub(crate) mod experiment;
pub(crate) mod gap_reduction;
pub(crate) mod library_fits;
pub(crate) mod next_experiment;
pub(crate) mod preconditions;
pub(crate) mod report;
pub(crate) mod request;
pub(crate) mod residuals;
pub(crate) mod scores;
pub(crate) mod stored;
pub(crate) mod structure;

pub use crate::gap::baseline::Baseline;
pub use crate::gap::preconditions::GapError;
pub use calibrated_model::{
    CalibratedModelError, Expected, ForecastCheck, Found, FoundEffect, FoundTolerance,
};
pub use causes::additions::{Calibration, Origin};
pub use consequence::{CorrectedMap, Correction, NotCorrected, PointCorrection};
pub use diagnose::{Diagnosed, Evidence};
pub use experiment::{AllowedJump, AlsoChanged, AtRest, Experiment, GapWarning, OffsetAtRest};
pub use report::{
    BeyondPrior, Candidate, ChannelGap, ClosureTerm, Diagnosis, Estimate, Gap, Kind, MapEffect, Next,
    PointGap, SmallestSeen, Suggestion, Verdict,
};
pub use request::{BaselineRecording, ClosureSearch, GapRequest, RigRecording};
pub use residuals::study::Study;
pub use scores::{EffectVisibility, Scores};
pub use stored::{RestoreError, StoredFits};
