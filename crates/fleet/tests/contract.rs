//! The contract: whoever does which item when, the result is the same; what is wrong is named and left out.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_fleet::{
    CreatedStudy, Engine, Fleet, FleetError, ItemDraft, ItemSelection, Kind, Limits, Machine, MergeOutcome,
    Output, Results, Shard, StudyDraft, StudyFile, SubmitOptions, Template, WorkContext, WorkError,
    WorkOutcome, kind_of, open_study,
};
use schemars::JsonSchema;
use serde::Deserialize;
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

const PROGRAM: &str = "mapper 1.2.3";

/// Squares of numbers. 13 fails once and 17 panics once if `faults` says so.
#[derive(Default)]
struct Squares {
    faults: AtomicBool,
    calls: AtomicUsize,
}

#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SquaresStudy {
    #[serde(rename = "fleet")]
    _fleet: String,
    #[serde(rename = "study")]
    _study: String,
    /// How many.
    numbers: u64,
}

impl Kind for Squares {
    fn name(&self) -> &'static str {
        "squares"
    }

    fn summary(&self) -> &'static str {
        "squares of numbers"
    }

    fn items(&self, study: &StudyFile) -> Result<StudyDraft, FleetError> {
        let numbers = study.read::<SquaresStudy>()?.numbers;
        let items =
            (0..numbers).map(|n| ItemDraft { name: format!("number {n}"), payload: json!(n) }).collect();
        Ok(StudyDraft { items, settings: Value::Null })
    }

    fn work(&self, payload: &Value, at: WorkContext<'_>) -> Result<String, WorkError> {
        let n = payload.as_u64().unwrap();
        self.calls.fetch_add(1, Ordering::Relaxed);
        assert!(at.scratch.is_dir());
        if self.faults.load(Ordering::Relaxed) {
            assert_ne!(n, 17, "seventeen");
            if n == 13 {
                return Err(WorkError::Failed("thirteen brings bad luck".to_owned()));
            }
        }
        Ok((n * n).to_string())
    }

    fn merge(&self, _: &Value, parts: &mut Results<'_>, out: &Output) -> Result<String, FleetError> {
        let lines: String =
            parts.filter_map(|(name, body)| Some(format!("{name}: {}\n", body.ok()?))).collect();
        out.write("squares.txt", lines.as_bytes())?;
        Ok("squares".to_owned())
    }
}

fn machine(name: &str) -> Machine<'_> {
    Machine { name, thread_s: &|| 0.0, peak_memory_bytes: &|| None }
}

static NEVER: AtomicBool = AtomicBool::new(false);

fn engine(jobs: usize) -> Engine<'static> {
    Engine { jobs: Some(jobs), stop: &NEVER, on_progress: &|_, _| {} }
}

fn study(folder: &Path, numbers: u64) -> StudyFile {
    let path = folder.join("study.yaml");
    std::fs::write(&path, format!("fleet: some\nstudy: squares\nnumbers: {numbers}\n")).unwrap();
    open_study(&path).unwrap()
}

fn made(folder: &Path, numbers: u64, program: &str) -> Result<CreatedStudy, FleetError> {
    CreatedStudy::create(
        &study(folder, numbers),
        &Squares::default(),
        &folder.join("fleet"),
        program,
        "maker",
    )
}

fn work(fleet: &Fleet, kind: &Squares, which: ItemSelection, again: bool) -> Result<WorkOutcome, FleetError> {
    fleet.work(kind, which, again, &engine(2), &machine("worker"))
}

fn merge(fleet: &Fleet) -> MergeOutcome {
    fleet.merge(&Squares::default(), false, &machine("merger")).unwrap()
}

fn result(fleet: &Fleet) -> String {
    std::fs::read_to_string(fleet.result().join("squares.txt")).unwrap()
}

fn squares(numbers: impl Iterator<Item = u64>) -> String {
    numbers.map(|n| format!("number {n}: {}\n", n * n)).collect()
}

#[test]
fn any_number_of_shards_in_any_order_gives_the_same_bytes() {
    let expected = squares(0..100);
    for shards in [1, 2, 7, 150] {
        let folder = tempfile::tempdir().unwrap();
        let fleet = made(folder.path(), 100, PROGRAM).unwrap().fleet;
        let kind = Squares::default();
        assert!(merge(&fleet).result.is_none());
        for number in (1..=shards).rev() {
            let shard: Shard = format!("{number}/{shards}").parse().unwrap();
            work(&fleet, &kind, ItemSelection::Shard(shard), false).unwrap();
            // A second time nothing is left to do.
            assert_eq!(work(&fleet, &kind, ItemSelection::Shard(shard), false).unwrap().done, 0);
        }
        assert_eq!(kind.calls.load(Ordering::Relaxed), 100);
        assert!(merge(&fleet).result.is_some());
        assert_eq!(result(&fleet), expected);
        merge(&fleet);
        assert_eq!(result(&fleet), expected);
    }
}

