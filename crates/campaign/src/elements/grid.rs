//! `grid:`, the operating points: by speeds and openings, by speed lines from choke to surge, or listed.

use crate::checking::Check;
use crate::units::{Fraction, Kind, MassFlow, Quantity, Speed};
use mapper_core::{Limits, OperatingPoint, ReferenceState};
use mapper_physics::operating_point::line_points::{LineRequest, Spread};
use mapper_yaml::{FindingKind, Step, steps};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::Value;
use std::collections::HashSet;

/// Opening of the back-pressure valve relative to its nominal area, a plain number above 0, at most 2.5.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
pub(crate) struct Opening(
    #[schemars(range(max = 2.5), extend("exclusiveMinimum" = 0), example = 0.5)] pub(crate) f64,
);

/// Maximum number of points: three days of two-minute steps. The planner stores several numbers for every pair of points: 32 MB each for
/// 2000 points (11 s of processor time), gigabytes each for 20 000.
const MAX_POINTS: usize = 2_000;
/// Forms of a grid.
const FORMS: &str = "write `speeds` and `openings`, or `points`, a list of `{speed: 50 krpm, opening: 0.5}`, or `lines`, \
                     a list of `{speed_corrected: 50 krpm, points: 6}`";

/// The operating points: every speed at every opening, speed lines with points from choke to surge, or a list.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GridFile {
    /// Shaft speeds; each is visited at each of `openings`.
    #[schemars(length(min = 1, max = 1000), extend("examples" = [["50 krpm", "80 krpm"]]))]
    speeds: Option<Vec<SpeedFile>>,
    /// Openings of the back-pressure valve relative to its nominal area, plain numbers above 0, at most 2.5.
    #[schemars(length(min = 1, max = 1000), extend("examples" = [[0.5, 1.0, 2.5]]))]
    openings: Option<Vec<Opening>>,
    /// Points of `speeds` x `openings` to leave out.
    #[schemars(length(min = 1, max = 2000))]
    skip: Option<Vec<PointFile>>,
    /// The points one by one.
    #[schemars(length(min = 1, max = 2000))]
    points: Option<Vec<PointFile>>,
    /// Speed lines by their corrected speeds, each with points from choke to surge; the openings are found on the nominal machine.
    #[schemars(length(min = 1, max = 200))]
    lines: Option<Vec<LineFile>>,
    /// Surge margin of the last point of each of `lines`: corrected flow over the nominal map's surge flow at equal corrected speed, minus one. 10 % if none is given, or `limits.surge_margin` if that is larger.
    #[schemars(extend("x-min" = "-50 %", "x-max" = "200 %"), example = &"10 %")]
    surge_margin: Option<Quantity<Fraction>>,
    /// Opening of the first point of each of `lines`; 2.5 if none is given.
    widest_opening: Option<Opening>,
}

/// A point.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PointFile {
    /// Shaft speed, physical, not corrected.
    speed: SpeedFile,
    /// Opening of the back-pressure valve relative to its nominal area, a plain number above 0, at most 2.5.
    opening: Opening,
}

