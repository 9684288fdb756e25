//! What came of the isothermal zero that a campaign asks for.

use crate::IdentifyConfig;
use crate::zero::{
    IsothermalZero, NoZero, ZeroSettings, isothermal_zero, isothermal_zero_with_a_fault, zeroed,
};
use mapper_core::{Recording, Soak};
use serde::{Serialize, Serializer};

/// Whether offsets were subtracted from a recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub enum ZeroOutcome {
    /// Offsets were subtracted.
    Found(IsothermalZero),
    /// A zero was asked for and the recording has none; the declared offsets stand.
    Refused(NoZero),
    /// No zero was asked for.
    #[default]
    NotAsked,
}

impl ZeroOutcome {
    /// Looks for the zero of a recording where a soak was asked for.
    pub fn of(recording: &Recording, config: &IdentifyConfig, soak: Option<Soak>) -> Self {
        let Some(soak) = soak else { return ZeroOutcome::NotAsked };
        isothermal_zero(recording, config, &ZeroSettings::from(soak))
            .map_or_else(ZeroOutcome::Refused, ZeroOutcome::Found)
    }

    /// The same of a rig of which a temperature sensor may be broken.
    pub fn with_a_fault(recording: &Recording, config: &IdentifyConfig, soak: Option<Soak>) -> Self {
        let Some(soak) = soak else { return ZeroOutcome::NotAsked };
        isothermal_zero_with_a_fault(recording, config, &ZeroSettings::from(soak))
            .map_or_else(ZeroOutcome::Refused, ZeroOutcome::Found)
    }

    /// The zero, where one was found.
    pub fn found(&self) -> Option<&IsothermalZero> {
        if let ZeroOutcome::Found(zero) = self { Some(zero) } else { None }
    }

    /// Takes the offsets off a recording, and leaves what is not known of them in the configuration; both stay as they are
    /// where no zero was found.
    pub fn take_off(&self, recording: Recording, config: IdentifyConfig) -> (Recording, IdentifyConfig) {
        match self {
            ZeroOutcome::Found(zero) => zeroed(recording, config, zero),
            ZeroOutcome::Refused(_) | ZeroOutcome::NotAsked => (recording, config),
        }
    }
}

/// Offsets and what is left of them, K or Pa, with the stretch they come from; `{"refused": reason}`, or `null` where none was asked for.
impl Serialize for ZeroOutcome {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Refused {
            refused: String,
        }
        match self {
            ZeroOutcome::Found(zero) => zero.serialize(serializer),
            ZeroOutcome::Refused(reason) => Refused { refused: reason.to_string() }.serialize(serializer),
            ZeroOutcome::NotAsked => serializer.serialize_unit(),
        }
    }
}
