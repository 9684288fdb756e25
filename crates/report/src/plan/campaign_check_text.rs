//! The outcome of the check of a campaign, in a sentence.

use crate::formatting::duration::duration;
use crate::formatting::table::COLUMNS;
use crate::formatting::wrapped::wrapped;
use mapper_campaign::Campaign;
use std::path::Path;

/// That a campaign has no mistakes, with its size and duration. `is_planned`: the number of steps is known, and not only its maximum.
pub fn campaign_check_text(
    file: &Path,
    campaign: &Campaign,
    (steps, is_planned): (usize, bool),
    duration_s: f64,
    warnings: usize,
) -> String {
    let number = match warnings {
        0 => String::new(),
        1 => ", 1 warning".to_owned(),
        count => format!(", {count} warnings"),
    };
    let text = format!(
        "{}: no mistakes{number}. {} points in {}{steps} steps on `{}` in {} of rig time{}.",
        file.display(),
        campaign.points.len(),
        if is_planned { "" } else { "at most " },
        campaign.backend.name,
        duration(duration_s),
        if campaign.sequence.is_some() { " by its script on the nominal machine" } else { "" },
    );
    wrapped(&text, COLUMNS, 2)
}
