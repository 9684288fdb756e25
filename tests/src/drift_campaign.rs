//! A campaign that repeats one jump on a rig with tolerances, so that drift is visible.

use crate::{CampaignFile, repository, shared_run};
use std::path::PathBuf;

/// Changes to the campaign of the gap rig.
#[derive(Debug, Clone)]
pub struct DriftCampaign<'a> {
    /// Entries of the virtual lab's `drift:`; empty for none.
    pub drift: &'a str,
    /// Seed of the rig.
    pub seed: u32,
    /// Speeds of the grid at openings 0.55 (0.5 is beyond the surge line of some rigs), 0.7 and 1.0.
    pub speeds: &'a str,
    /// Maximum number of steps between repeats of the jump from 70 to 130 krpm.
    pub every: u32,
    /// Further lines at the top level.
    pub more: &'a str,
    /// Further replacements.
    pub replaced: &'a [(&'a str, &'a str)],
}

impl Default for DriftCampaign<'_> {
    /// 25 steps of two minutes; the jump four times.
    fn default() -> Self {
        DriftCampaign {
            drift: "",
            seed: 1,
            speeds: "[90 krpm, 150 krpm, 50 krpm, 130 krpm, 70 krpm, 110 krpm]",
            every: 8,
            more: "",
            replaced: &[],
        }
    }
}

impl DriftCampaign<'_> {
    /// The campaign as a file.
    pub fn write(&self) -> CampaignFile {
        let mut text = std::fs::read_to_string(repository().join("campaigns/gap_rig.yaml")).unwrap();
        let repeats = format!(
            "repeats: {{jump: {{from: {{speed: 70 krpm, opening: 0.7}}, to: {{speed: 130 krpm, opening: 0.7}}}}, \
             every: {}, at_least: 2}}\n{}",
            self.every, self.more
        );
        let tolerances = format!("    tolerances: drawn\n    drift: [{}]\n", self.drift);
        let seed = format!("seed: {}  ", self.seed);
        let own: [(&str, &str); 5] = [
            ("[90 krpm, 150 krpm, 50 krpm, 130 krpm, 70 krpm, 110 krpm]", self.speeds),
            ("openings: [0.5, 0.7, 1.0]", "openings: [0.55, 0.7, 1.0]"),
            ("    tolerances: drawn\n", &tolerances),
            ("repeats: off\n", &repeats),
            ("seed: 1  ", &seed),
        ];
        for (old, new) in own.iter().chain(self.replaced) {
            assert_eq!(text.matches(old).count(), 1, "`{old}` in the campaign of the gap rig");
            text = text.replace(old, new);
        }
        CampaignFile::of(text)
    }

    /// The recording of its run, shared with other tests.
    pub fn recording(&self) -> PathBuf {
        shared_run(&self.write()).run.join("recording.mcap")
    }
}
