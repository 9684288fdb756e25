//! `identification.window:`

use crate::checking::Check;
use crate::units::{Duration, Kind, Quantity};
use mapper_core::WindowRule;
use mapper_yaml::{FindingKind, steps};
use schemars::JsonSchema;
use serde::Deserialize;

// Untagged: the type of the YAML node determines the variant, and the schema has been checked.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum WindowFile {
    Named(NamedWindow),
    Fixed(FixedWindow),
}

#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum NamedWindow {
    Auto,
}

/// Part of the step, in time after the jump.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct FixedWindow {
    /// Start, after the jump.
    #[schemars(extend("x-min" = "0 s"))]
    start: Quantity<Duration>,
    /// End, after the jump.
    #[schemars(extend("x-above" = "0 s"), example = &"110 s")]
    end: Quantity<Duration>,
}

impl From<WindowFile> for WindowRule {
    fn from(file: WindowFile) -> Self {
        match file {
            WindowFile::Named(NamedWindow::Auto) => WindowRule::Auto,
            WindowFile::Fixed(FixedWindow { start, end }) => {
                WindowRule::Fixed { start_s: start.value, end_s: end.value }
            }
        }
    }
}

/// Checks that a window begins before it ends, and ends within the dwell.
pub(crate) fn check(check: &mut Check<'_>) {
    let end_path = steps!["identification", "window", "end"];
    let start = check.quantity(Kind::Duration, &steps!["identification", "window", "start"]);
    let end = check.quantity(Kind::Duration, &end_path);
    let dwell = check.quantity(Kind::Duration, &steps!["timing", "dwell"]);
    if let (Some((start_s, start)), Some((end_s, end))) = (start, end)
        && start_s >= end_s
    {
        let message = format!("the window ends at `{end}`, not after its start at `{start}`");
        check.note(FindingKind::Conflict, &end_path, message, "`end` must be after `start`");
    }
    if let (Some((end_s, end)), Some((dwell_s, dwell))) = (end, dwell)
        && end_s > dwell_s
    {
        let message = format!("the window ends at `{end}`, beyond the dwell of `{dwell}`");
        let remedy = "end it earlier, or lengthen `timing.dwell`";
        check.note(FindingKind::Conflict, &end_path, message, remedy);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_forms() {
        let read = |text| crate::testing::any::<WindowFile>(text).map(WindowRule::from);
        assert_eq!(read("auto").unwrap(), WindowRule::Auto);
        let fixed = WindowRule::Fixed { start_s: 10.0, end_s: 110.0 };
        assert_eq!(read("{start: 10 s, end: 110 s}").unwrap(), fixed);
        assert!(read("manual").is_err() && read("{start: 10 s}").is_err());
    }
}
