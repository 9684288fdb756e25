//! Every output of a run uses the same step numbers, from 1.

use mapper_recording::{ReadOptions, read_marks};
use mapper_tests::{CampaignFile, SHORT_GRID, SINGLE_STEP_METHOD, mapper, only_run};
use serde_json::Value;
use std::path::Path;

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// The numbers of steps among some objects.
fn numbers(of: &Value) -> Vec<u64> {
    of.as_array().unwrap().iter().map(|one| one["step"].as_u64().unwrap()).collect()
}

/// The leading numbers of a Markdown table's rows whose head begins with `step`.
fn in_tables(report: &str) -> Vec<u64> {
    let mut found = Vec::new();
    let mut inside = false;
    for line in report.lines() {
        let first = line.strip_prefix("| ").and_then(|rest| rest.split([' ', '|']).next());
        inside = line.starts_with('|') && (inside || first == Some("step"));
        found.extend(first.filter(|_| inside).and_then(|number| number.parse::<u64>().ok()));
    }
    found
}

#[test]
fn all_files_of_a_run_use_the_same_step_numbers() {
    let changes: Vec<(&str, &str)> = SHORT_GRID.iter().chain(SINGLE_STEP_METHOD).copied().collect();
    let campaign = CampaignFile::shipped_with(&changes);
    let path = campaign.path.as_os_str();
    let planned = mapper(["plan".as_ref(), path, "--json".as_ref()]).exits(0).json();
    let count = planned["steps"].as_array().unwrap().len() as u64;
    let all: Vec<u64> = (1..=count).collect();
    assert!(count > 1);
    assert_eq!(numbers(&planned["steps"]), all);

    let out = campaign.runs();
    let lines = ["--progress".as_ref(), "lines".as_ref(), "--json".as_ref()];
    let run = ["run".as_ref(), path, "--out".as_ref(), out.as_os_str()];
    let done = mapper(run.into_iter().chain(lines)).exits(0);
    for number in &all {
        assert!(done.stderr.contains(&format!("step {number} of {count}, ")), "{number}: {}", done.stderr);
    }
    assert_eq!(numbers(&done.json()["points"]), all);

    let run = only_run(&out);
    let plan = json(&run.join("plan.json"));
    assert_eq!(numbers(&plan["steps"]), all);
    let points = json(&run.join("points.json"));
    assert_eq!(numbers(&points["points"]), all);
    let map = json(&run.join("map.json"));
    let on_lines =
        map["lines"].as_array().unwrap().iter().flat_map(|line| line["points"].as_array().unwrap());
    let mut of_map: Vec<u64> = on_lines.map(|point| point["identified"]["step"].as_u64().unwrap()).collect();
    let table = std::fs::read_to_string(run.join("map.csv")).unwrap();
    let mut rows = table.lines().filter(|line| !line.starts_with('#')).map(|line| line.split(',').collect());
    let heads: Vec<&str> = rows.next().unwrap();
    let column = heads.iter().position(|name| *name == "step").unwrap();
    let mut of_table: Vec<u64> = rows.map(|row: Vec<&str>| row[column].parse().unwrap()).collect();
    let mut of_report = in_tables(&std::fs::read_to_string(run.join("report.md")).unwrap());
    of_report.sort_unstable();
    of_report.dedup();
    of_map.sort_unstable();
    of_table.sort_unstable();
    assert_eq!((&of_map, &of_table, &of_report), (&all, &all, &all));

    let journal = std::fs::read_to_string(run.join("journal.jsonl")).unwrap();
    let entries = journal.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
    let saved: Vec<u64> = entries.filter_map(|entry| entry["step_saved"].as_u64()).collect();
    assert_eq!(saved, all);
    let page = std::fs::read_to_string(run.join("report.html")).unwrap();
    for number in &all {
        assert!(page.contains(&format!("data-step=\"{number}\"")), "{number}");
    }
    assert!(!page.contains("data-step=\"0\""));
    let (steps, _) = read_marks(&run.join("recording.mcap"), &ReadOptions::default()).unwrap();
    let recorded: Vec<u64> =
        steps.iter().filter_map(|step| step.number()).map(|number| number as u64).collect();
    assert_eq!(recorded, all);
    // Each number names the same point everywhere.
    for (step, (point, marker)) in
        plan["steps"].as_array().unwrap().iter().zip(points["points"].as_array().unwrap().iter().zip(&steps))
    {
        let target = marker.to.unwrap();
        assert_eq!(step["speed_rpm"], point["target"]["speed_rpm"]);
        assert_eq!(step["speed_rpm"].as_f64(), Some(target.speed_rpm));
        assert_eq!(step["valve"].as_f64(), Some(target.valve_opening_ratio));
    }
}