#[test]
fn items_come_and_go_and_parts_stay() {
    let folder = tempfile::tempdir().unwrap();
    let fleet = made(folder.path(), 20, PROGRAM).unwrap().fleet;
    let kind = Squares::default();
    work(&fleet, &kind, ItemSelection::All, false).unwrap();
    let before = std::fs::read(folder.path().join("fleet/study.json")).unwrap();
    let more = made(folder.path(), 30, PROGRAM).unwrap();
    assert_eq!((more.new, more.gone), (10, 0));
    assert_eq!(work(&more.fleet, &kind, ItemSelection::All, false).unwrap().done, 10);
    merge(&more.fleet);
    assert_eq!(result(&more.fleet), squares(0..30));
    let fewer = made(folder.path(), 20, PROGRAM).unwrap();
    assert_eq!((fewer.new, fewer.gone), (0, 10));
    assert_eq!(
        std::fs::read(folder.path().join("fleet/study.json")).unwrap(),
        before,
        "equal studies, equal bytes"
    );
    let merged = merge(&fewer.fleet);
    assert_eq!(merged.status.unrelated_parts.len(), 10, "parts of no item are named");
    assert_eq!(result(&fewer.fleet), squares(0..20));
}

#[test]
fn what_fails_is_named_with_its_reason_and_done_again_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    let fleet = made(folder.path(), 30, PROGRAM).unwrap().fleet;
    let kind = Squares { faults: AtomicBool::new(true), ..Squares::default() };
    let outcome = work(&fleet, &kind, ItemSelection::All, false).unwrap();
    assert_eq!((outcome.done, outcome.failed.len()), (28, 2));
    let merged = merge(&fleet);
    assert!(merged.result.is_none());
    let why: BTreeMap<&str, &str> =
        merged.status.failed.iter().map(|item| (item.name.as_str(), item.why.as_deref().unwrap())).collect();
    assert_eq!(why["number 13"], "thirteen brings bad luck");
    assert!(why["number 17"].contains("panicked") && why["number 17"].contains("seventeen"), "{why:?}");
    // Reported again, not done again.
    let outcome = work(&fleet, &kind, ItemSelection::All, false).unwrap();
    assert_eq!((outcome.done, outcome.already_done, outcome.failed.len()), (0, 28, 2));
    fleet.merge(&kind, true, &machine("merger")).unwrap().result.expect("what there is");
    assert_eq!(result(&fleet), squares((0..30).filter(|n| ![13, 17].contains(n))));
    kind.faults.store(false, Ordering::Relaxed);
    assert_eq!(work(&fleet, &kind, ItemSelection::All, true).unwrap().done, 2);
    merge(&fleet);
    assert_eq!(result(&fleet), squares(0..30));
}

#[test]
fn a_stop_keeps_what_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let fleet = made(folder.path(), 40, PROGRAM).unwrap().fleet;
    let (kind, stop) = (Squares::default(), AtomicBool::new(false));
    let report = |done: usize, _: usize| stop.store(done >= 10, Ordering::Relaxed);
    let stopped = Engine { jobs: Some(1), stop: &stop, on_progress: &report };
    let error = fleet.work(&kind, ItemSelection::All, false, &stopped, &machine("worker")).unwrap_err();
    assert!(matches!(error, FleetError::Interrupted), "{error}");
    assert_eq!((fleet.status().done, fleet.status().started_items()), (10, 0));
    assert_eq!(
        work(&fleet, &kind, ItemSelection::All, false).unwrap(),
        WorkOutcome { done: 30, already_done: 10, failed: vec![] }
    );
    assert_eq!(kind.calls.load(Ordering::Relaxed), 40);
}

/// Path of the part of item `n`.
fn part(fleet: &Fleet, n: usize) -> std::path::PathBuf {
    fleet.directory().join("parts").join(format!("{}.part", fleet.study.items[n].hash))
}

