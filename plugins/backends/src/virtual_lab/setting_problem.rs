//! What can be wrong with a value below `virtual_lab:`.

use super::name::NAME;
use mapper_core::{BackendError, Channel, with_unit};
use mapper_physics::effect::EffectError;
use mapper_yaml::units::{Kind, UnitError};
use std::ops::RangeInclusive;

/// What is wrong with one of the lab's settings. [`BackendError::Settings`] carries it beside the key.
#[derive(Debug, thiserror::Error)]
pub enum SettingProblem {
    /// An unknown key, or a value of another kind.
    #[error(transparent)]
    Form(#[from] serde_json::Error),
    /// A value without meaning.
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
        /// Its unit.
        unit: &'static str,
    },
    /// A value that must not be below zero.
    #[error("{value} {unit} must not be negative")]
    Negative {
        /// The value.
        value: f64,
        /// Its unit.
        unit: &'static str,
    },
    /// A text that is not a value with a unit of the right kind.
    #[error("{source}; {}", source.remedy(*kind))]
    Quantity {
        /// What is measured.
        kind: Kind,
        /// What is wrong with the text.
        source: UnitError,
    },
    /// A value in a unit of which there is only one way of writing.
    #[error("`{text}` is not a number and `{unit}`: write e.g. `1e-6 {unit}`")]
    NotInUnit {
        /// What was written.
        text: String,
        /// The unit.
        unit: String,
    },
    /// A bare number where a unit is needed.
    #[error("{value} lacks its unit: write `{value} {unit}`")]
    BareNumber {
        /// The number.
        value: f64,
        /// The unit.
        unit: String,
    },
    /// An effect that is not in the catalogue.
    #[error("there is no such effect; the effects are {known}")]
    UnknownEffect {
        /// Ids of the effects there are.
        known: String,
    },
    /// Values that do not have the names of the effect's parameters.
    #[error("write {form}")]
    EffectForm {
        /// Every parameter with its unit.
        form: String,
    },
    /// What the effect itself says of its values.
    #[error(transparent)]
    Effect(#[from] EffectError),
    /// A cause of drift that the lab does not have.
    #[error("`{cause}` cannot drift: write a measured channel, `fouling` or `bearing_friction`")]
    UnknownDrift {
        /// What was written.
        cause: String,
    },
    /// A change that takes no time.
    #[error("{over_s} s is not a duration for a change; leave `over` out for a step")]
    NoDuration {
        /// What was written, s.
        over_s: f64,
    },
    /// A fault of a sensor that the channel does not have.
    #[error(
        "{channel} has {count} sensors of which one could fail: name one of several that the campaign declares"
    )]
    NoElement {
        /// The channel.
        channel: Channel,
        /// How many of several sensors it has; 0 where it has but one.
        count: usize,
    },
    /// A probe where none is simulated.
    #[error("only the probes of T2 have a tip here: write `lag` for {channel}")]
    NoProbe {
        /// The channel.
        channel: Channel,
    },
    /// A drift after which the machine has no meaning.
    #[error("{text} is beyond {} %", 100.0 * limit_ratio)]
    DriftTooLarge {
        /// What was written.
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
pub fn within(value: f64, unit: &'static str, range: RangeInclusive<f64>) -> Result<(), SettingProblem> {
    if range.contains(&value) {
        return Ok(());
    }
    Err(SettingProblem::OutOfRange { value, unit, low: *range.start(), high: *range.end() })
}
