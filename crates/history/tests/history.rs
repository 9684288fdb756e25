//! What a history must do: name what moved, keep what was written, and stand two writers and a kill.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_history::{Comparison, Filter, History, HistoryError, Metric, Night, PointRow, RunKey, RunRow};
use std::collections::BTreeMap;
use std::path::Path;

const NIGHTS: usize = 14;

/// A night of two methods and two seeds at six points. `truth` and `method` are added to the efficiencies of all points:
/// what a change of the model, or of the identification, does.
fn night(number: i64, truth: f64, method: f64) -> Night {
    let mut runs = Vec::new();
    for (name, bias) in [("dynamic", 0.003), ("steady", -0.02)] {
        for seed in [1, u64::MAX] {
            let points: Vec<PointRow> = (0..6)
                .map(|index| {
                    let eta_true = 0.65 + 0.01 * f64::from(index) + truth;
                    PointRow {
                        speed_rpm: 50e3 + 20e3 * f64::from(index),
                        valve_opening_ratio: 0.7,
                        visit: 0,
                        eta: Some(eta_true + bias + method),
                        eta_true: Some(eta_true),
                        h_w_m2k: (name == "dynamic").then_some(800.0),
                        h_true_w_m2k: Some(790.0),
                    }
                })
                .collect();
            let mean = points.iter().filter_map(|point| point.eta).sum::<f64>() / 6.0;
            runs.push(RunRow {
                key: RunKey {
                    campaign: "maps_a".into(),
                    machine: "turbo_a".into(),
                    method: name.into(),
                    seed,
                },
                campaign_sha256: "c".into(),
                model_sha256: "m".into(),
                failure: None,
                figures: BTreeMap::from([
                    (Metric::EtaMean, mean),
                    (Metric::EtaMedianError, (bias + method).abs()),
                ]),
                points,
            });
        }
    }
    Night {
        name: "maps".into(),
        started_ms: 1_700_000_000_000 + number * 86_400_000,
        duration_s: 20.0,
        program: "mapper 0".into(),
        accepted: false,
        runs,
    }
}

fn append(path: &Path, night: &Night) -> Comparison {
    History::open(path).unwrap().append(&mut night.clone(), NIGHTS).unwrap()
}

fn scratch() -> (tempfile::TempDir, std::path::PathBuf) {
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("runs").join("history.db");
    (scratch, path)
}

#[test]
fn equal_nights_are_quiet_and_a_model_that_moves_truth_too_is_caught_the_next_night_and_named() {
    let (_scratch, path) = scratch();
    assert_eq!(append(&path, &night(0, 0.0, 0.0)).nights, 0);
    assert!(append(&path, &night(1, 0.0, 0.0)).is_quiet());
    // 0.2 points of efficiency in the model: truth and result move alike, the error against truth stays.
    let caught = append(&path, &night(2, 0.002, 0.0));
    assert!(!caught.is_quiet());
    assert!(caught.moved.iter().any(|moved| moved.figure == Metric::EtaMean));
    assert!(caught.moved.iter().all(|moved| moved.figure != Metric::EtaMedianError), "{:?}", caught.moved);
    let conclusions = caught.conclusions.join("\n");
    assert!(conclusions.contains("maps_a: the true efficiency moved by +0.20 points"), "{conclusions}");
    assert!(conclusions.contains("the simulated machine or its model changed"), "{conclusions}");
    // It is reported every night until it is accepted or taken back, not only once.
    for number in 3..20 {
        assert!(!append(&path, &night(number, 0.002, 0.0)).is_quiet(), "night {number}");
    }
    assert!(append(&path, &night(20, 0.0, 0.0)).is_quiet());
}

#[test]
fn an_identification_that_moves_is_distinguished_from_a_model_that_moves() {
    let (_scratch, path) = scratch();
    append(&path, &night(0, 0.0, 0.0));
    let conclusions = append(&path, &night(1, 0.0, -0.002)).conclusions.join("\n");
    assert!(conclusions.contains("the identified efficiency moved by -0.20 points"), "{conclusions}");
    assert!(
        conclusions.contains("dynamic and steady") && conclusions.contains("the true one stayed"),
        "{conclusions}"
    );
}

#[test]
fn an_accepted_night_begins_a_new_band() {
    let (_scratch, path) = scratch();
    append(&path, &night(0, 0.0, 0.0));
    let accepted = Night { accepted: true, ..night(1, 0.002, 0.0) };
    assert!(!append(&path, &accepted).is_quiet(), "what moved is still reported");
    assert!(append(&path, &night(2, 0.002, 0.0)).is_quiet());
    assert!(!append(&path, &night(3, 0.0, 0.0)).is_quiet());
}

