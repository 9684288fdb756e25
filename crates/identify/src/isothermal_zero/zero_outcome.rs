//! Result of the isothermal zero that a campaign requests.

use crate::IdentifyConfig;
use crate::isothermal_zero::groups::ZeroSettings;
use crate::isothermal_zero::zero::{IsothermalZero, NoZero, isothermal_zero, zeroed};
use mapper_core::Recording;
use serde::{Serialize, Serializer};

/// Whether offsets were subtracted from a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum ZeroOutcome {
    /// Offsets were subtracted.
    Found(IsothermalZero),
    /// A zero was requested but the recording has none; the declared offsets remain.
    Refused(NoZero),
    /// No zero was requested.
    #[default]
    NotRequested,
}

impl ZeroOutcome {
    /// Searches for the zero of a recording, if one was requested.
    pub fn of(recording: &Recording, config: &IdentifyConfig, settings: Option<ZeroSettings>) -> Self {
        let Some(settings) = settings else { return ZeroOutcome::NotRequested };
        isothermal_zero(recording, config, &settings).map_or_else(ZeroOutcome::Refused, ZeroOutcome::Found)
    }

    /// The zero, if one was found.
    pub fn found(&self) -> Option<&IsothermalZero> {
        if let ZeroOutcome::Found(zero) = self { Some(zero) } else { None }
    }

    /// Subtracts the offsets from a recording, and declares their remaining uncertainty in the configuration; both are unchanged if no zero
    /// was found.
    pub fn subtract(&self, recording: Recording, config: IdentifyConfig) -> (Recording, IdentifyConfig) {
        match self {
            ZeroOutcome::Found(zero) => zeroed(recording, config, zero),
            ZeroOutcome::Refused(_) | ZeroOutcome::NotRequested => (recording, config),
        }
    }
}

/// Offsets and their remaining uncertainty, K or Pa, with their segment; `{"refused": reason}`, or `null` if none was requested.
impl Serialize for ZeroOutcome {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Refused {
            refused: String,
        }
        match self {
            ZeroOutcome::Found(zero) => zero.serialize(serializer),
            ZeroOutcome::Refused(reason) => Refused { refused: reason.to_string() }.serialize(serializer),
            ZeroOutcome::NotRequested => serializer.serialize_unit(),
        }
    }
}
