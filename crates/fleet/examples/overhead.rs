//! What the contract costs in addition to the work: items made, parts written through, all merged.
//!
//! `cargo run --release --locked -p mapper-fleet --example overhead -- DIR 10000 8192`: items, and bytes of each result.

#![allow(clippy::print_stdout, missing_docs)]

use mapper_fleet::{
    CreatedStudy, Engine, FleetError, ItemDraft, ItemSelection, Kind, Machine, Output, Results, StudyDraft,
    StudyFile, WorkContext, WorkError, open_study,
};
use serde_json::{Value, json};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

/// Items that take no time.
struct Nothing {
    items: usize,
    bytes: usize,
}

impl Kind for Nothing {
    fn name(&self) -> &'static str {
        "nothing"
    }

    fn summary(&self) -> &'static str {
        "no work at all"
    }

    fn items(&self, _: &StudyFile) -> Result<StudyDraft, FleetError> {
        // As long as an item with its campaign.
        let campaign = "#".repeat(4000);
        let item = |n| ItemDraft { name: format!("{n}"), payload: json!({ "n": n, "campaign": campaign }) };
        Ok(StudyDraft { items: (0..self.items).map(item).collect(), settings: Value::Null })
    }

    fn work(&self, payload: &Value, _: WorkContext<'_>) -> Result<String, WorkError> {
        Ok(format!("{{\"n\":{},\"r\":\"{}\"}}", payload["n"], "x".repeat(self.bytes)))
    }

    fn merge(&self, _: &Value, parts: &mut Results<'_>, out: &Output) -> Result<String, FleetError> {
        let mut bytes = 0;
        for (_, body) in parts {
            bytes += body.map_or(0, |body| body.len());
        }
        out.write("bytes.txt", format!("{bytes}\n").as_bytes())?;
        Ok(format!("{bytes} bytes"))
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [directory, items, bytes] = arguments.as_slice() else { return Err("DIR ITEMS BYTES".into()) };
    let directory = PathBuf::from(directory);
    std::fs::create_dir_all(&directory)?;
    let kind = Nothing { items: items.parse()?, bytes: bytes.parse()? };
    std::fs::write(directory.join("study.yaml"), "fleet: overhead\nstudy: nothing\n")?;
    let study = open_study(&directory.join("study.yaml"))?;
    let machine = Machine { name: "overhead", thread_s: &|| 0.0, peak_memory_bytes: &|| None };
    let per_item = |name: &str, started: Instant| {
        let took_s = started.elapsed().as_secs_f64();
        println!("{name:6} {took_s:8.2} s, {:.3} ms an item", 1e3 * took_s / kind.items as f64);
    };
    let started = Instant::now();
    let fleet = CreatedStudy::create(&study, &kind, &directory.join("fleet"), "example", "overhead")?.fleet;
    per_item("make", started);
    let stop = AtomicBool::new(false);
    let engine = Engine { jobs: Some(1), stop: &stop, on_progress: &|_, _| {} };
    let started = Instant::now();
    fleet.work(&kind, ItemSelection::All, false, &engine, &machine)?;
    per_item("parts", started);
    let started = Instant::now();
    fleet.status();
    per_item("status", started);
    let started = Instant::now();
    fleet.merge(&kind, false, &machine)?;
    per_item("merge", started);
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    println!("{}", status.lines().find(|line| line.starts_with("VmHWM")).unwrap_or_default());
    Ok(())
}
