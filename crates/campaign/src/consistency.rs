//! What no schema can say: statements of one file that must fit each other, and the files it names.
//!
//! Works on the tree and skips what is missing or unreadable, so that one mistake does not hide another.

use crate::units::{self, Kind};
use mapper_core::ReferenceState;
use mapper_physics::tabulated_map::TabulatedMap;
use mapper_yaml::{Content, FindingKind, Node, Notes, Source, Step, path_text, steps};
use std::collections::HashSet;
use std::io;
use std::path::Path;

/// Most points a grid may have: four weeks of two-minute steps.
pub(crate) const POINT_LIMIT: usize = 20_000;

/// A way to read a file named in a campaign.
pub(crate) type Files<'a> = &'a dyn Fn(&Path) -> io::Result<String>;

/// Checks everything that needs more than one value.
pub(crate) fn check(source: &Source, root: &Node, files: Files<'_>, notes: &mut Notes) {
    let mut check = Check { source, root, notes };
    check.limits();
    check.window();
    check.order();
    check.repeated_jump();
    check.static_taps();
    check.calibration_dates();
    check.map_file(files);
    check.sequence_file(files);
    check.grid();
}

/// The path of a file named in a campaign: relative ones start from the campaign's own directory.
pub(crate) fn beside(origin: &Path, file: &str) -> std::path::PathBuf {
    origin.parent().unwrap_or(Path::new("")).join(file)
}

struct Check<'a> {
    source: &'a Source,
    root: &'a Node,
    notes: &'a mut Notes,
}

