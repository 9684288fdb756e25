//! Errors of values below `virtual_lab:`.

use crate::virtual_lab::name::NAME;
use mapper_core::{BackendError, Channel, with_unit};
use mapper_physics::rig::effect::EffectError;
use mapper_yaml::units::{Kind, UnitError};
use std::ops::RangeInclusive;

/// An error in one of the lab's settings. [`BackendError::Settings`] carries it together with the key.
#[derive(Debug, thiserror::Error)]
pub enum SettingProblem {
    /// An unknown key, or a value of the wrong type.
    #[error(transparent)]
    Form(#[from] serde_json::Error),
    /// A value outside its range.
    #[error("{} is not between {low} and {}", with_unit(value, unit), with_unit(high, unit))]
    OutOfRange {
        /// The value.
        value: f64,
        /// Unit of the three values; empty for ratios.
        unit: &'static str,
        /// Smallest value.
        low: f64,
        /// Largest value.
        high: f64,
    },
    /// A value that must be above zero.
    #[error("{value} {unit} must be above 0")]
    NotPositive {
        /// The value.
        value: f64,
        /// Unit.
        unit: &'static str,
    },
    /// A value that must not be below zero.
    #[error("{value} {unit} must not be negative")]
    Negative {
        /// The value.
        value: f64,
        /// Unit.
        unit: &'static str,
    },
    /// A text that is not a value with a unit of the right kind.
    #[error("{source}; {}", source.remedy(*kind))]
    Quantity {
        /// Physical quantity.
        kind: Kind,
        /// The error in the text.
        source: UnitError,
    },
    /// A value in a unit with only one notation.
    #[error("`{text}` is not a number and `{unit}`: write e.g. `1e-6 {unit}`")]
    NotInUnit {
        /// The written text.
        text: String,
        /// The unit.
        unit: String,
    },
    /// A bare number without its unit.
    #[error("{value} has no unit: write `{value} {unit}`")]
    BareNumber {
        /// The number.
        value: f64,
        /// The unit.
        unit: String,
    },
    /// An effect that is not in the library.
    #[error("unknown effect.{guess} The effects are {known}")]
    UnknownEffect {
        /// The effect that was probably meant: a question after a blank, or empty.
        guess: String,
        /// Ids of the available effects.
        known: String,
    },
    /// Values that do not have the names of the effect's parameters.
    #[error("write {form}")]
    EffectForm {
        /// Every parameter with its unit.
        form: String,
    },
    /// An error reported by the effect itself.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// An unknown drifting quantity.
    #[error("`{cause}` cannot drift: write a measured channel, `fouling` or `bearing_friction`")]
    UnknownDrift {
        /// The written text.
        cause: String,
    },
    /// A change of zero duration.
    #[error("the duration {over_s} s must be above 0; remove `over` for a step")]
    NoDuration {
        /// The written duration, s.
        over_s: f64,
    },
    /// A fault of a sensor number that the channel does not have.
    #[error(
        "the campaign declares {count} redundant sensors of {channel}: write the number of one of them, from 1"
    )]
    NoElement {
        /// The channel.
        channel: Channel,
        /// Number of redundant sensors; 0 for a single one.
        count: usize,
    },
    /// A probe diameter of a channel without a simulated probe.
    #[error("only T2 probes have a simulated tip: write `lag` for {channel}")]
    NoProbe {
        /// The channel.
        channel: Channel,
    },
    /// A drift that makes the machine unphysical.
    #[error("{text} is too large: at most {} %", 100.0 * limit_ratio)]
    DriftTooLarge {
        /// The written text.
        text: String,
        /// Largest change, ratio.
        limit_ratio: f64,
    },
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