#[test]
fn failures_lost_runs_lost_points_and_other_nightlies_are_distinguished() {
    let (_scratch, path) = scratch();
    append(&path, &night(0, 0.0, 0.0));
    let other = Night { name: "others".into(), ..night(1, 0.1, 0.0) };
    assert_eq!(append(&path, &other).nights, 0, "nights of another name are not compared");

    let mut failed = night(1, 0.0, 0.0);
    failed.runs[0].failure = Some("stopped at 12 s: surge".into());
    failed.runs[0].points.clear();
    assert_eq!(append(&path, &failed).failed.len(), 1);

    let mut fewer = night(2, 0.0, 0.0);
    let lost = fewer.runs.remove(3).key;
    assert_eq!(append(&path, &fewer).missing, vec![lost]);

    let mut blind = night(3, 0.0, 0.0);
    blind.runs[1].points[2].eta = None;
    let lost = append(&path, &blind).moved_points;
    assert!(
        lost.iter().all(|moved| moved.moved == 1 && moved.compared == 6 && moved.largest.is_none()),
        "{lost:?}"
    );
    assert_eq!(lost.len(), 2, "efficiency and its error: {lost:?}");
    assert!(append(&path, &night(4, 0.0, 0.0)).is_quiet(), "odd nights are not part of the band");
}

#[test]
fn what_was_written_is_read_and_filtered() {
    let (_scratch, path) = scratch();
    for number in 0..3 {
        append(&path, &night(number, 0.0, 0.0));
    }
    let history = History::open_existing(&path).unwrap();
    let all = history.runs(&Filter::default()).unwrap();
    assert_eq!(all.len(), 12);
    let RunRow { points, .. } = night(0, 0.0, 0.0).runs[1].clone();
    assert_eq!(
        RunRow { points, ..all[1].run.clone() },
        night(0, 0.0, 0.0).runs[1],
        "seeds of 64 bits included"
    );
    let count = |filter| history.runs(&filter).unwrap().len();
    assert_eq!(count(Filter { method: Some("steady".into()), ..Filter::default() }), 6);
    assert_eq!(count(Filter { machine: Some("turbo_a".into()), ..Filter::default() }), 12);
    assert_eq!(count(Filter { machine: Some("maps_a".into()), ..Filter::default() }), 12);
    assert_eq!(count(Filter { machine: Some("unknown".into()), ..Filter::default() }), 0);
    assert_eq!(count(Filter { since_ms: Some(all[4].night.started_ms), ..Filter::default() }), 8);
}

#[test]
fn two_writers_at_once_lose_nothing() {
    let (_scratch, path) = scratch();
    std::thread::scope(|scope| {
        for writer in 0..4 {
            let path = &path;
            // Each opens for itself, as processes do; SQLite locks files, not threads.
            scope.spawn(move || {
                for number in 0..10 {
                    append(path, &night(10 * writer + number, 0.0, 0.0));
                }
            });
        }
    });
    let runs = History::open_existing(&path).unwrap().runs(&Filter::default()).unwrap();
    assert_eq!(runs.len(), 4 * 10 * 4);
    assert!(runs.iter().all(|run| !run.night.moved));
    assert_eq!(integrity(&path), "ok");
}

fn integrity(path: &Path) -> String {
    let connection = rusqlite::Connection::open(path).unwrap();
    connection.pragma_query_value(None, "integrity_check", |row| row.get(0)).unwrap()
}

#[test]
fn a_history_killed_in_mid_write_is_as_it_was() {
    let (scratch, path) = scratch();
    append(&path, &night(0, 0.0, 0.0));
    let mut connection = rusqlite::Connection::open(&path).unwrap();
    // So small a cache spills the unfinished transaction into the file: the worst that a kill can leave.
    connection.pragma_update(None, "cache_size", 1).unwrap();
    let transaction = connection.transaction().unwrap();
    transaction.execute("INSERT INTO night VALUES (77, 'maps', 0, 0, '', 0, 0)", []).unwrap();
    for run in 1000..3000 {
        transaction
            .execute("INSERT INTO run (id, night_id, campaign, machine, method, seed, campaign_sha256, model_sha256) VALUES (?1, 77, 'a', 'b', 'c', ?1, '', '')", [run])
            .unwrap();
    }
    // The files as a kill at this moment leaves them.
    let killed = scratch.path().join("killed.db");
    let before = std::fs::metadata(&path).unwrap().len();
    for end in ["", "-journal"] {
        let from = path.with_file_name(format!("history.db{end}"));
        std::fs::copy(&from, scratch.path().join(format!("killed.db{end}"))).unwrap();
    }
    // Two thousand rows are in the file already.
    assert!(before > 100_000, "nothing was spilled: {before} bytes");
    // Half a night is not read without a way to take it back.
    assert!(History::open_read_only(&killed).is_err());
    drop(transaction);
    let runs = History::open_existing(&killed).unwrap().runs(&Filter::default()).unwrap();
    assert_eq!(runs.len(), 4);
    assert_eq!(integrity(&killed), "ok");
    assert!(append(&killed, &night(1, 0.0, 0.0)).is_quiet());
}

