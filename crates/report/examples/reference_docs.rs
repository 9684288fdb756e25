//! Prints docs/reference/sequences.md, or with the argument `campaign` docs/reference/campaign.md.

use std::io::Write;

fn main() -> std::io::Result<()> {
    let page = match std::env::args().nth(1).as_deref() {
        Some("campaign") => mapper_report::campaign_page(),
        _ => mapper_report::sequence_page(),
    };
    std::io::stdout().write_all(page.as_bytes())
}
