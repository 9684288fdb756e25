//! `speed_control:`

use crate::si_values::value_or;
use crate::units::{Fraction, Quantity};
use mapper_core::SpeedControlSettings;
use schemars::JsonSchema;
use serde::Deserialize;

// Untagged: the type of the YAML node determines the variant, and the schema has been checked.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum SpeedControlFile {
    Named(NamedSpeedControl),
    Settings(SettingsFile),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum NamedSpeedControl {
    Off,
}

/// Control of the shaft speed.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SettingsFile {
    /// Deviation from the target within which the speed counts as reached; 0.3 % if none is given.
    #[schemars(extend("x-min" = "0.01 %", "x-max" = "10 %"), example = &"0.3 %")]
    band: Option<Quantity<Fraction>>,
}

/// On unless the file switches it off.
pub(crate) fn speed_control(file: Option<SpeedControlFile>) -> Option<SpeedControlSettings> {
    match file {
        Some(SpeedControlFile::Named(NamedSpeedControl::Off)) => None,
        Some(SpeedControlFile::Settings(file)) => {
            Some(SpeedControlSettings { band_ratio: value_or(file.band, SpeedControlSettings::BAND_RATIO) })
        }
        None => Some(SpeedControlSettings::default()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_and_what_it_means() {
        let read =
            |text: &str| speed_control(crate::testing::any(text).unwrap()).map(|control| control.band_ratio);
        assert_eq!((read("off"), read("{}"), read("{band: 1 %}")), (None, Some(0.003), Some(0.01)));
        assert_eq!(speed_control(None), Some(SpeedControlSettings::default()));
    }
}
