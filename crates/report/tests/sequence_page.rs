//! The page of the functions that a script may call, compared with the one in docs.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

#[test]
fn the_documentation_is_what_the_functions_say() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/reference/sequences.md");
    let written = std::fs::read_to_string(path).unwrap();
    assert!(
        written == mapper_report::sequence_page(),
        "docs/reference/sequences.md is stale: run `cargo xtask docs`"
    );
}
