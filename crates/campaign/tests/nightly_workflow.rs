//! The workflow that ships for the nightly run is YAML with the keys that GitHub asks for. It is read as
//! our own files are.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_yaml::{Document, Source};
use std::path::Path;

#[test]
fn the_shipped_workflow_has_schedule_runner_and_steps() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../examples/nightly/nightly.yml");
    let text = std::fs::read_to_string(path).unwrap();
    let document = &Document { name: "workflow", example: "examples/nightly/nightly.yml" };
    let source = Source::new(document, Path::new(path), &text);
    let workflow = mapper_yaml::read(source).unwrap().0.value().clone();
    let job = &workflow["jobs"]["nightly"];
    assert!(workflow["on"]["schedule"][0]["cron"].is_string() && job["runs-on"].is_string(), "{workflow}");
    let steps = job["steps"].as_array().unwrap();
    assert!(steps.iter().all(|step| step["uses"].is_string() || step["run"].is_string()), "{steps:?}");
}