/// A report is stored under the time of its night: the second of two that begin in one millisecond gets the next one.
#[test]
fn nights_of_one_millisecond_are_told_apart() {
    let (_scratch, path) = scratch();
    let mut history = History::open(&path).unwrap();
    let mut nights = [night(0, 0.0, 0.0), night(0, 0.0, 0.0), night(0, 0.0, 0.0)];
    nights.iter_mut().for_each(|night| drop(history.append(night, NIGHTS).unwrap()));
    let [first, second, third] = nights.map(|night| night.started_ms);
    assert_eq!((second, third), (first + 1, first + 2));
    let stored: std::collections::BTreeSet<i64> =
        history.runs(&Filter::default()).unwrap().iter().map(|run| run.night.started_ms).collect();
    assert_eq!(stored, [first, second, third].into());
}

/// In a directory without write permission, SQLite can make no side files.
#[test]
#[cfg(unix)]
fn a_history_that_cannot_be_written_is_read_and_refuses_a_night_beforehand() {
    use std::os::unix::fs::PermissionsExt as _;
    let (_scratch, path) = scratch();
    append(&path, &night(0, 0.0, 0.0));
    assert_eq!(History::open_read_only(&path).unwrap().runs(&Filter::default()).unwrap().len(), 4);
    let mode = |path: &Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    mode(&path, 0o444);
    mode(path.parent().unwrap(), 0o555);
    // Permissions do not bind root.
    let bound = std::fs::OpenOptions::new().write(true).open(&path).is_err();
    let read = History::open_existing(&path).and_then(|history| history.runs(&Filter::default()));
    let written = History::open(&path).map(drop);
    mode(path.parent().unwrap(), 0o755);
    assert_eq!(read.unwrap().len(), 4);
    assert!(!bound || matches!(written, Err(HistoryError::ReadOnly(_))), "{written:?}");
}

/// A file of a write-ahead log: reading needs no side files, and the next night removes the log.
#[test]
fn a_history_with_a_write_ahead_log_is_read_and_continued_without_it() {
    let (_scratch, path) = scratch();
    append(&path, &night(0, 0.0, 0.0));
    let mode = || -> String {
        let connection = rusqlite::Connection::open(&path).unwrap();
        connection.pragma_query_value(None, "journal_mode", |row| row.get(0)).unwrap()
    };
    assert_ne!(mode(), "wal", "it cannot be used on a network file system");
    rusqlite::Connection::open(&path).unwrap().pragma_update(None, "journal_mode", "WAL").unwrap();
    assert_eq!(mode(), "wal");
    assert_eq!(History::open_read_only(&path).unwrap().runs(&Filter::default()).unwrap().len(), 4);
    assert!(append(&path, &night(1, 0.0, 0.0)).is_quiet());
    assert_ne!(mode(), "wal");
}

#[test]
fn nights_before_are_counted_also_if_nothing_can_be_compared() {
    let (_scratch, path) = scratch();
    let failed = |number| {
        let mut night = night(number, 0.0, 0.0);
        night.runs.iter_mut().for_each(|run| run.failure = Some("no step is long enough".to_owned()));
        night
    };
    let counts = |comparison: Comparison| (comparison.stored_nights, comparison.nights);
    assert_eq!(counts(append(&path, &failed(0))), (0, 0));
    assert_eq!(counts(append(&path, &failed(1))), (1, 0));
    assert_eq!(counts(append(&path, &night(2, 0.0, 0.0))), (2, 0));
    assert_eq!(counts(append(&path, &night(3, 0.0, 0.0))), (3, 1));
    assert_eq!(counts(append(&path, &failed(4))), (4, 2));
}

#[test]
fn what_is_no_history_is_refused_and_left_alone() {
    let (scratch, path) = scratch();
    assert!(matches!(History::open_existing(&path), Err(HistoryError::Missing(_))));
    let text = scratch.path().join("notes.txt");
    std::fs::write(&text, "not a database, but long enough to be looked at as one, surely".repeat(20))
        .unwrap();
    assert!(matches!(History::open(&text), Err(HistoryError::Foreign { .. })));
    let other = scratch.path().join("other.db");
    rusqlite::Connection::open(&other).unwrap().execute_batch("CREATE TABLE things (x)").unwrap();
    assert!(matches!(History::open(&other), Err(HistoryError::Foreign { .. })));
    let newer = scratch.path().join("newer.db");
    append(&newer, &night(0, 0.0, 0.0));
    rusqlite::Connection::open(&newer).unwrap().pragma_update(None, "user_version", 99).unwrap();
    let Err(error) = History::open(&newer) else { panic!("a newer layout was opened") };
    assert!(error.to_string().contains("99"), "{error}");
}
