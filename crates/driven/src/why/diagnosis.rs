//! What a diagnosis of one side says.

use super::side::Which;
use mapper_gap::report::{Estimate, SmallestSeen};
use serde::Serialize;
use std::collections::BTreeMap;

/// The word on the whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Word {
    /// Nothing is seen beyond what is not known of such a machine anyway.
    WithinTolerance,
    /// One cause explains it.
    Named,
    /// Several causes explain it as well as each other.
    NotToldApart,
    /// A cause explains what was fitted, and makes phases that no fit saw no better: it is not named.
    NotBorneOut,
    /// Nothing of the catalogue explains it.
    Outside,
}

/// A cause that explains what is judged.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cause {
    /// Ids of its effects.
    pub effects: Vec<String>,
    /// Their names for people.
    pub names: Vec<String>,
    /// Probability.
    pub probability: f64,
    /// Sizes, by parameter, with 95 % intervals.
    pub parameters: BTreeMap<String, Estimate>,
    /// Parameters that stand at an end of their range: what acts is more than such an effect can be.
    pub at_the_end: Vec<String>,
    /// What it leaves beside the noise, K, for each judged channel in their order.
    pub left_k: Vec<f64>,
}

/// An effect that cannot be asked here.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NotAsked {
    /// Id of the effect.
    pub effect: String,
    /// Its name for people.
    pub name: String,
    /// Why not.
    pub reason: String,
}

/// A phase of the log, predicted by fits that did not see it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Phase {
    /// Time of its first row, s.
    pub from_s: f64,
    /// Time of its last row, s.
    pub until_s: f64,
    /// Speed at its begin, rpm.
    pub from_rpm: f64,
    /// Speed at its end, rpm.
    pub until_rpm: f64,
    /// Root mean square of the first judged channel less its prediction without a cause, K.
    pub before_k: f64,
    /// The same with the cause that the other phases choose.
    pub after_k: f64,
    /// That cause; empty where none is named.
    pub chosen: Vec<String>,
}

/// How far the gap shrinks on phases that no fit saw.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct HeldOut {
    /// The phases.
    pub phases: Vec<Phase>,
    /// Root mean square over all of them without a cause, K.
    pub before_k: f64,
    /// With the cause, K.
    pub after_k: f64,
    /// Mean over the phases of what is taken off each, K.
    pub shrink_k: f64,
    /// Lower end of its 95 % interval: Student's, each phase one witness.
    pub shrink_low_k: f64,
    /// Upper end.
    pub shrink_high_k: f64,
}

/// What lies behind the part that was fitted.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Beyond {
    /// Time of its first row, s.
    pub from_s: f64,
    /// Time of its last row, s.
    pub until_s: f64,
    /// Rows.
    pub rows: usize,
    /// Root mean square of the first judged channel less its prediction without a cause, K.
    pub before_k: f64,
    /// The same with the likeliest cause; as without where none is named.
    pub after_k: f64,
    /// What that was expected to be, K: median and 95 % interval.
    pub expected_k: f64,
    /// Its lower end, K.
    pub expected_low_k: f64,
    /// Its upper end, K.
    pub expected_high_k: f64,
    /// Share of the rows whose 95 % interval holds the reading, ratio.
    pub inside_ratio: f64,
}

/// An unknown of the side as the likeliest explanation leaves it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Unknown {
    /// Short name.
    pub name: &'static str,
    /// What it is.
    pub description: &'static str,
    /// Its unit; empty for a ratio.
    pub unit: &'static str,
    /// Best value.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
    /// Whether the log tells it: else it is what was known beforehand.
    pub told: bool,
}

/// The first judged channel over time, K.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Course {
    /// Times, s.
    pub t_s: Vec<f64>,
    /// As read.
    pub read_k: Vec<f64>,
    /// As the side without a cause would have it.
    pub before_k: Vec<f64>,
    /// With the likeliest cause; as without where none is named.
    pub after_k: Vec<f64>,
}

/// A diagnosis of one side of a machine, driven by its measured neighbours.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Diagnosis {
    /// The side.
    pub side: Which,
    /// Symbols of the channels that drive.
    pub driven_by: Vec<&'static str>,
    /// Symbols of the channels that are judged, the first before all.
    pub judged: Vec<&'static str>,
    /// Time up to which it was fitted, s; infinite where all of it was.
    #[serde(skip_serializing_if = "infinite")]
    pub fitted_until_s: f64,
    /// The word on the whole.
    pub word: Word,
    /// Probability that nothing acts but what is not known anyway.
    pub probability_none: f64,
    /// Probability that something outside the catalogue acts.
    pub probability_outside: f64,
    /// Causes, likeliest first.
    pub causes: Vec<Cause>,
    /// How many of these, from the first, are not told apart: together they have 95 % of what all have.
    pub open: usize,
    /// Root mean square of the first judged channel in the fitted part, K: without a cause.
    pub before_k: f64,
    /// The same with the likeliest cause, K.
    pub after_k: f64,
    /// How far it shrinks on phases that no fit saw; `None` where the log has fewer than two phases.
    pub held_out: Option<HeldOut>,
    /// What lies behind the fitted part; `None` where nothing does.
    pub beyond: Option<Beyond>,
    /// What was asked, and how small it would have been seen.
    pub asked: Vec<SmallestSeen>,
    /// What of the catalogue cannot be asked here.
    pub not_asked: Vec<NotAsked>,
    /// What is not known of the side, as the likeliest explanation leaves it.
    pub unknowns: Vec<Unknown>,
    /// The first judged channel over time.
    pub course: Course,
    /// Rows that could not be used.
    pub lost_rows: usize,
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde asks for")]
fn infinite(value: &f64) -> bool {
    value.is_infinite()
}
