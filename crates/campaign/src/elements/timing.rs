//! `timing:`

use crate::si::si;
use crate::units::{Duration, Quantity};
use mapper_core::Timing;
use schemars::JsonSchema;
use serde::Deserialize;

/// How long things take.
#[derive(Deserialize, JsonSchema)]
#[serde(remote = "Timing", deny_unknown_fields)]
pub(crate) struct TimingElement {
    /// Time at the first point before its step begins; 0 s if none is given.
    #[serde(rename = "warm_up", default, deserialize_with = "si::<Duration, _>")]
    #[schemars(with = "Quantity<Duration>", extend("x-min" = "0 s", "x-max" = "24 h"), example = &"10 min")]
    warm_up_s: f64,
    /// Time without flow after the last step; 0 s if none is given.
    #[serde(rename = "cool_down", default, deserialize_with = "si::<Duration, _>")]
    #[schemars(with = "Quantity<Duration>", extend("x-min" = "0 s", "x-max" = "24 h"), example = &"0 s")]
    cool_down_s: f64,
    /// Time at each point, jump included.
    #[serde(rename = "dwell", deserialize_with = "si::<Duration, _>")]
    #[schemars(with = "Quantity<Duration>", extend("x-above" = "0 s", "x-max" = "24 h"), example = &"120 s")]
    dwell_s: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::any_with;

    #[test]
    fn what_is_written_and_what_it_means() {
        let table = [
            ("{dwell: 2 min}", Some((0.0, 0.0, 120.0))),
            ("{warm_up: 10 min, cool_down: 90 s, dwell: 1 h}", Some((600.0, 90.0, 3600.0))),
            ("{warm_up: 10 min}", None),
            ("{dwell: 120}", None),
            ("{dwell: 2 min, dwel: 2 min}", None),
        ];
        for (text, expected) in table {
            let timing: Option<Timing> = any_with(text, TimingElement::deserialize).ok();
            let found = timing.map(|timing| (timing.warm_up_s, timing.cool_down_s, timing.dwell_s));
            assert_eq!(found, expected, "{text}");
        }
    }
}
