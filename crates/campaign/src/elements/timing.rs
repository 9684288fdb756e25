//! `timing:` and `zero:`.

use crate::checking::Check;
use crate::si_values::value_or;
use crate::units::{Duration, Fraction, PressureDifference, Quantity, Temperature, TemperatureDifference};
use mapper_core::{Dwell, Soak, Timing};
use mapper_yaml::{FindingKind, steps};
use schemars::JsonSchema;
use serde::Deserialize;

/// Durations: `dwell`, `time_budget` or `required_sigma_eta` sets the time at each point, the same for all of them.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-removed" = {
    "ends": "leave it out: all steps last equally long; `time_budget` or `required_sigma_eta` lets the planner choose how long",
}))]
pub(crate) struct TimingFile {
    /// Time at the first point before its step begins; 0 s if none is given.
    #[schemars(extend("x-min" = "0 s", "x-max" = "24 h"), example = &"10 min")]
    warm_up: Option<Quantity<Duration>>,
    /// Time without flow after the last step; 0 s if none is given.
    #[schemars(extend("x-min" = "0 s", "x-max" = "24 h"), example = &"0 s")]
    cool_down: Option<Quantity<Duration>>,
    /// Time at each point, jump included.
    #[schemars(extend("x-above" = "0 s", "x-max" = "24 h"), example = &"40 s")]
    dwell: Option<Quantity<Duration>>,
    /// Total time of warm-up, all steps and cool-down, in place of `dwell`: the planner chooses the dwell that fits. A soak before the warm-up and a search for surge are additional.
    #[schemars(extend("x-above" = "0 s", "x-max" = "24 h"), example = &"45 min")]
    time_budget: Option<Quantity<Duration>>,
    /// Standard error of the efficiency (rms over the points) that the plan must reach according to its forecast, in place of `dwell`: the planner chooses the shortest dwell that reaches it.
    #[schemars(extend("x-above" = "0 %", "x-max" = "100 %"), example = &"0.3 %")]
    required_sigma_eta: Option<Quantity<Fraction>>,
}

impl TimingFile {
    /// The timing of a file in which [`check`] found exactly one of the three ways to set the dwell.
    pub(crate) fn timing(self) -> Timing {
        let dwell = match (self.dwell, self.time_budget, self.required_sigma_eta) {
            (_, Some(budget), _) => Dwell::TimeBudget(budget.value),
            (_, _, Some(sigma)) => Dwell::RequiredSigmaEta(sigma.value),
            (dwell, _, _) => Dwell::Fixed(dwell.map_or(0.0, |dwell| dwell.value)),
        };
        let or_zero = |time: Option<Quantity<Duration>>| time.map_or(0.0, |time| time.value);
        Timing { warm_up_s: or_zero(self.warm_up), cool_down_s: or_zero(self.cool_down), dwell }
    }
}

/// Checks that the dwell is set in one way, and by a number if no planner chooses it.
pub(crate) fn check(check: &mut Check<'_>) {
    let timing = steps!["timing"];
    if check.get(&timing).is_none() {
        return;
    }
    let ways = ["dwell", "time_budget", "required_sigma_eta"];
    let path_of = |way: &str| steps!["timing", way];
    let given: Vec<&str> = ways.into_iter().filter(|way| check.get(&path_of(way)).is_some()).collect();
    match given.as_slice() {
        [] => {
            let message = "`timing` does not set the duration of the steps".to_owned();
            let remedy = "add `dwell: 40 s`, or `time_budget: 45 min`, or `required_sigma_eta: 0.3 %`";
            check.note(FindingKind::MissingKey, &timing, message, remedy);
        }
        [one] if *one != "dwell" => {
            if check.get(&steps!["sequence"]).is_some() {
                let message = format!("`{one}` is for the planner, and a sequence script sets its own steps");
                check.note(FindingKind::Conflict, &path_of(one), message, "write `dwell` instead");
            } else if check.text(&steps!["order"]) == Some("conventional") {
                let message = format!(
                    "`{one}` chooses the dwell, and under `order: conventional` each step lasts until nothing drifts"
                );
                check.note(
                    FindingKind::Conflict,
                    &path_of(one),
                    message,
                    "write `dwell` instead, the shortest of these steps",
                );
            } else if *one == "required_sigma_eta"
                && check.text(&steps!["identification", "method"]) == Some("steady")
            {
                let message =
                    "`steady` has no forecast error for a step that still moves, so no dwell can be chosen by it"
                        .to_owned();
                let remedy = "write `identification.method: joint`, or `dwell` instead";
                check.note(FindingKind::Conflict, &path_of(one), message, remedy);
            }
        }
        [_] => {}
        [first, others @ ..] => {
            for other in others {
                let message = format!("`{other}` and `{first}` both set the time at each point");
                check.note(FindingKind::Conflict, &path_of(other), message, "keep one of them");
            }
        }
    }
}