#[test]
fn hostile_parts_are_named_and_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let fleet = made(folder.path(), 12, PROGRAM).unwrap().fleet;
    let kind = Squares::default();
    work(&fleet, &kind, ItemSelection::All, false).unwrap();
    let good = std::fs::read(part(&fleet, 0)).unwrap();
    // Truncated in the first line and in the body, empty, changed, longer, another item's, of another version, huge, no text.
    std::fs::write(part(&fleet, 0), &good[..40]).unwrap();
    let bytes = std::fs::read(part(&fleet, 11)).unwrap();
    std::fs::write(part(&fleet, 11), &bytes[..bytes.len() - 1]).unwrap();
    std::fs::write(part(&fleet, 1), "").unwrap();
    let mut changed = std::fs::read(part(&fleet, 9)).unwrap();
    *changed.last_mut().unwrap() ^= 1;
    std::fs::write(part(&fleet, 9), changed).unwrap();
    std::fs::write(part(&fleet, 2), [std::fs::read(part(&fleet, 2)).unwrap(), b"99".to_vec()].concat())
        .unwrap();
    std::fs::copy(part(&fleet, 4), part(&fleet, 3)).unwrap();
    let text = std::fs::read_to_string(part(&fleet, 5)).unwrap();
    std::fs::write(part(&fleet, 5), text.replace(PROGRAM, "mapper 1.2.4")).unwrap();
    let huge = text.replace(&fleet.study.items[5].hash.to_string(), &fleet.study.items[6].hash.to_string());
    std::fs::write(part(&fleet, 6), huge.replace("\"body_bytes\":2", "\"body_bytes\":99999999999")).unwrap();
    // A sparse file of a terabyte is not read.
    std::fs::File::create(part(&fleet, 7)).unwrap().set_len(1 << 40).unwrap();
    std::fs::write(fleet.directory().join("parts/notes.txt"), "hello").unwrap();
    #[cfg(unix)]
    {
        std::fs::remove_file(part(&fleet, 8)).unwrap();
        std::os::unix::fs::symlink("/dev/zero", part(&fleet, 8)).unwrap();
    }
    // The progress counts none of them as done.
    let status = fleet.status();
    assert_eq!((status.done, status.refused.len()), (2, 10));
    let merged = fleet.merge(&kind, true, &machine("merger")).unwrap();
    let why: BTreeMap<&str, &str> =
        merged.status.refused.iter().map(|item| (item.name.as_str(), item.why.as_deref().unwrap())).collect();
    for (number, word) in [
        (0, "not a part"),
        (1, "not a part"),
        (2, "bytes instead"),
        (3, "contains the item"),
        (5, "was made by mapper 1.2.4"),
        (6, "more than"),
        (7, "not a part"),
        (9, "changed"),
        (11, "bytes instead"),
    ] {
        let reason = why.get(format!("number {number}").as_str()).copied().unwrap_or("nothing");
        assert!(reason.contains(word), "{number}: {reason}");
    }
    assert_eq!(merged.status.unrelated_parts, ["notes.txt"]);
    assert!(merge(&fleet).result.is_none());
    // They are replaced by what belongs there.
    work(&fleet, &kind, ItemSelection::All, false).unwrap();
    assert!(merge(&fleet).result.is_some());
    assert_eq!(result(&fleet), squares(0..12));
}

/// Slurm's commands as functions of the shell: each job gets the next ID.
const SBATCH: &str = r#"
sbatch() {
    cat > /dev/null
    echo "Welcome to the cluster, work hard"
    for option in "$@"; do
        case $option in
        --dependency=*) [ ! -e REFUSES ] || { echo "sbatch: error: no dependencies today" >&2; return 1; } ;;
        esac
    done
    echo job >> JOBS
    echo "$(wc -l < JOBS);cluster"
}
"#;

