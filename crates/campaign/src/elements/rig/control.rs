//! `speed_control:` and `safe_state:`.

use crate::si_values::value_or;
use crate::units::{Duration, Fraction, PressureRate, Quantity};
use mapper_core::{SafeTrajectory, SpeedControlSettings};
use mapper_yaml::keys::Off;
use schemars::JsonSchema;
use serde::Deserialize;

/// The safe shutdown, in place of that of the rig: the valve opens and the heater switches off at once, P3 falls, then the air is cut.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SafeStateFile {
    /// Rate at which P3 goes down.
    #[schemars(extend("x-min" = "1 kPa/s", "x-max" = "10000 kPa/s"), example = &"100 kPa/s")]
    pressure_slew: Quantity<PressureRate>,
    /// Opening of the back-pressure valve during the shutdown; 1 if none is given. A step with a larger opening keeps it.
    #[schemars(range(min = 0.5, max = 2.5), example = 1.0)]
    opening: Option<f64>,
    /// Maximum duration of the shutdown, after which the air is cut at any P3; 20 s if none is given.
    #[schemars(extend("x-min" = "1 s", "x-max" = "2 min"), example = &"20 s")]
    within: Option<Quantity<Duration>>,
}

impl SafeStateFile {
    /// The shutdown, with defaults filled in.
    pub(crate) fn trajectory(self) -> SafeTrajectory {
        let usual = SafeTrajectory::default();
        SafeTrajectory {
            p3_slew_pa_s: Some(self.pressure_slew.value),
            valve_opening_ratio: self.opening.unwrap_or(usual.valve_opening_ratio),
            within_s: crate::si_values::value_or(self.within, usual.within_s),
        }
    }
}

// Untagged: the type of the YAML node determines the variant, and the schema has been checked.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum SpeedControlFile {
    Off(Off),
    Settings(SettingsFile),
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
        Some(SpeedControlFile::Off(Off)) => None,
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
    fn what_is_left_out_has_its_default() {
        let read = |text| crate::testing::any::<SafeStateFile>(text).unwrap().trajectory();
        let expected = SafeTrajectory { p3_slew_pa_s: Some(50e3), valve_opening_ratio: 1.0, within_s: 20.0 };
        assert_eq!(read("{pressure_slew: 50 kPa/s}"), expected);
        let written = read("{pressure_slew: 50 kPa/s, opening: 2, within: 8 s}");
        assert_eq!((written.valve_opening_ratio, written.within_s), (2.0, 8.0));
        assert!(crate::testing::any::<SafeStateFile>("{opening: 2}").is_err());
    }

    #[test]
    fn what_is_written_and_what_it_means() {
        let read =
            |text: &str| speed_control(crate::testing::any(text).unwrap()).map(|control| control.band_ratio);
        assert_eq!((read("off"), read("false")), (None, None));
        assert_eq!((read("{}"), read("{band: 1 %}")), (Some(0.003), Some(0.01)));
        assert_eq!(speed_control(None), Some(SpeedControlSettings::default()));
    }
}