/// The isothermal zero: the run begins with a soak, in which T1, T2, Tc and T_oil have one temperature, and P1 and P2 one pressure; the identification subtracts their differences.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("x-removed" = {
    "evenness": "write its value under `nonuniformity`",
    "pressure_evenness": "write its value under `pressure_nonuniformity`",
}))]
pub(crate) struct ZeroFile {
    /// Time at rest before the warm-up, air off; or `auto`: 5 min, and longer until T1, T2, P1 and P2 rest, at most 30 min. The zero uses the second half, at most ten minutes; a sensor that still drifts by more than 0.1 K/min keeps its declared offset, and so does Tc after less than ten minutes.
    #[schemars(example = &"30 min")]
    soak: SoakFile,
    /// Oil inlet temperature during the soak; that of the inlet air if none is given.
    #[schemars(extend("x-min" = "250 K", "x-max" = "450 K"), example = &"25 degC")]
    oil_temperature: Option<Quantity<Temperature>>,
    /// Temperature non-uniformity of the rig at rest, one standard deviation of the temperature at a sensor about the mean of all sensors: the uncertainty of each offset after the zero; 0.05 K if none is given.
    #[schemars(extend("x-min" = "0 K", "x-max" = "1 K"), example = &"0.05 K")]
    nonuniformity: Option<Quantity<TemperatureDifference>>,
    /// Uncertainty of the pressure at P1 and P2 at rest, one standard deviation; 5 Pa if none is given.
    #[schemars(extend("x-min" = "0 Pa", "x-max" = "1 kPa"), example = &"5 Pa")]
    pressure_nonuniformity: Option<Quantity<PressureDifference>>,
}

// Untagged: the text determines the variant, and the schema has been checked.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum SoakFile {
    Named(NamedSoak),
    Fixed(#[schemars(extend("x-min" = "1 min", "x-max" = "24 h"), example = &"30 min")] Quantity<Duration>),
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum NamedSoak {
    Auto,
}

impl ZeroFile {
    /// The soak, with the inlet air's temperature if none is given for the oil, K.
    pub(crate) fn soak(self, inlet_temperature_k: f64) -> Soak {
        Soak {
            duration_s: match self.soak {
                SoakFile::Fixed(duration) => duration.value,
                SoakFile::Named(NamedSoak::Auto) => Soak::SHORTEST_S,
            },
            until_settled: matches!(self.soak, SoakFile::Named(NamedSoak::Auto)),
            oil_temperature_k: value_or(self.oil_temperature, inlet_temperature_k),
            temperature_sigma_k: value_or(self.nonuniformity, Soak::TEMPERATURE_SIGMA_K),
            pressure_sigma_pa: value_or(self.pressure_nonuniformity, Soak::PRESSURE_SIGMA_PA),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_and_what_it_means() {
        let fixed = |warm_up_s, cool_down_s, dwell_s| {
            Some(Timing { warm_up_s, cool_down_s, dwell: Dwell::Fixed(dwell_s) })
        };
        let chosen = |dwell| Some(Timing { warm_up_s: 0.0, cool_down_s: 0.0, dwell });
        let table = [
            ("{dwell: 2 min}", fixed(0.0, 0.0, 120.0)),
            ("{warm_up: 10 min, cool_down: 90 s, dwell: 1 h}", fixed(600.0, 90.0, 3600.0)),
            ("{time_budget: 45 min}", chosen(Dwell::TimeBudget(2700.0))),
            ("{required_sigma_eta: 0.5 %}", chosen(Dwell::RequiredSigmaEta(0.005))),
            ("{dwell: 120}", None),
            ("{dwell: 2 min, dwel: 2 min}", None),
        ];
        for (text, expected) in table {
            let timing = crate::testing::any(text).ok().map(TimingFile::timing);
            assert_eq!(timing, expected, "{text}");
        }
    }

    #[test]
    fn what_is_left_out_has_its_default() {
        let read = |text| crate::testing::any::<ZeroFile>(text).unwrap().soak(298.15);
        let plain = Soak {
            duration_s: 1800.0,
            until_settled: false,
            oil_temperature_k: 298.15,
            temperature_sigma_k: 0.05,
            pressure_sigma_pa: 5.0,
        };
        assert_eq!(read("{soak: 30 min}"), plain);
        let automatic = Soak { duration_s: 300.0, until_settled: true, ..plain };
        assert_eq!(read("{soak: auto}"), automatic);
        let written = Soak { temperature_sigma_k: 0.15, pressure_sigma_pa: 15.0, ..plain };
        assert_eq!(read("{soak: 0.5 h, nonuniformity: 0.15 K, pressure_nonuniformity: 15 Pa}"), written);
    }
}
