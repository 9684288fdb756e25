//! `sequence:`, `repeats:` and `surge_search:`, the steps besides the points of the grid.

use crate::checking::{Check, resolve_path};
use crate::elements::grid::PointFile;
use crate::si_values::element;
use crate::units::{Duration, Fraction, Kind, Quantity};
use mapper_core::{Jump, Repeats, SurgeSearchSettings};
use mapper_yaml::keys::Off;
use mapper_yaml::{FindingKind, steps};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::io;
use std::path::{Path, PathBuf};

const DEFAULT_SPACING_STEPS: usize = 12;
const DEFAULT_COUNT: usize = 2;

// Untagged: the type of the YAML node determines the variant, and the schema has been checked.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum RepeatsFile {
    Off(Off),
    Jump(RepeatedJumpFile),
}

/// A jump that is repeated.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct RepeatedJumpFile {
    /// The jump; if none is given, from the slowest to the fastest point of the middle opening, or the next best allowed jump.
    jump: Option<JumpFile>,
    /// Maximum number of steps between two repeats; 12 if none is given.
    #[schemars(range(min = 2, max = 20000), example = 12)]
    every: Option<usize>,
    /// Minimum number of repeats; 2 if none is given.
    #[schemars(range(min = 1, max = 1000), example = 2)]
    at_least: Option<usize>,
}

/// Start and end of the jump.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct JumpFile {
    /// The point before the jump.
    from: PointFile,
    /// The point after it.
    to: PointFile,
}

/// The repeats, with default values; `None` if the file switches them off.
pub(crate) fn repeats(file: Option<RepeatsFile>) -> Option<Repeats> {
    let file = match file {
        Some(RepeatsFile::Jump(file)) => file,
        Some(RepeatsFile::Off(Off)) => return None,
        None => RepeatedJumpFile::default(),
    };
    Some(Repeats {
        jump: file.jump.map(|jump| Jump { from: jump.from.into(), to: jump.to.into() }),
        every_steps: file.every.unwrap_or(DEFAULT_SPACING_STEPS),
        at_least: file.at_least.unwrap_or(DEFAULT_COUNT),
    })
}

/// Checks the points of a repeated jump.
pub(crate) fn check_repeats(check: &mut Check<'_>) {
    let point = |end: &str| {
        let (speed, _) = check.quantity(Kind::Speed, &steps!["repeats", "jump", end, "speed"])?;
        let opening = check.number(&steps!["repeats", "jump", end, "opening"])?;
        Some((speed, opening))
    };
    if let (Some(from), Some(to)) = (point("from"), point("to"))
        && from == to
    {
        let message = "the repeated jump ends where it starts, so it has no transient".to_owned();
        let remedy = "let it lead to another speed, e.g. from the slowest to the fastest";
        check.note(FindingKind::Conflict, &steps!["repeats", "jump", "to"], message, remedy);
    }
}

/// A sequence script.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SequenceSource {
    /// Path as written in the campaign.
    #[serde(skip)]
    pub named: String,
    /// Path as resolved from the campaign file. Not part of the canonical JSON: only the text identifies the script.
    #[serde(skip)]
    pub path: PathBuf,
    /// The script.
    pub text: String,
}

/// Reads the script that a campaign names.
pub(crate) fn sequence(
    name: Option<&str>,
    origin: &Path,
    files: &dyn Fn(&Path) -> io::Result<String>,
) -> io::Result<Option<SequenceSource>> {
    let source = |name: &str| {
        let path = resolve_path(origin, name);
        let text = files(&path)?;
        Ok(SequenceSource { named: name.to_owned(), path, text })
    };
    name.map(source).transpose()
}

/// Checks that the script can be read.
pub(crate) fn check_sequence(check: &mut Check<'_>) {
    let steps = steps!["sequence"];
    let Some(name) = check.text(&steps).filter(|name| name.ends_with(".rhai")) else { return };
    if let (path, Err(error)) = check.file(name) {
        let message = format!("the sequence script `{}` cannot be read: {error}", path.display());
        let remedy = "write its path relative to the campaign file, or remove `sequence`";
        check.note(FindingKind::MissingFile, &steps, message, remedy);
    }
}

element! {
    /// Search for the surge line after all other steps: at the end of each speed line the valve closes in small steps while the variation of pressures and flow indicates the distance to surge. It opens again before surge, and the surge-side end is marked with its uncertainty.
    pub(crate) SurgeSearchFile for SurgeSearchSettings {
        /// Smallest surge margin (flow over surge flow, minus one) to approach; 3 % if none is given.
        closest => closest_margin_ratio: Quantity<Fraction> [extend("x-min" = "0.5 %", "x-max" = "30 %"), example = &"3 %"];
        /// Largest change of the valve's opening per step near surge, relative to the opening; 3 % if none is given.
        step => step_ratio: Quantity<Fraction> [extend("x-min" = "0.5 %", "x-max" = "10 %"), example = &"3 %"];
        /// Time at each opening; 25 s if none is given. The rig needs the first 5 s to follow.
        dwell => dwell_s: Quantity<Duration> [extend("x-min" = "12 s", "x-max" = "10 min"), example = &"25 s"];
        /// Standard error of the surge flow at which a line is finished, without the flow meter's gain; 0.8 % if none is given.
        standard_error => wanted_standard_error_ratio: Quantity<Fraction> [extend("x-min" = "0.1 %", "x-max" = "5 %"), example = &"0.8 %"];
        /// Maximum number of openings of one line; 40 if none is given.
        most_steps => most_steps: usize [range(min = 5, max = 200), example = 40];
        /// Growth of the coefficient of variation of a pressure, from far from surge, at which soft surge is marked; 2 if none is given. It needs fast samples of P2 or P1.
        soft_surge => soft_growth_ratio: f64 [range(min = 1.2, max = 100), example = 2.0];
    }
}

impl SurgeSearchFile {
    /// The search, with defaults filled in.
    pub(crate) fn settings(self) -> SurgeSearchSettings {
        let mut settings = SurgeSearchSettings::default();
        self.apply(&mut settings);
        settings
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_written_and_what_it_means() {
        let read = |text: &str| {
            repeats(crate::testing::any(text).unwrap()).map(|r| (r.jump.is_some(), r.every_steps, r.at_least))
        };
        assert_eq!(read("off"), None);
        assert_eq!(repeats(None).map(|r| (r.jump, r.every_steps, r.at_least)), Some((None, 12, 2)));
        assert_eq!(read("{every: 20}"), Some((false, 20, 2)));
        let jump = "{jump: {from: {speed: 50 krpm, opening: 1}, to: {speed: 90 krpm, opening: 1}}}";
        assert_eq!(read(jump), Some((true, 12, 2)));
    }

    #[test]
    fn what_is_left_out_has_its_default() {
        let read = |text| crate::testing::any::<SurgeSearchFile>(text).unwrap().settings();
        assert_eq!(read("{}"), SurgeSearchSettings::default());
        let written = SurgeSearchSettings {
            closest_margin_ratio: 0.05,
            dwell_s: 60.0,
            soft_growth_ratio: 3.0,
            ..SurgeSearchSettings::default()
        };
        assert_eq!(read("{closest: 5 %, dwell: 1 min, soft_surge: 3}"), written);
    }
}
