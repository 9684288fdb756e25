//! Sizes of the machine that a campaign assumes, and the files of a first campaign.

use crate::formatting::number::significant_digits;
use crate::formatting::wrapped::wrapped;
use mapper_campaign::{AssumedSize, Campaign, internal_area_sigma_ratio};
use std::path::Path;

/// Width of the text, columns.
const COLUMNS: usize = 80;

/// The assumed sizes in one sentence, by name; `None` if the campaign gives all of them.
pub fn assumed_sentence(campaign: &Campaign) -> Option<String> {
    sentence_with(campaign, |size| size.name)
}

fn sentence_with(campaign: &Campaign, name: fn(&AssumedSize) -> &str) -> Option<String> {
    let sizes = &campaign.machine.assumed;
    if sizes.is_empty() {
        return None;
    }
    let named: Vec<String> = sizes.iter().map(|size| size_text(name(size), size)).collect();
    let wheel_mm = 1e3 * campaign.machine.params.compressor.wheel_diameter_m;
    let sigma_ratio = internal_area_sigma_ratio(sizes);
    let widened = if sigma_ratio > 0.0 {
        format!(
            "; the intervals of h include an uncertainty of {:.0} % (1 sigma) of the internal area of the compressor",
            100.0 * sigma_ratio
        )
    } else {
        String::new()
    };
    Some(format!(
        "assumed, from the machine of Burke et al. scaled to a wheel of {} mm: {}{widened}",
        significant_digits(wheel_mm, 3),
        named.join(", ")
    ))
}

/// The same by keys of the campaign, with a line for each 80 columns; empty if there is none.
pub fn assumed_text(campaign: &Campaign) -> String {
    sentence_with(campaign, |size| &size.key)
        .map_or_else(String::new, |sentence| wrapped(&sentence, COLUMNS, 2))
}

/// The files of a first campaign, and the next commands.
pub fn first_campaign_text(
    campaign: &Path,
    map: &Path,
    channels: Option<&Path>,
    points: usize,
    assumed: &[AssumedSize],
) -> String {
    let mut text =
        format!("campaign   {} ({points} points)\nmap        {}\n", campaign.display(), map.display());
    if let Some(channels) = channels {
        text += &format!("channels   {}\n", channels.display());
    }
    let phrases = format!(
        "{} sizes of the machine are assumed from its wheel: they are listed in the campaign as comments. Correct the ones that you know.",
        assumed.len()
    );
    text += &format!("\n{}\n", wrapped(&phrases, COLUMNS, 0).trim_end());
    text += &format!("Next: mapper check {}\n", campaign.display());
    text
}

fn size_text(name: &str, size: &AssumedSize) -> String {
    let unit = if size.unit.is_empty() { String::new() } else { format!(" {}", size.unit) };
    format!("{name} {}{unit}", significant_digits(size.value, 3))
}