impl<'a> Check<'a> {
    fn text(&self, steps: &[Step]) -> Option<&'a str> {
        self.root.get(steps)?.text()
    }

    /// The value in the unit used inside, and its text.
    fn quantity(&self, kind: Kind, steps: &[Step]) -> Option<(f64, &'a str)> {
        let text = self.text(steps)?;
        Some((units::parse(kind, text).ok()?, text))
    }

    fn note(&mut self, kind: FindingKind, steps: &[Step], message: String, remedy: &str) {
        let place = self.root.place(steps);
        let finding = self.source.finding(kind, path_text(steps), place, message, remedy.to_owned());
        self.notes.push(finding);
    }

    fn limits(&mut self) {
        let low = self.quantity(Kind::Pressure, &steps!["limits", "turbine_inlet_pressure", "min"]);
        let high_path = steps!["limits", "turbine_inlet_pressure", "max"];
        let high = self.quantity(Kind::Pressure, &high_path);
        if let (Some((low_pa, low)), Some((high_pa, high))) = (low, high)
            && low_pa >= high_pa
        {
            let message = format!("`{high}` is not above the lowest pressure, `{low}`");
            self.note(FindingKind::Conflict, &high_path, message, "`max` must be above `min`");
        }
        let outlet = self.quantity(Kind::Pressure, &steps!["boundary", "turbine_outlet_pressure"]);
        if let (Some((outlet_pa, outlet)), Some((high_pa, high))) = (outlet, high)
            && outlet_pa >= high_pa
        {
            let message = format!(
                "`{high}` is not above the turbine outlet pressure, `{outlet}`: the turbine never turns"
            );
            let remedy = "raise it, or lower `boundary.turbine_outlet_pressure`";
            self.note(FindingKind::Conflict, &high_path, message, remedy);
        }
        let wanted_path = steps!["boundary", "turbine_inlet_temperature"];
        let wanted = self.quantity(Kind::Temperature, &wanted_path);
        let limit = self.quantity(Kind::Temperature, &steps!["limits", "turbine_inlet_temperature"]);
        if let (Some((wanted_k, wanted)), Some((limit_k, limit))) = (wanted, limit)
            && wanted_k > limit_k
        {
            let message = format!("`{wanted}` is above `limits.turbine_inlet_temperature`, `{limit}`");
            self.note(FindingKind::Conflict, &wanted_path, message, "lower it, or raise the limit");
        }
    }

    fn window(&mut self) {
        let end_path = steps!["identification", "window", "end"];
        let start = self.quantity(Kind::Duration, &steps!["identification", "window", "start"]);
        let end = self.quantity(Kind::Duration, &end_path);
        let dwell = self.quantity(Kind::Duration, &steps!["timing", "dwell"]);
        if let (Some((start_s, start)), Some((end_s, end))) = (start, end)
            && start_s >= end_s
        {
            let message = format!("the window ends at `{end}`, not after its start at `{start}`");
            self.note(FindingKind::Conflict, &end_path, message, "`end` must be after `start`");
        }
        if let (Some((end_s, end)), Some((dwell_s, dwell))) = (end, dwell)
            && end_s > dwell_s
        {
            let message = format!("the window ends at `{end}`, beyond the dwell of `{dwell}`");
            self.note(
                FindingKind::Conflict,
                &end_path,
                message,
                "end it earlier, or lengthen `timing.dwell`",
            );
        }
    }

    fn order(&mut self) {
        let path = steps!["order"];
        let Some(order) = self.text(&path) else { return };
        if order == "time" && self.root.get(&steps!["required_sigma_eta"]).is_none() {
            let message = "the shortest campaign needs the error that it has to reach".to_owned();
            self.note(FindingKind::MissingKey, &path, message, "add e.g. `required_sigma_eta: 1 %`");
        }
        let steady = self.text(&steps!["identification", "method"]) == Some("steady");
        if steady && (order == "time" || order == "information") {
            let message =
                format!("`{order}` orders by what the dynamic method will find; the method is `steady`");
            let remedy = "write `identification.method: dynamic`, or another order";
            self.note(FindingKind::Conflict, &path, message, remedy);
        }
    }

    fn repeated_jump(&mut self) {
        let point = |end: &str| {
            let (speed, _) = self.quantity(Kind::Speed, &steps!["repeats", "jump", end, "speed"])?;
            let opening = self.root.get(&steps!["repeats", "jump", end, "opening"])?.number()?;
            Some((speed, opening))
        };
        if let (Some(from), Some(to)) = (point("from"), point("to"))
            && from == to
        {
            let message = "the repeated jump ends where it starts: nothing moves".to_owned();
            let remedy = "let it lead to another speed, e.g. from the slowest to the fastest";
            self.note(FindingKind::Conflict, &steps!["repeats", "jump", "to"], message, remedy);
        }
    }

    fn static_taps(&mut self) {
        for symbol in ["P1", "P2", "P3", "P4"] {
            let sensor = steps!["sensors", symbol];
            let tap = steps!["sensors", symbol, "tap"];
            let has_diameter = self.root.get(&steps!["sensors", symbol, "pipe_diameter"]).is_some();
            if self.text(&tap) == Some("static") && !has_diameter && self.root.get(&sensor).is_some() {
                let message =
                    "a static tap needs the pipe's inner diameter to become a total pressure".to_owned();
                self.note(FindingKind::MissingKey, &tap, message, "add e.g. `pipe_diameter: 40 mm`");
            }
        }
    }

    fn calibration_dates(&mut self) {
        let parent = steps!["report", "calibration"];
        let Some(calibration) = self.root.get(&parent) else { return };
        for entry in calibration.entries() {
            let steps = steps!["report", "calibration", entry.key.as_str()];
            // The form is the schema's business; here only days that no month has.
            if let Some(text) = entry.value.text()
                && let Some((year, month, day)) = date(text)
                && (1..=12).contains(&month)
                && (29..=31).contains(&day)
                && day > days_of(year, month)
            {
                let message = format!("`{text}` is no day of the calendar");
                self.note(
                    FindingKind::WrongValue,
                    &steps,
                    message,
                    "write year-month-day, e.g. `2026-09-01`",
                );
            }
        }
    }

    fn map_file(&mut self, files: Files<'_>) {
        let steps = steps!["machine", "map", "file"];
        let Some(name) = self.text(&steps).filter(|name| !name.is_empty()) else { return };
        let path = beside(&self.source.origin, name);
        match files(&path) {
            Err(error) => {
                let message = format!("the map file `{}` cannot be read: {error}", path.display());
                let remedy = "write its path relative to the campaign file, or `map: closed_form`";
                self.note(FindingKind::MissingFile, &steps, message, remedy);
            }
            // Whether a table is a map does not depend on its reference state, which may be missing yet.
            Ok(text) => {
                if let Err(error) = TabulatedMap::from_csv(&text, ReferenceState::SAE) {
                    let message = format!("the map file `{}` is no map: {error}", path.display());
                    let remedy =
                        "each row needs corrected rpm, corrected kg/s, pressure ratio and efficiency";
                    self.note(FindingKind::WrongValue, &steps, message, remedy);
                }
            }
        }
    }

    fn sequence_file(&mut self, files: Files<'_>) {
        let steps = steps!["sequence"];
        let Some(name) = self.text(&steps).filter(|name| name.ends_with(".rhai")) else { return };
        let path = beside(&self.source.origin, name);
        if let Err(error) = files(&path) {
            let message = format!("the sequence script `{}` cannot be read: {error}", path.display());
            let remedy = "write its path relative to the campaign file, or leave `sequence` out";
            self.note(FindingKind::MissingFile, &steps, message, remedy);
        }
    }

    fn grid(&mut self) {
        let Some(grid) = self.root.get(&steps!["grid"]) else { return };
        if grid.entries().is_empty() && !matches!(&grid.content, Content::Mapping(_)) {
            return;
        }
        let has = |key: &str| grid.get(&steps![key]).is_some();
        let (speeds, openings, points, skip) = (has("speeds"), has("openings"), has("points"), has("skip"));
        let here = steps!["grid"];
        const FORMS: &str =
            "write `speeds` and `openings`, or `points`, a list of `{speed: 50 krpm, opening: 0.5}`";
        match (speeds, openings, points) {
            (false, false, false) => {
                self.note(FindingKind::MissingKey, &here, "the grid has no points".into(), FORMS);
            }
            (true, false, false) => {
                self.note(
                    FindingKind::MissingKey,
                    &here,
                    "`grid` has `speeds` and lacks `openings`".into(),
                    FORMS,
                );
            }
            (false, true, false) => {
                self.note(
                    FindingKind::MissingKey,
                    &here,
                    "`grid` has `openings` and lacks `speeds`".into(),
                    FORMS,
                );
            }
            (true, _, true) | (_, true, true) => {
                let message = "`points` stands beside `speeds` or `openings`".to_owned();
                let place = self.root.key_place(&here, "points");
                let finding = self.source.finding(
                    FindingKind::Conflict,
                    "grid.points".into(),
                    place,
                    message,
                    FORMS.into(),
                );
                self.notes.push(finding);
            }
            _ => {}
        }
        self.grid_speeds();
        self.grid_openings();
        self.grid_points("points");
        self.grid_points("skip");
        if points && skip {
            let message = "`skip` has nothing to skip in a list of points".to_owned();
            self.note(
                FindingKind::Conflict,
                &steps!["grid", "skip"],
                message,
                "remove `skip`, or the points themselves",
            );
        } else if speeds && openings {
            self.product();
        }
    }

    fn grid_speeds(&mut self) {
        let mut seen = HashSet::new();
        for index in 0..self.count(&steps!["grid", "speeds"]) {
            let steps = steps!["grid", "speeds", index];
            let Some((rpm, text)) = self.quantity(Kind::Speed, &steps) else { continue };
            self.below_speed_limit(&steps, rpm, text);
            if !seen.insert(rounded(rpm, 0.0)) {
                let message = format!("the speed `{text}` stands here a second time");
                self.note(FindingKind::Duplicate, &steps, message, "remove one of the two");
            }
        }
    }

    fn grid_openings(&mut self) {
        let mut seen = HashSet::new();
        for index in 0..self.count(&steps!["grid", "openings"]) {
            let steps = steps!["grid", "openings", index];
            let Some(opening) = self.root.get(&steps).and_then(Node::number) else { continue };
            if !seen.insert(rounded(0.0, opening)) {
                let message = format!("the opening {opening} stands here a second time");
                self.note(FindingKind::Duplicate, &steps, message, "remove one of the two");
            }
        }
    }

    /// Duplicates and speeds of `points` or `skip`.
    fn grid_points(&mut self, list: &str) {
        let mut seen = HashSet::new();
        for (index, (rpm, opening)) in self.points(list) {
            let steps = steps!["grid", list, index];
            let speed_path = steps!["grid", list, index, "speed"];
            let text = self.text(&speed_path).unwrap_or_default();
            if list == "points" {
                self.below_speed_limit(&speed_path, rpm, text);
            }
            if !seen.insert(rounded(rpm, opening)) {
                let message = format!("the point {text} at opening {opening} stands here a second time");
                self.note(FindingKind::Duplicate, &steps, message, "remove one of the two");
            }
        }
    }

    fn product(&mut self) {
        let speeds: HashSet<(i64, i64)> = (0..self.count(&steps!["grid", "speeds"]))
            .filter_map(|i| self.quantity(Kind::Speed, &steps!["grid", "speeds", i]))
            .map(|(rpm, _)| rounded(rpm, 0.0))
            .collect();
        let openings: HashSet<(i64, i64)> = (0..self.count(&steps!["grid", "openings"]))
            .filter_map(|i| self.root.get(&steps!["grid", "openings", i]).and_then(Node::number))
            .map(|opening| rounded(0.0, opening))
            .collect();
        let count = speeds.len().saturating_mul(openings.len());
        let here = steps!["grid"];
        if count > POINT_LIMIT {
            let message = format!("the grid has {count} points");
            self.note(
                FindingKind::TooLarge,
                &here,
                message,
                &format!("a grid may have at most {POINT_LIMIT}"),
            );
            return;
        }
        let mut skipped = HashSet::new();
        for (index, (rpm, opening)) in self.points("skip") {
            let known = speeds.contains(&rounded(rpm, 0.0)) && openings.contains(&rounded(0.0, opening));
            if known {
                skipped.insert(rounded(rpm, opening));
            } else {
                let message = "no point of `speeds` and `openings` is the one to skip".to_owned();
                let remedy = "name a speed and an opening of the grid, or remove the entry";
                self.note(FindingKind::Conflict, &steps!["grid", "skip", index], message, remedy);
            }
        }
        if count > 0 && skipped.len() >= count {
            let message = "every point is skipped".to_owned();
            self.note(FindingKind::Conflict, &steps!["grid", "skip"], message, "leave at least one point");
        }
    }

    fn count(&self, steps: &[Step]) -> usize {
        self.root.get(steps).map_or(0, |node| node.items().len())
    }

    /// Index, speed in rpm and opening of each readable point of a list.
    fn points(&self, list: &str) -> Vec<(usize, (f64, f64))> {
        (0..self.count(&steps!["grid", list]))
            .filter_map(|index| {
                let (rpm, _) = self.quantity(Kind::Speed, &steps!["grid", list, index, "speed"])?;
                let opening =
                    self.root.get(&steps!["grid", list, index, "opening"]).and_then(Node::number)?;
                Some((index, (rpm, opening)))
            })
            .collect()
    }

    fn below_speed_limit(&mut self, steps: &[Step], rpm: f64, text: &str) {
        if let Some((limit_rpm, limit)) = self.quantity(Kind::Speed, &steps!["limits", "speed"])
            && rpm > limit_rpm
        {
            let message = format!("`{text}` is above `limits.speed`, `{limit}`");
            self.note(
                FindingKind::Range,
                steps,
                message,
                "lower it, or raise the limit if the machine allows it",
            );
        }
    }
}

/// A point as a key: speeds closer than 1e-3 rpm and openings closer than 1e-6 are the same on any rig.
pub(crate) fn rounded(rpm: f64, opening: f64) -> (i64, i64) {
    ((rpm * 1e3).round() as i64, (opening * 1e6).round() as i64)
}

fn date(text: &str) -> Option<(u32, u32, u32)> {
    let mut parts = text.splitn(3, '-').map(|part| part.parse().ok());
    Some((parts.next()??, parts.next()??, parts.next()??))
}

fn days_of(year: u32, month: u32) -> u32 {
    match month {
        4 | 6 | 9 | 11 => 30,
        2 if year.is_multiple_of(4) && (!year.is_multiple_of(100) || year.is_multiple_of(400)) => 29,
        2 => 28,
        _ => 31,
    }
}
