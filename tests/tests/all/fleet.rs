//! Fleets give the result of a single machine, and report errors.

use mapper_tests::{mapper, mapper_command, repository, scratch};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A night of four points by two methods with so many seeds, and the study of it: items of some tenths of a second.
pub fn write_study(folder: &Path, seeds: usize) -> PathBuf {
    let shipped = std::fs::read_to_string(repository().join("campaigns/nightly/turbo_a.yaml")).unwrap();
    let changed = [
        ("speeds: [50 krpm, 70 krpm, 90 krpm, 110 krpm, 130 krpm, 150 krpm]", "speeds: [70 krpm, 130 krpm]"),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0]", "openings: [0.7, 1.0]"),
        // Three quarters of the recording otherwise.
        ("warm_up: 10 min ", "warm_up: 60 s "),
        ("zero: {soak: 30 min} ", ""),
    ];
    let campaign = changed.iter().fold(shipped, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    std::fs::write(folder.join("small.yaml"), campaign).unwrap();
    let seeds: Vec<String> = (1..=seeds).map(|seed| seed.to_string()).collect();
    let runs =
        format!("  - {{campaign: small.yaml, methods: [dynamic, steady], seeds: [{}]}}\n", seeds.join(", "));
    std::fs::write(folder.join("nightly.yaml"), format!("nightly: small\nruns:\n{runs}")).unwrap();
    let study = folder.join("study.yaml");
    std::fs::write(&study, "fleet: small\nstudy: nightly\nnightly: nightly.yaml\n").unwrap();
    study
}

/// `mapper fleet COMMAND DIR ...`
pub fn fleet<'a>(command: &'a str, directory: &'a Path, more: &[&'a str]) -> Vec<&'a str> {
    [&["fleet", command, directory.to_str().unwrap()], more].concat()
}

/// Makes a study in a directory.
pub fn make(study: &Path, directory: &Path) {
    mapper(["fleet", "make", study.to_str().unwrap(), "--out", directory.to_str().unwrap()]).exits(0);
}

#[test]
fn shards_give_the_rows_of_a_night() {
    let scratch = scratch();
    let folder = scratch.path();
    let study = write_study(folder, 2);
    let directory = folder.join("fleet");
    make(&study, &directory);
    let estimate = mapper(fleet("estimate", &directory, &["--json", "--try", "1"])).exits(0).json();
    assert_eq!((&estimate["items"], &estimate["from"]), (&4.into(), &1.into()));
    assert!(estimate["hours"].as_f64().unwrap() > 0.0);
    let merged = mapper(fleet("merge", &directory, &[])).exits(8);
    assert!(merged.stdout.contains("missing: nightly_a"), "{}", merged.stdout);
    for shard in ["2/3", "3/3", "1/3"] {
        mapper(fleet("work", &directory, &["--shard", shard])).exits(0);
    }
    mapper(fleet("merge", &directory, &[])).exits(0);
    let rows: Value =
        serde_json::from_str(&std::fs::read_to_string(directory.join("result/runs.json")).unwrap()).unwrap();

    // One machine, one process.
    let night = |db: &str, more: &[&str]| {
        let (nightly, db) = (folder.join("nightly.yaml"), folder.join(db));
        let arguments = ["nightly", nightly.to_str().unwrap(), "--db", db.to_str().unwrap(), "--json"];
        mapper(arguments.iter().chain(more)).exits(0).json()["night"]["runs"].clone()
    };
    assert_eq!(rows, night("own.db", &[]));
    // And the history that the night would have.
    assert_eq!(rows, night("fleet.db", &["--fleet", directory.to_str().unwrap()]));
}

/// Another queue in ten lines: the shell, which does one task after the other.
const SHELL: &str = r#"
#states: true
set -eu
for range in $(echo "$ARRAY" | tr , ' '); do
    for task in $(seq "${range%-*}" "${range#*-}"); do
        sh "$TASK" "$task" > "$LOGS/work-$task.txt" 2>&1 || true
    done
done
sh "$MERGE" > "$LOGS/merge.txt" 2>&1
echo "work shell-1"
echo "merge shell-2"
"#;

#[test]
#[cfg(unix)]
fn a_template_submits_a_study_to_another_queue() {
    let scratch = scratch();
    let folder = scratch.path().canonicalize().unwrap();
    let study = write_study(&folder, 3);
    let (here, there, template) = (folder.join("here"), folder.join("there"), folder.join("shell.sh"));
    make(&study, &here);
    make(&study, &there);
    std::fs::write(&template, SHELL).unwrap();
    let given = ["--template", template.to_str().unwrap(), "--task", "0.001", "--array-limit", "3", "--json"];
    let sent = mapper(fleet("submit", &there, &given)).exits(0).json();
    assert_eq!(
        (&sent["work"], &sent["merge"], &sent["tasks"]),
        (&"shell-1".into(), &"shell-2".into(), &3.into())
    );
    let status = mapper(fleet("status", &there, &["--json"])).exits(0).json();
    assert_eq!(status["status"]["missing"].as_array().unwrap().len(), 0, "{status}");
    mapper(fleet("run", &here, &[])).exits(0);
    let result = |directory: &Path| std::fs::read(directory.join("result/runs.json")).unwrap();
    assert!(result(&here) == result(&there), "the result of a queue is that of one machine");
    // A template that says no numbers is named.
    std::fs::write(&template, "exit 3\n").unwrap();
    make(&study, &folder.join("third"));
    let refused = mapper(fleet("submit", &folder.join("third"), &given[..2]));
    assert!(refused.code != Some(0) && refused.stderr.contains("shell"), "{}", refused.stderr);
}

