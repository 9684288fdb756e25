//! Prints docs/reference/sequences.md, or with the argument `campaign` docs/reference/campaign.md.

mod campaign_page;
mod sequence_page;

use std::io::Write;

fn main() -> std::io::Result<()> {
    let page = match std::env::args().nth(1).as_deref() {
        Some("campaign") => campaign_page::campaign_page(),
        _ => sequence_page::sequence_page(),
    };
    std::io::stdout().write_all(page.as_bytes())
}
