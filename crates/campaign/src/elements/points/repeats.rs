//! `repeats:`

use crate::checking::Check;
use crate::elements::points::grid::PointFile;
use crate::units::Kind;
use mapper_core::{Jump, Repeats};
use mapper_yaml::{FindingKind, steps};
use schemars::JsonSchema;
use serde::Deserialize;

const DEFAULT_SPACING_STEPS: usize = 12;
const DEFAULT_COUNT: usize = 2;

// Untagged: the type of the YAML node determines the variant, and the schema has been checked.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum RepeatsFile {
    Named(NamedRepeats),
    Jump(RepeatedJumpFile),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum NamedRepeats {
    Off,
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
        Some(RepeatsFile::Named(NamedRepeats::Off)) => return None,
        None => RepeatedJumpFile::default(),
    };
    Some(Repeats {
        jump: file.jump.map(|jump| Jump { from: jump.from.into(), to: jump.to.into() }),
        every_steps: file.every.unwrap_or(DEFAULT_SPACING_STEPS),
        at_least: file.at_least.unwrap_or(DEFAULT_COUNT),
    })
}

/// Checks the points of a repeated jump.
pub(crate) fn check(check: &mut Check<'_>) {
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
}
