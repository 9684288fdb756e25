//! `surge_search:`

use crate::si_values::value_or;
use crate::units::{Duration, Fraction, Quantity};
use mapper_core::SurgeSearchSettings;
use schemars::JsonSchema;
use serde::Deserialize;

/// Search for the surge line after all other steps: at the end of each speed line the valve closes in small steps while the variation of pressures and flow indicates the distance to surge. It opens again before surge, and the surge-side end is marked with its uncertainty.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct SurgeSearchFile {
    /// Smallest surge margin (flow over surge flow, minus one) to approach; 3 % if none is given.
    #[schemars(extend("x-min" = "0.5 %", "x-max" = "30 %"), example = &"3 %")]
    closest: Option<Quantity<Fraction>>,
    /// Largest change of the valve's opening per step near surge, relative to the opening; 3 % if none is given.
    #[schemars(extend("x-min" = "0.5 %", "x-max" = "10 %"), example = &"3 %")]
    step: Option<Quantity<Fraction>>,
    /// Time at each opening; 25 s if none is given. The rig needs the first 5 s to follow.
    #[schemars(extend("x-min" = "12 s", "x-max" = "10 min"), example = &"25 s")]
    dwell: Option<Quantity<Duration>>,
    /// Standard error of the surge flow at which a line is finished, without the flow meter's gain; 0.8 % if none is given.
    #[schemars(extend("x-min" = "0.1 %", "x-max" = "5 %"), example = &"0.8 %")]
    standard_error: Option<Quantity<Fraction>>,
    /// Maximum number of openings of one line; 40 if none is given.
    #[schemars(range(min = 5, max = 200), example = 40)]
    most_steps: Option<usize>,
}

impl SurgeSearchFile {
    /// The search, with defaults filled in.
    pub(crate) fn settings(self) -> SurgeSearchSettings {
        let usual = SurgeSearchSettings::default();
        SurgeSearchSettings {
            closest_margin_ratio: value_or(self.closest, usual.closest_margin_ratio),
            step_ratio: value_or(self.step, usual.step_ratio),
            dwell_s: value_or(self.dwell, usual.dwell_s),
            wanted_standard_error_ratio: value_or(self.standard_error, usual.wanted_standard_error_ratio),
            most_steps: self.most_steps.unwrap_or(usual.most_steps),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_has_its_default() {
        let read = |text| crate::testing::any::<SurgeSearchFile>(text).unwrap().settings();
        assert_eq!(read("{}"), SurgeSearchSettings::default());
        let written = SurgeSearchSettings {
            closest_margin_ratio: 0.05,
            dwell_s: 60.0,
            ..SurgeSearchSettings::default()
        };
        assert_eq!(read("{closest: 5 %, dwell: 1 min}"), written);
    }
}
