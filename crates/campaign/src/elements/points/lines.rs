//! `grid.lines`: speed lines by their corrected speed, each with points from choke to surge.

use crate::checking::Check;
use crate::elements::points::opening::Opening;
use crate::units::{Fraction, Kind, MassFlow, Quantity, Speed};
use mapper_core::{Limits, OperatingPoint, ReferenceState};
use mapper_physics::operating_point::line_points::{LineRequest, Spread};
use mapper_yaml::{FindingKind, Step, steps};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashSet;

/// Surge margin of the last point of a line if none is given. Judgement: room for the overshoot of a jump.
const DEFAULT_SURGE_MARGIN_RATIO: f64 = 0.1;
/// Keys of a line.
const FORM: &str = "write `{speed_corrected: 50 krpm, points: 6}`, or `spacing: 8 g/s` in place of `points`";

/// A speed line: its corrected speed, and its points from choke to surge by their number or by their spacing.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct LineFile {
    /// Corrected shaft speed, in the campaign's reference state; the physical speed follows from T1.
    #[schemars(extend("x-above" = "0 rpm", "x-max" = "1000 krpm"), example = &"50 krpm")]
    speed_corrected: Quantity<Speed>,
    /// Number of points, evenly spaced in corrected flow, both ends included.
    #[schemars(range(min = 2, max = 100), example = 6)]
    points: Option<usize>,
    /// Distance of the points in corrected flow, from the choke end; in place of `points`.
    #[schemars(extend("x-above" = "0 kg/s", "x-max" = "100 kg/s"), example = &"8 g/s")]
    spacing: Option<Quantity<MassFlow>>,
    /// Surge margin of the line's last point; that of all lines if none is given.
    #[schemars(extend("x-min" = "-50 %", "x-max" = "200 %"), example = &"10 %")]
    surge_margin: Option<Quantity<Fraction>>,
    /// Opening of the line's first point; that of all lines if none is given.
    widest_opening: Option<Opening>,
}

/// Defaults of all lines.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LineDefaults {
    pub surge_margin: Option<Quantity<Fraction>>,
    pub widest_opening: Option<Opening>,
}

impl LineFile {
    /// The line in SI units. No point may violate `limits`.
    pub(crate) fn request(
        &self,
        defaults: LineDefaults,
        reference: ReferenceState,
        limits: &Limits,
    ) -> LineRequest {
        let margin = self.surge_margin.or(defaults.surge_margin).map(|margin| margin.value);
        LineRequest {
            speed_corrected_rpm: self.speed_corrected.value,
            reference,
            spread: match (self.points, self.spacing) {
                (None, Some(spacing)) => Spread::SpacingKgS(spacing.value),
                // The check rejects a line that has neither.
                (count, _) => Spread::Points(count.unwrap_or(2)),
            },
            surge_margin_ratio: margin
                .unwrap_or_else(|| DEFAULT_SURGE_MARGIN_RATIO.max(limits.surge_margin_floor_ratio())),
            widest_opening_ratio: self
                .widest_opening
                .or(defaults.widest_opening)
                .map_or(OperatingPoint::OPENING_MAX_RATIO, |opening| opening.0),
        }
    }
}

/// Checks that each line defines its points in one way, and that no line appears twice.
pub(crate) fn check(check: &mut Check<'_>) {
    check_margin(check, &steps!["grid", "surge_margin"]);
    let mut seen = HashSet::new();
    for index in 0..check.count(&steps!["grid", "lines"]) {
        check_margin(check, &steps!["grid", "lines", index, "surge_margin"]);
        let path = steps!["grid", "lines", index];
        let has = |key: &str| check.get(&steps!["grid", "lines", index, key]).is_some();
        match (has("points"), has("spacing")) {
            (true, true) => {
                let message = "the line has both `points` and `spacing`".to_owned();
                let remedy = "give either the number of points or their spacing";
                check.note_key(FindingKind::Conflict, &path, "spacing", message, remedy);
            }
            (false, false)
                if check.get(&path).and_then(Value::as_object).is_some_and(|line| !line.is_empty()) =>
            {
                let message = "the line has neither `points` nor `spacing`".to_owned();
                check.note(FindingKind::MissingKey, &path, message, FORM);
            }
            _ => {}
        }
        let speed = steps!["grid", "lines", index, "speed_corrected"];
        let Some((rpm, text)) = check.quantity(Kind::Speed, &speed) else { continue };
        if !seen.insert((rpm * 1e3).round() as i64) {
            let message = format!("the line `{text}` appears twice");
            check.note(FindingKind::Duplicate, &speed, message, "remove one of the two");
        }
    }
}

/// Checks that a margin leaves the last points within the limits: otherwise each of them would be a mistake.
fn check_margin(check: &mut Check<'_>, path: &[Step]) {
    let limit = check.quantity(Kind::Fraction, &steps!["limits", "surge_margin"]);
    let (lowest, text) = limit.unwrap_or((0.0, "0 %"));
    if let Some((margin, written)) = check.quantity(Kind::Fraction, path)
        && margin < lowest
    {
        let message = format!("`{written}` is below `limits.surge_margin`, `{text}`");
        check.note(FindingKind::Conflict, path, message, "raise it, or lower the limit");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_line_leaves_out_is_that_of_all_lines_or_the_usual() {
        let line: LineFile = crate::testing::any("{speed_corrected: 50 krpm, spacing: 8 g/s}").unwrap();
        let limits = |margin| Limits {
            speed_max_rpm: 180e3,
            p3_min_pa: 110e3,
            p3_max_pa: 500e3,
            p3_stroke_s: None,
            t3_max_k: None,
            t2_max_k: None,
            surge_margin_min_ratio: margin,
            housing_gradient_max_k: None,
        };
        let none = LineDefaults { surge_margin: None, widest_opening: None };
        let plain = line.request(none, ReferenceState::SAE, &limits(None));
        assert_eq!((plain.surge_margin_ratio, plain.widest_opening_ratio), (0.1, 2.5));
        assert_eq!(plain.spread, Spread::SpacingKgS(0.008));
        // Never at a place that a limit forbids.
        assert_eq!(line.request(none, ReferenceState::SAE, &limits(Some(0.2))).surge_margin_ratio, 0.2);
        let all = LineDefaults {
            surge_margin: crate::testing::any("3 %").ok(),
            widest_opening: crate::testing::any("2.0").ok(),
        };
        let written = line.request(all, ReferenceState::SAE, &limits(None));
        assert_eq!((written.surge_margin_ratio, written.widest_opening_ratio), (0.03, 2.0));
    }
}