#[test]
#[cfg(unix)]
fn a_queue_is_asked_once_and_its_answers_are_understood() {
    let folder = tempfile::tempdir().unwrap();
    let fleet = made(folder.path(), 12, PROGRAM).unwrap().fleet;
    let kind = Squares::default();
    let place = |name: &str| folder.path().join(name).display().to_string();
    let text = SBATCH.replace("JOBS", &place("jobs")).replace("REFUSES", &place("refuses"));
    let slurm = Template::slurm().text.lines().skip(2).collect::<Vec<_>>().join("\n");
    let template = Template {
        name: "slurm".to_owned(),
        text: format!("#states: cat {}\n{text}\n{slurm}\n", place("states")),
    };
    let options = SubmitOptions {
        template,
        program: "mapper".into(),
        partition: String::new(),
        cpus: 1,
        task_min: 15.0,
        limits: Limits { time_min: None, tasks: 10, at_once: None, hours: None, memory_mb: None },
    };
    let machine = machine("login");
    let cost = fleet.estimate_cost(&kind, 3, &engine(1), &machine).unwrap().cost;
    // A greeting before the ID, and the cluster's name behind it.
    let sent = fleet.submit(&options, &cost, &machine).unwrap();
    assert_eq!((sent.work.as_str(), sent.merge.as_deref()), ("1", Some("2")));
    // While its tasks wait or run, nothing is submitted a second time.
    std::fs::write(place("states"), "PENDING\nRUNNING\n").unwrap();
    for again in [fleet.submit(&options, &cost, &machine), fleet.retry(&machine)] {
        assert!(matches!(again, Err(FleetError::StillQueued { tasks: 2, .. })), "{again:?}");
    }
    // An array whose merge the queue refuses is in the queue, and is known.
    std::fs::write(place("states"), "").unwrap();
    std::fs::write(place("refuses"), "").unwrap();
    let sent = fleet.submit(&options, &cost, &machine).unwrap();
    assert_eq!((sent.work.as_str(), sent.merge.as_deref()), ("3", None));
    assert!(sent.merge_refused.is_some());
    assert_eq!(fleet.submission().unwrap(), sent);
    // A queue that prints no ID has taken nothing.
    let mute = Template { text: "sbatch() { echo busy; }\n".to_owned() + &slurm, ..options.template.clone() };
    let refused = fleet.submit(&SubmitOptions { template: mute, ..options.clone() }, &cost, &machine);
    assert!(matches!(refused, Err(FleetError::Queue { .. })), "{refused:?}");
    assert_eq!(fleet.submission().unwrap(), sent);
}

#[test]
fn versions_and_studies_are_never_mixed() {
    let folder = tempfile::tempdir().unwrap();
    let fleet = made(folder.path(), 5, PROGRAM).unwrap().fleet;
    let newer = made(folder.path(), 5, "mapper 1.2.4").unwrap_err().to_string();
    assert!(newer.contains(PROGRAM) && newer.contains("1.2.4"), "{newer}");
    assert!(Fleet::open(fleet.directory(), "mapper 1.2.4").is_err());
    let path = folder.path().join("study.yaml");
    std::fs::write(&path, "fleet: others\nstudy: squares\nnumbers: 5\n").unwrap();
    let other = open_study(&path).unwrap();
    let error =
        CreatedStudy::create(&other, &Squares::default(), fleet.directory(), PROGRAM, "maker").unwrap_err();
    assert!(matches!(error, FleetError::OtherStudy { .. }), "{error}");
    // An item that was changed is not done.
    let item = fleet.directory().join("items").join(format!("{}.json", fleet.study.items[2].hash));
    std::fs::write(&item, "{}").unwrap();
    let error = work(&fleet, &Squares::default(), ItemSelection::All, false).unwrap_err().to_string();
    assert!(error.contains("has been changed"), "{error}");
}

#[test]
fn two_that_merge_at_once_write_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let fleet = made(folder.path(), 200, PROGRAM).unwrap().fleet;
    work(&fleet, &Squares::default(), ItemSelection::All, false).unwrap();
    std::thread::scope(|scope| {
        for name in ["one", "two", "three"] {
            let fleet = &fleet;
            scope.spawn(move || {
                for _ in 0..5 {
                    let merged = fleet.merge(&Squares::default(), false, &machine(name)).unwrap();
                    assert!(merged.result.is_some());
                    assert_eq!(result(fleet), squares(0..200));
                }
            });
        }
    });
    let left: Vec<_> =
        std::fs::read_dir(fleet.directory()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(left.iter().all(|name| !name.to_string_lossy().ends_with(".new")), "{left:?}");
}

#[test]
fn mistakes_of_a_study_have_their_places() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("study.yaml");
    let read = |text: &str| {
        std::fs::write(&path, text).unwrap();
        let study = open_study(&path).map_err(FleetError::from)?;
        kind_of(&study, &[&Squares::default()])?;
        let _ = Squares::default().items(&study)?;
        Ok::<(), FleetError>(())
    };
    for (text, word) in [
        ("fleet: a\nstudy: cubes\nnumbers: 3\n", "cubes"),
        ("fleet: a\nnumbers: 3\n", "the kind of study is missing"),
        ("fleet: a\nstudy: squares\nnumbres: 3\n", "numbers"),
        ("fleet: a\nstudy: [squares\n", "study.yaml"),
    ] {
        let error = read(text).unwrap_err().to_string();
        assert!(error.contains(word), "{error}");
    }
    assert!(read("fleet: a\nstudy: squares\nnumbers: 3\n").is_ok());
}