/// Shaft speed, physical, not corrected.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
pub(crate) struct SpeedFile(#[schemars(extend("x-above" = "0 rpm", "x-max" = "1000 krpm"))] Quantity<Speed>);

impl From<PointFile> for OperatingPoint {
    fn from(file: PointFile) -> Self {
        OperatingPoint { speed_rpm: file.speed.0.value, valve_opening_ratio: file.opening.0 }
    }
}

impl GridFile {
    /// The lines in SI; none if the grid has another form.
    pub(crate) fn lines(&self, reference: ReferenceState, limits: &Limits) -> Vec<LineRequest> {
        let defaults = LineDefaults { surge_margin: self.surge_margin, widest_opening: self.widest_opening };
        self.lines.iter().flatten().map(|line| line.request(defaults, reference, limits)).collect()
    }

    /// The points, and the position of each in the file: its entry in `points`, or its speed in `speeds`.
    ///
    /// Returns only the first point of each of `lines`, since their openings are not known yet.
    pub(crate) fn points(&self, lines: &[LineRequest], t1_k: f64) -> (Vec<OperatingPoint>, Vec<Vec<Step>>) {
        if !lines.is_empty() {
            let first = |(index, line): (usize, &LineRequest)| {
                let speed_rpm = line.reference.physical_speed_rpm(line.speed_corrected_rpm, t1_k);
                let point = OperatingPoint { speed_rpm, valve_opening_ratio: line.widest_opening_ratio };
                (point, steps!["grid", "lines", index, "speed_corrected"].to_vec())
            };
            return lines.iter().enumerate().map(first).unzip();
        }
        if let Some(listed) = &self.points {
            let entry = |(index, point): (usize, &PointFile)| {
                (OperatingPoint::from(*point), steps!["grid", "points", index].to_vec())
            };
            return listed.iter().enumerate().map(entry).unzip();
        }
        let key = |point: &OperatingPoint| point_key(point.speed_rpm, point.valve_opening_ratio);
        let skipped: HashSet<_> = self.skip.iter().flatten().map(|point| key(&(*point).into())).collect();
        let speeds = self.speeds.as_deref().unwrap_or_default();
        self.openings
            .iter()
            .flatten()
            .flat_map(|opening| {
                speeds.iter().enumerate().map(|(index, speed)| {
                    let point = OperatingPoint { speed_rpm: speed.0.value, valve_opening_ratio: opening.0 };
                    (point, steps!["grid", "speeds", index].to_vec())
                })
            })
            .filter(|(point, _)| !skipped.contains(&key(point)))
            .unzip()
    }
}

/// Key of a point for the search for duplicates: no rig distinguishes 1e-3 rpm, or openings by 1e-6.
fn point_key(rpm: f64, opening: f64) -> (i64, i64) {
    ((rpm * 1e3).round() as i64, (opening * 1e6).round() as i64)
}

/// Checks that the grid has one of its forms, without duplicates and within the limits.
pub(crate) fn check(check: &mut Check<'_>) {
    let Some(grid) = check.get(&steps!["grid"]).and_then(Value::as_object) else { return };
    let has = |key: &str| grid.contains_key(key);
    let (speeds, openings, points, skip) = (has("speeds"), has("openings"), has("points"), has("skip"));
    let path = steps!["grid"];
    let other_form = ["speeds", "openings", "points", "skip"].into_iter().find(|key| has(key));
    let line_key = ["surge_margin", "widest_opening"].into_iter().find(|key| has(key));
    if has("lines") {
        if let Some(key) = other_form {
            let message = format!("`{key}` is given together with `lines`");
            check.note_key(FindingKind::Conflict, &path, key, message, FORMS);
        }
        check_lines(check);
        return;
    }
    if let Some(key) = line_key {
        let message = format!("`{key}` belongs to `lines`, and the grid has none");
        check.note_key(
            FindingKind::Conflict,
            &path,
            key,
            message,
            "remove it, or write the points as `lines`",
        );
    }
    match (speeds, openings, points) {
        (false, false, false) => {
            check.note(FindingKind::MissingKey, &path, "the grid has no points".into(), FORMS);
        }
        (true, false, false) => {
            check.note(
                FindingKind::MissingKey,
                &path,
                "`grid` has `speeds` but not `openings`".into(),
                FORMS,
            );
        }
        (false, true, false) => {
            check.note(
                FindingKind::MissingKey,
                &path,
                "`grid` has `openings` but not `speeds`".into(),
                FORMS,
            );
        }
        (true, _, true) | (_, true, true) => {
            let message = "`points` is given together with `speeds` or `openings`".to_owned();
            check.note_key(FindingKind::Conflict, &path, "points", message, FORMS);
        }
        _ => {}
    }
    check_speeds(check);
    check_openings(check);
    check_points(check, "points");
    check_points(check, "skip");
    if points && skip {
        let message = "`skip` has no effect on a list of points".to_owned();
        check.note(
            FindingKind::Conflict,
            &steps!["grid", "skip"],
            message,
            "remove `skip`, or the points themselves",
        );
    } else if speeds && openings {
        check_product(check);
    }
}

fn check_speeds(check: &mut Check<'_>) {
    let mut seen = HashSet::new();
    for index in 0..check.count(&steps!["grid", "speeds"]) {
        let steps = steps!["grid", "speeds", index];
        let Some((rpm, text)) = check.quantity(Kind::Speed, &steps) else { continue };
        check_speed_limit(check, &steps, rpm, text);
        if !seen.insert(point_key(rpm, 0.0)) {
            let message = format!("the speed `{text}` appears twice");
            check.note(FindingKind::Duplicate, &steps, message, "remove one of the two");
        }
    }
}

fn check_openings(check: &mut Check<'_>) {
    let mut seen = HashSet::new();
    for index in 0..check.count(&steps!["grid", "openings"]) {
        let steps = steps!["grid", "openings", index];
        let Some(opening) = check.number(&steps) else { continue };
        if !seen.insert(point_key(0.0, opening)) {
            let message = format!("the opening {opening} appears twice");
            check.note(FindingKind::Duplicate, &steps, message, "remove one of the two");
        }
    }
}

/// Checks `points` or `skip` for duplicates and for speeds above the limit.
fn check_points(check: &mut Check<'_>, list: &str) {
    let mut seen = HashSet::new();
    for (index, (rpm, opening)) in points(check, list) {
        let steps = steps!["grid", list, index];
        let speed_path = steps!["grid", list, index, "speed"];
        let text = check.text(&speed_path).unwrap_or_default();
        if list == "points" {
            check_speed_limit(check, &speed_path, rpm, text);
        }
        if !seen.insert(point_key(rpm, opening)) {
            let message = format!("the point {text} at opening {opening} appears twice");
            check.note(FindingKind::Duplicate, &steps, message, "remove one of the two");
        }
    }
}

fn check_product(check: &mut Check<'_>) {
    let speeds: HashSet<(i64, i64)> = (0..check.count(&steps!["grid", "speeds"]))
        .filter_map(|i| check.quantity(Kind::Speed, &steps!["grid", "speeds", i]))
        .map(|(rpm, _)| point_key(rpm, 0.0))
        .collect();
    let openings: HashSet<(i64, i64)> = (0..check.count(&steps!["grid", "openings"]))
        .filter_map(|i| check.number(&steps!["grid", "openings", i]))
        .map(|opening| point_key(0.0, opening))
        .collect();
    let count = speeds.len().saturating_mul(openings.len());
    let path = steps!["grid"];
    if count > MAX_POINTS {
        let dwell = check.quantity(Kind::Duration, &steps!["timing", "dwell"]);
        let days = dwell.map(|(dwell_s, _)| count as f64 * dwell_s / 86_400.0);
        let lasts = days.map_or_else(String::new, |days| format!(", which take {days:.1} days on the rig"));
        let pairs = (count as f64 / MAX_POINTS as f64).powi(2);
        let message = format!(
            "the grid has {count} points{lasts}, and {pairs:.0} times as many pairs as the planner allows"
        );
        let remedy = format!("a grid may have at most {MAX_POINTS}; divide it into several campaigns");
        check.note(FindingKind::TooLarge, &path, message, &remedy);
        return;
    }
    let mut skipped = HashSet::new();
    for (index, (rpm, opening)) in points(check, "skip") {
        let known = speeds.contains(&point_key(rpm, 0.0)) && openings.contains(&point_key(0.0, opening));
        if known {
            skipped.insert(point_key(rpm, opening));
        } else {
            let message = "`speeds` and `openings` do not contain the point to skip".to_owned();
            let remedy = "name a speed and an opening of the grid, or remove the entry";
            check.note(FindingKind::Conflict, &steps!["grid", "skip", index], message, remedy);
        }
    }
    if count > 0 && skipped.len() >= count {
        let message = "every point is skipped".to_owned();
        check.note(FindingKind::Conflict, &steps!["grid", "skip"], message, "leave at least one point");
    }
}

/// Index, speed in rpm and opening of each readable point of a list.
fn points(check: &Check<'_>, list: &str) -> Vec<(usize, (f64, f64))> {
    (0..check.count(&steps!["grid", list]))
        .filter_map(|index| {
            let (rpm, _) = check.quantity(Kind::Speed, &steps!["grid", list, index, "speed"])?;
            let opening = check.number(&steps!["grid", list, index, "opening"])?;
            Some((index, (rpm, opening)))
        })
        .collect()
}

/// The lowest readable speed of `speeds` and `points`, rpm.
fn lowest_speed_rpm(check: &Check<'_>) -> f64 {
    let listed = (0..check.count(&steps!["grid", "speeds"]))
        .filter_map(|index| Some(check.quantity(Kind::Speed, &steps!["grid", "speeds", index])?.0));
    let of_points = points(check, "points").into_iter().map(|(_, (rpm, _))| rpm);
    listed.chain(of_points).fold(f64::INFINITY, f64::min)
}

fn check_speed_limit(check: &mut Check<'_>, steps: &[Step], rpm: f64, text: &str) {
    if let Some((limit_rpm, limit)) = check.quantity(Kind::Speed, &steps!["limits", "speed"])
        && rpm > limit_rpm
    {
        // A limit below every speed is reported once, at the limit.
        let lowest_rpm = lowest_speed_rpm(check);
        if lowest_rpm > limit_rpm {
            if rpm == lowest_rpm {
                let message = format!("the limit is below every speed of the grid; the lowest is `{text}`");
                let remedy = "raise the limit to what the machine allows";
                check.note(FindingKind::Range, &steps!["limits", "speed"], message, remedy);
            }
            return;
        }
        let message = format!("`{text}` is above `limits.speed`, `{limit}`");
        check.note(
            FindingKind::Range,
            steps,
            message,
            "lower it, or raise the limit if the machine allows it",
        );
    }
}

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
pub(crate) fn check_lines(check: &mut Check<'_>) {
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
    fn a_grid_is_every_speed_at_every_opening_without_what_is_skipped() {
        let text = "{speeds: [50 krpm, 90 krpm], openings: [0.5, 1], skip: [{speed: 50000 rpm, opening: 1}]}";
        let (points, places) = crate::testing::any::<GridFile>(text).unwrap().points(&[], 298.15);
        let found: Vec<(f64, f64)> = points.iter().map(|p| (p.speed_rpm, p.valve_opening_ratio)).collect();
        assert_eq!(found, [(50e3, 0.5), (90e3, 0.5), (90e3, 1.0)]);
        assert_eq!(places.len(), points.len());
    }

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
            overshoot_max_ratio: None,
            avoid: mapper_core::AvoidedSpeeds::NONE,
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
