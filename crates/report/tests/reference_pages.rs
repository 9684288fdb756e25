//! Generated pages of the reference, compared with those in docs.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[path = "../examples/reference_docs/campaign_page.rs"]
mod campaign_page;
#[path = "../examples/reference_docs/sequence_page.rs"]
mod sequence_page;

fn is_current(name: &str, page: &str) {
    let path = format!("{}/../../docs/reference/{name}", env!("CARGO_MANIFEST_DIR"));
    let written = std::fs::read_to_string(path).unwrap();
    assert!(written == page, "docs/reference/{name} is stale: run `cargo xtask docs`");
}

#[test]
fn the_page_of_sequences_has_the_registered_functions() {
    is_current("sequences.md", &sequence_page::sequence_page());
}

#[test]
fn the_page_of_campaigns_has_the_keys_of_the_schema() {
    is_current("campaign.md", &campaign_page::campaign_page());
}