/// A calibration of a few cases of four points: in pieces it is that of one machine, and it says whether its probabilities hold.
#[test]
fn a_sharded_calibration_equals_a_single_one_and_scores_its_probabilities() {
    let scratch = scratch();
    let folder = scratch.path();
    let shipped = std::fs::read_to_string(repository().join("campaigns/gap_rig.yaml")).unwrap();
    let shorter = [("dwell: 120 s", "dwell: 60 s"), ("end: 110 s}", "end: 55 s}")];
    let campaign = crate::pages::FOUR_POINTS.iter().chain(&shorter).fold(shipped, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    let (file, study) = (folder.join("rig.yaml"), folder.join("study.yaml"));
    std::fs::write(&file, campaign).unwrap();
    let text = "fleet: small\nstudy: calibration\ncampaign: rig.yaml\nseed: 5\nnulls: 2\ncases: 1\n";
    std::fs::write(&study, text).unwrap();
    let directory = folder.join("fleet");
    make(&study, &directory);
    mapper(fleet("work", &directory, &["--shard", "2/2"])).exits(0);
    let printed = mapper(fleet("run", &directory, &[])).exits(0).stdout;
    assert!(printed.contains("expected calibration error"), "{printed}");
    let of_fleet = |name: &str| std::fs::read(directory.join("result").join(name)).unwrap();
    let [shipped, fitted]: [Value; 2] = serde_json::from_slice(&of_fleet("reliability.json")).unwrap();
    let observed: Vec<Value> = serde_json::from_slice(&of_fleet("observed.json")).unwrap();
    for one in [shipped, fitted] {
        let bins = one["bins"].as_array().unwrap();
        let judged: u64 = bins.iter().map(|bin| bin["right"]["trials"].as_u64().unwrap()).sum();
        assert_eq!(judged as usize, observed.len(), "every diagnosis is in one class");
        assert!((0.0..=1.0).contains(&one["expected_calibration_error"].as_f64().unwrap()), "{one}");
    }
    assert!(of_fleet("reliability.svg").starts_with(b"<svg"));

    // Without shards.
    let whole = folder.join("whole");
    make(&study, &whole);
    mapper(fleet("run", &whole, &[])).exits(0);
    for name in ["observed.json", "calibration.json"] {
        assert!(of_fleet(name) == std::fs::read(whole.join("result").join(name)).unwrap(), "{name} differs");
    }
}

#[test]
fn a_failed_item_is_reported_and_retried() {
    let scratch = scratch();
    let study = write_study(scratch.path(), 1);
    let directory = scratch.path().join("fleet");
    make(&study, &directory);
    // No room for its recording.
    let failed =
        mapper_command(fleet("run", &directory, &[])).env("TMPDIR", "/nowhere/at/all").output().unwrap();
    let failed = mapper_tests::Finished::from(failed).exits(8);
    assert!(
        failed.stdout.contains("failed: nightly_a") && failed.stdout.contains("/nowhere/at/all"),
        "{}",
        failed.stdout
    );
    let status = mapper(fleet("status", &directory, &["--json"])).exits(0).json();
    assert_eq!(status["status"]["failed"].as_array().unwrap().len(), 2);
    mapper(fleet("run", &directory, &[])).exits(8);
    mapper(fleet("run", &directory, &["--again"])).exits(0);
}

#[test]
fn wrong_input_is_reported() {
    let scratch = scratch();
    let folder = scratch.path();
    let empty = mapper(fleet("status", folder, &[])).exits(3);
    assert!(empty.stderr.contains("mapper fleet make"), "{}", empty.stderr);
    let study = folder.join("study.yaml");
    let out = folder.join("fleet");
    for (text, word) in [
        ("fleet: a\nstudy: sky\n", "nightly"),
        ("fleet: a\nstudy: blind\ncampaign: none.yaml\nseed: 1\ncases: 2\n", "none.yaml"),
        ("fleet: a\nstudy: blind\ncampain: none.yaml\nseed: 1\ncases: 2\n", "campaign"),
        ("fleet: a\nstudy: blind\ncampaign: none.yaml\nseed: 1\ncases: 0\n", "cases"),
    ] {
        std::fs::write(&study, text).unwrap();
        let made = mapper(["fleet", "make", study.to_str().unwrap(), "--out", out.to_str().unwrap()]);
        assert!([Some(1), Some(3)].contains(&made.code), "{}", made.stderr);
        assert!(made.stderr.contains(word) && !made.stderr.contains("panicked"), "{}", made.stderr);
        assert!(!out.join("study.json").exists());
    }
    mapper(fleet("work", &out, &["--shard", "3/2"])).exits(2);
    mapper(fleet("work", &out, &["--item", "../../etc"])).exits(2);
}
