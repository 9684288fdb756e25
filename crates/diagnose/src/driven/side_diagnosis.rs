//! Result of the diagnosis of one side.

use crate::driven::side::Side;
use crate::gap::report::{Candidate, SmallestSeen};
use serde::Serialize;

/// Overall verdict.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SideVerdict {
    /// Nothing exceeds the prior uncertainty of such a machine.
    WithinTolerance,
    /// One cause explains it.
    Named,
    /// Several causes explain it equally well.
    NotDistinguished,
    /// A cause explains the fitted part but does not improve held-out phases, so it is not named.
    NotBorneOut,
    /// No library cause explains it.
    Outside,
}

/// A cause that explains the judged channels.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SideCause {
    /// The cause with its probability and the sizes of its effects.
    #[serde(flatten)]
    pub candidate: Candidate,
    /// Parameters at a limit of their range: the real cause exceeds this effect's range.
    pub at_the_end: Vec<String>,
    /// Its residual beyond noise, K, for each judged channel in order.
    pub model_error_sigma_k: Vec<f64>,
}

/// An effect that cannot be diagnosed here.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotDiagnosable {
    /// Id of the effect.
    pub effect: String,
    /// Display name.
    pub name: String,
    pub reason: String,
}

/// A phase of the log, predicted by fits to other phases.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Phase {
    /// Time of its first row, s.
    pub from_s: f64,
    /// Time of its last row, s.
    pub until_s: f64,
    /// Speed at its start, rpm.
    pub from_rpm: f64,
    /// Speed at its end, rpm.
    pub until_rpm: f64,
    /// Root mean square of the first judged channel minus its prediction without a cause, K.
    pub before_k: f64,
    /// The same with the cause selected by the other phases.
    pub after_k: f64,
    /// That cause; empty if none is named.
    pub chosen: Vec<String>,
}

/// Gap reduction on held-out phases.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeldOut {
    /// The phases.
    pub phases: Vec<Phase>,
    /// Root mean square over all of them without a cause, K.
    pub before_k: f64,
    /// With the cause, K.
    pub after_k: f64,
    /// Mean reduction over the phases, K.
    pub gap_reduction_k: f64,
    /// Lower end of its 95 % interval (Student's t, one sample per phase).
    pub gap_reduction_low_k: f64,
    /// Upper end.
    pub gap_reduction_high_k: f64,
}

/// Prediction after the fitted part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Beyond {
    /// Time of its first row, s.
    pub from_s: f64,
    /// Time of its last row, s.
    pub until_s: f64,
    /// Rows.
    pub rows: usize,
    /// Root mean square of the first judged channel minus its prediction without a cause, K.
    pub before_k: f64,
    /// The same with the likeliest cause; equal to `before_k` if none is named.
    pub after_k: f64,
    /// Expected value of `after_k`, K: median and 95 % interval.
    pub expected_k: f64,
    /// Its lower end, K.
    pub expected_low_k: f64,
    /// Its upper end, K.
    pub expected_high_k: f64,
    /// Share of the rows with the reading inside its 95 % interval, ratio.
    pub inside_ratio: f64,
}

/// An unknown of the side under the likeliest explanation.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unknown {
    /// Short name.
    pub name: &'static str,
    /// Description.
    pub description: &'static str,
    /// Its unit; empty for a ratio.
    pub unit: &'static str,
    /// Best value.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether the log identifies it; otherwise the prior dominates.
    pub identified: bool,
}

/// The first judged channel over time, K.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ChannelTrace {
    /// Times, s.
    pub t_s: Vec<f64>,
    /// Measured.
    pub read_k: Vec<f64>,
    /// Prediction without a cause.
    pub before_k: Vec<f64>,
    /// Prediction with the likeliest cause; equal to `before_k` if none is named.
    pub after_k: Vec<f64>,
}

/// A diagnosis of one side of a machine, driven by its measured neighbours.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The side.
    pub side: Side,
    /// Symbols of the driving channels.
    pub driven_by: Vec<&'static str>,
    /// Symbols of the judged channels, most important first.
    pub judged: Vec<&'static str>,
    /// End of the fitted part, s; infinite if all of the log was fitted.
    #[serde(skip_serializing_if = "infinite")]
    pub fitted_until_s: f64,
    /// Overall verdict.
    pub word: SideVerdict,
    /// Probability of no cause beyond the prior uncertainty.
    pub probability_none: f64,
    /// Probability of a cause outside the effect library.
    pub probability_outside: f64,
    /// Causes, likeliest first.
    pub causes: Vec<SideCause>,
    /// Number of leading causes that the log does not distinguish.
    pub open: usize,
    /// Root mean square of the first judged channel in the fitted part, K: without a cause.
    pub before_k: f64,
    /// The same with the likeliest cause, K.
    pub after_k: f64,
    /// Gap reduction on held-out phases; `None` if the log has fewer than two phases.
    pub held_out: Option<HeldOut>,
    /// Prediction after the fitted part; `None` if nothing follows it.
    pub beyond: Option<Beyond>,
    /// Diagnosable effects with their smallest detectable size.
    pub asked: Vec<SmallestSeen>,
    /// Library effects that cannot be diagnosed here.
    pub not_asked: Vec<NotDiagnosable>,
    /// Unknowns of the side under the likeliest explanation.
    pub unknowns: Vec<Unknown>,
    /// The first judged channel over time.
    pub time_history: ChannelTrace,
    /// Unusable rows.
    pub lost_rows: usize,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde asks for")]
fn infinite(value: &f64) -> bool {
    value.is_infinite()
}
