//! Mistakes in the settings of the virtual lab.

use mapper_core::{BackendError, Channel, with_unit};
use mapper_physics::rig::effect::EffectError;
use mapper_yaml::units::{Kind, UnitError};
use std::ops::RangeInclusive;

/// An error in one of the lab's settings. [`BackendError::Settings`] carries it together with the key.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum SettingProblem {
    /// An unknown key, or a value of the wrong type.
    #[error(transparent)]
    Form(#[from] serde_json::Error),
    /// The unit is empty for ratios.
    #[error("{} is not between {low} and {}", with_unit(value, unit), with_unit(high, unit))]
    OutOfRange { value: f64, unit: &'static str, low: f64, high: f64 },
    #[error("{value} {unit} must be above 0")]
    NotPositive { value: f64, unit: &'static str },
    #[error("{value} {unit} must not be negative")]
    Negative { value: f64, unit: &'static str },
    /// A text that is not a value with a unit of the right kind.
    #[error("{source}; {}", source.remedy(*kind))]
    Quantity { kind: Kind, source: UnitError },
    #[error("`{text}` is not a number and `{unit}`: write e.g. `1e-6 {unit}`")]
    NotInUnit { text: String, unit: String },
    #[error("{value} has no unit: write `{value} {unit}`")]
    BareNumber { value: f64, unit: String },
    /// `guess`: the effect that was probably meant, as a question after a blank, or empty.
    #[error("unknown effect.{guess} The effects are {known}, or the path of a file in rhai")]
    UnknownEffect { guess: String, known: String },
    #[error(transparent)]
    EffectFile(Box<dyn std::error::Error + Send + Sync>),
    #[error("write {form}")]
    EffectForm { form: String },
    #[error(transparent)]
    Effect(#[from] EffectError),
    #[error("`{cause}` cannot drift: write a measured channel, `fouling` or `bearing_friction`")]
    UnknownDrift { cause: String },
    #[error("the duration {over_s} s must be above 0; remove `over` for a step")]
    NoDuration { over_s: f64 },
    /// `count` is 0 for a single sensor.
    #[error(
        "the campaign declares {count} redundant sensors of {channel}: write the number of one of them, from 1"
    )]
    NoElement { channel: Channel, count: usize },
    #[error("only T2 probes have a simulated tip: write `lag` for {channel}")]
    NoProbe { channel: Channel },
    #[error("{text} is too large: at most {} %", 100.0 * limit_ratio)]
    DriftTooLarge { text: String, limit_ratio: f64 },
}

impl SettingProblem {
    /// The problem at its key below `virtual_lab:`.
    pub fn at(self, path: impl Into<String>) -> BackendError {
        BackendError::Settings { backend: NAME.to_owned(), path: path.into(), source: Box::new(self) }
    }
}

/// Refuses a value outside its range.
///
/// # Errors
/// [`SettingProblem::OutOfRange`].
pub fn check_range(value: f64, unit: &'static str, range: RangeInclusive<f64>) -> Result<(), SettingProblem> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(SettingProblem::OutOfRange { value, unit, low: *range.start(), high: *range.end() })
}

/// Name of this backend in campaigns.
pub const NAME: &str = "virtual_lab";
