//! Campaign files: the shipped one, and shorter or longer ones made from it.

use crate::repository;
use std::path::{Path, PathBuf};

/// The shipped campaign, as a user names it in the root of the repository.
pub const SHIPPED: &str = "campaigns/turbo_a.yaml";

/// Replacements in the shipped campaign that reduce it to four points.
pub const SHORT_GRID: &[(&str, &str)] = &[
    (
        "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
        "speeds: [80 krpm, 125 krpm]",
    ),
    ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 1.4]"),
    ("warm_up: 2 min ", "warm_up: 60 s "),
    ("dwell: 40 s ", "dwell: 120 s "),
    ("seed: 1 ", "repeats: off\nreturn_to_first: false\nseed: 1 "),
];

/// Replacements for the dynamic method of the paper, which identifies each step separately, and no soak before the run.
pub const SINGLE_STEP_METHOD: &[(&str, &str)] = &[
    ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
    ("method: joint ", "method: dynamic "),
];

/// A campaign file in a directory of its own.
#[derive(Debug)]
pub struct CampaignFile {
    /// The file.
    pub path: PathBuf,
    /// Its text.
    pub text: String,
    directory: tempfile::TempDir,
}

impl CampaignFile {
    /// The shipped campaign with these replacements; each replaced part must occur exactly once.
    pub fn shipped_with(replacements: &[(&str, &str)]) -> Self {
        let mut text = std::fs::read_to_string(repository().join(SHIPPED)).unwrap();
        for (old, new) in replacements {
            assert_eq!(text.matches(old).count(), 1, "`{old}` in the shipped campaign");
            text = text.replace(old, new);
        }
        Self::of(text)
    }

    /// A campaign file with this text.
    pub fn of(text: String) -> Self {
        let directory = crate::scratch();
        let path = directory.path().join("campaign.yaml");
        std::fs::write(&path, &text).unwrap();
        CampaignFile { path, text, directory }
    }

    /// The directory for runs of this campaign, next to it; it does not exist yet.
    pub fn runs(&self) -> PathBuf {
        self.directory.path().join("runs")
    }

    /// Number of the line, from 1, that contains `part`.
    pub fn line_of(&self, part: &str) -> usize {
        1 + self.text.lines().position(|line| line.contains(part)).expect(part)
    }

    /// The file's directory.
    pub fn directory(&self) -> &Path {
        self.directory.path()
    }
}
