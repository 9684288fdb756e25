//! `timing:`

use crate::checking::Check;
use crate::si::si;
use crate::units::{Duration, Quantity};
use mapper_core::{DwellEnd, Timing};
use mapper_yaml::FindingKind;
use mapper_yaml::steps;
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
    /// What ends the dwell: `planned`, the time that the plan has for it; `when_certain`, what its readings tell, within the dwell. The latter needs `required_sigma_eta` and the joint method.
    #[serde(default)]
    #[schemars(example = &"when_certain")]
    ends: DwellEnd,
}

/// A dwell that ends when enough is known needs to be told what is enough, a method that says what is known, and a plan.
pub(crate) fn check(check: &mut Check<'_>) {
    let path = steps!["timing", "ends"];
    if check.text(&path) != Some("when_certain") {
        return;
    }
    let method = check.text(&steps!["identification", "method"]);
    if let Some(other) = method.filter(|method| *method != "joint") {
        let message =
            format!("what is known while a step goes on is that of `joint`, and the method is `{other}`");
        check.note(
            FindingKind::Conflict,
            &path,
            message,
            "write `identification.method: joint`, or `ends: planned`",
        );
    } else if check.get(&steps!["sequence"]).is_some() {
        let message = "a sequence script ends its steps itself".to_owned();
        check.note(FindingKind::Conflict, &path, message, "leave `ends` or `sequence` out");
    } else if check.get(&steps!["required_sigma_eta"]).is_none() {
        let message = "`ends: when_certain` needs the error that is to be reached".to_owned();
        check.note(FindingKind::MissingKey, &path, message, "add e.g. `required_sigma_eta: 1 %`");
    }
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
            ("{dwell: 2 min, ends: when_certain}", Some((0.0, 0.0, 120.0))),
            ("{dwell: 2 min, ends: soon}", None),
        ];
        for (text, expected) in table {
            let timing: Option<Timing> = any_with(text, TimingElement::deserialize).ok();
            let found = timing.map(|timing| (timing.warm_up_s, timing.cool_down_s, timing.dwell_s));
            assert_eq!(found, expected, "{text}");
        }
    }
}
