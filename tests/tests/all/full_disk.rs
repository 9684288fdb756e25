//! A disk that fills up in the middle of a run: a small tmpfs in a mount name space of its own, gone with the process.

use crate::fleet::{fleet, make, write_study};
use mapper_tests::{
    CampaignFile, Finished, SHORT_GRID, SINGLE_STEP_METHOD, mapper, mapper_command, only_run, scratch,
};
use std::process::Command;

/// Mounts $SIZE (2 MB if none is given) on $1, runs the rest there, and keeps what was written in $2.
const SCRIPT: &str = r#"
disk="$1"; kept="$2"; shift 2
mount -t tmpfs -o size="${SIZE:-2m}" tmpfs "$disk" || exit 99
"$@"; code=$?
cp -r "$disk"/. "$kept" || exit 98
exit $code
"#;

#[test]
#[cfg_attr(not(with_tmpfs), ignore = "mounts a small tmpfs: run `cargo xtask test` as root")]
fn a_full_disk_is_reported_and_the_flushed_data_are_readable() {
    // Without the rest at the start, which alone would fill the disk.
    let replacements: Vec<_> = SHORT_GRID.iter().chain(SINGLE_STEP_METHOD).copied().collect();
    let campaign = CampaignFile::shipped_with(&replacements);
    let (disk, kept) = (campaign.directory().join("disk"), campaign.directory().join("kept"));
    std::fs::create_dir(&disk).unwrap();
    std::fs::create_dir(&kept).unwrap();
    let run = mapper_command(["run".as_ref(), campaign.path.as_os_str(), "--out".as_ref(), disk.as_os_str()]);
    let output = Command::new("unshare")
        .args(["--mount", "sh", "-c", SCRIPT, "sh"])
        .args([&disk, &kept])
        .arg(run.get_program())
        .args(run.get_args())
        .current_dir(mapper_tests::repository())
        .output()
        .unwrap();
    let finished = Finished::from(output).exits(1);
    let written_to = disk.join(only_run(&kept).file_name().unwrap()).join("recording.mcap");
    assert!(finished.stderr.contains(written_to.to_str().unwrap()), "{}", finished.stderr);
    assert!(finished.stderr.contains("No space left on device"), "{}", finished.stderr);

    // 2 MB hold some 400 s: three of the four steps.
    let run = only_run(&kept);
    let result = mapper(["identify".as_ref(), run.as_os_str(), "--json".as_ref()]).exits(0).json();
    let points = result["points"].as_array().unwrap();
    assert!(points.len() >= 2, "{} points", points.len());
    assert!(points[1]["eta"].is_f64(), "{}", points[1]);
}

/// A disk that is full only when the page is written: the table is shown, the run is whole, and the command in the message finishes it.
#[test]
#[cfg_attr(not(with_tmpfs), ignore = "mounts a small tmpfs: run `cargo xtask test` as root")]
fn a_disk_that_fills_up_at_the_page_loses_only_the_page() {
    let replacements: Vec<_> = SHORT_GRID.iter().chain(SINGLE_STEP_METHOD).copied().collect();
    let campaign = CampaignFile::shipped_with(&replacements);
    let runs = campaign.runs();
    mapper(["run".as_ref(), campaign.path.as_os_str(), "--out".as_ref(), runs.as_os_str()]).exits(0);
    // tmpfs gives out pages of 4 KiB; a directory, and the file that is written aside, take some more.
    let pages = |bytes: u64| bytes.div_ceil(4096) * 4096;
    let (mut all, mut page) = (0, 0);
    for entry in std::fs::read_dir(only_run(&runs)).unwrap().flatten() {
        let bytes = pages(entry.metadata().unwrap().len());
        all += bytes;
        page += if entry.file_name() == "report.html" { bytes } else { 0 };
    }
    let (disk, kept) = (campaign.directory().join("disk"), campaign.directory().join("kept"));
    std::fs::create_dir(&disk).unwrap();
    std::fs::create_dir(&kept).unwrap();
    let run = mapper_command(["run".as_ref(), campaign.path.as_os_str(), "--out".as_ref(), disk.as_os_str()]);
    let output = Command::new("unshare")
        .args(["--mount", "sh", "-c", SCRIPT, "sh"])
        .args([&disk, &kept])
        .arg(run.get_program())
        .args(run.get_args())
        .env("SIZE", (all - page / 2).to_string())
        .current_dir(mapper_tests::repository())
        .output()
        .unwrap();
    let finished = Finished::from(output).exits(1);
    assert!(finished.stdout.contains("krpm"), "no table: {}", finished.stdout);
    assert!(finished.stderr.contains("--resume"), "{}", finished.stderr);
    let run = only_run(&kept);
    assert!(!run.join("report.html").exists(), "half a page under its name");
    mapper(["run".as_ref(), "--resume".as_ref(), run.as_os_str()]).exits(0);
    assert!(run.join("report.html").exists());
    // A second merge has nothing to do.
    mapper(["run".as_ref(), "--resume".as_ref(), run.as_os_str()]).exits(4);
}

/// Fills the disk $1 after a first night, then starts a second night and reads the history.
const FULL_NIGHT: &str = r#"
disk="$1"; mapper="$2"; nightly="$3"
mount -t tmpfs -o size=200k tmpfs "$disk" || exit 99
"$mapper" nightly "$nightly" --db "$disk/history.db" --progress off >/dev/null || exit 98
[ "$4" = wal ] && { python3 -c 'import sqlite3, sys; sqlite3.connect(sys.argv[1]).execute("pragma journal_mode=wal")' "$disk/history.db" || exit 96; }
dd if=/dev/zero of="$disk/fill" bs=1k count=400 2>/dev/null
"$mapper" nightly "$nightly" --db "$disk/history.db" --progress off >/dev/null; [ $? = 1 ] || exit 97
"$mapper" history --db "$disk/history.db" --json
"#;

/// A full disk is named before the runs of a night, and what is in the history can be read: also in one with a write-ahead log.
#[test]
#[cfg_attr(not(with_tmpfs), ignore = "mounts a small tmpfs: run `cargo xtask test` as root")]
fn a_history_on_a_full_disk_is_read_and_the_disk_is_named() {
    for mode in ["delete", "wal"] {
        let scratch = scratch();
        crate::nightly::write_shipped_nightly(scratch.path());
        let disk = scratch.path().join("disk");
        std::fs::create_dir(&disk).unwrap();
        let output = Command::new("unshare")
            .args(["--mount", "sh", "-c", FULL_NIGHT, "sh"])
            .arg(&disk)
            .arg(mapper_command(["--version"]).get_program())
            .arg(scratch.path().join("nightly.yaml"))
            .arg(mode)
            .output()
            .unwrap();
        let finished = Finished::from(output).exits(0);
        assert!(finished.stderr.contains(disk.to_str().unwrap()), "{mode}: {}", finished.stderr);
        assert!(finished.stderr.contains("full"), "{mode}: {}", finished.stderr);
        assert_eq!(finished.json()["runs"].as_array().unwrap().len(), 2, "{mode}");
    }
}

/// Mounts 16 kB on $1, runs the rest, and copies what was written there to $2.
const PARTS: &str = r#"
parts="$1"; kept="$2"; shift 2
mount -t tmpfs -o size=16k tmpfs "$parts" || exit 99
"$@"; code=$?
cp -r "$parts"/. "$kept" || exit 98
exit $code
"#;

/// The task says where there was no room; what it had written is whole, the rest is made by another task, and the result is that of
/// one machine.
#[test]
#[cfg_attr(not(with_tmpfs), ignore = "mounts a small tmpfs: run `cargo xtask test` as root")]
fn a_full_disk_fails_one_task_of_a_fleet() {
    let scratch = scratch();
    let folder = scratch.path();
    let study = write_study(folder, 3);
    let (here, there, kept) = (folder.join("here"), folder.join("there"), folder.join("kept"));
    make(&study, &here);
    make(&study, &there);
    std::fs::create_dir(&kept).unwrap();
    let parts = there.join("parts");
    let work = mapper_command(fleet("work", &there, &["--shard", "1/1"]));
    let output = Command::new("unshare")
        .args(["--mount", "sh", "-c", PARTS, "sh"])
        .args([&parts, &kept])
        .arg(work.get_program())
        .args(work.get_args())
        .current_dir(mapper_tests::repository())
        .output()
        .unwrap();
    let finished = Finished::from(output).exits(1);
    assert!(finished.stderr.contains("No space left on device"), "{}", finished.stderr);
    assert!(finished.stderr.contains(parts.to_str().unwrap()), "{}", finished.stderr);
    for entry in kept.read_dir().unwrap() {
        let entry = entry.unwrap();
        std::fs::copy(entry.path(), parts.join(entry.file_name())).unwrap();
    }
    let status = mapper(fleet("status", &there, &["--json"])).exits(0).json();
    let missing = status["status"]["missing"].as_array().unwrap().len();
    assert!((1..6).contains(&missing), "{status}");
    assert_eq!(status["status"]["refused"].as_array().unwrap().len(), 0, "{status}");
    mapper(fleet("merge", &there, &[])).exits(8);
    for directory in [&here, &there] {
        mapper(fleet("run", directory, &[])).exits(0);
    }
    let result = |directory: &std::path::Path| std::fs::read(directory.join("result/runs.json")).unwrap();
    assert!(result(&here) == result(&there), "the result is that of one machine");
}

/// A limit of memory that a run would exceed is named beforehand, in one line: a computer that refuses memory ends a program where it stands.
#[cfg(target_os = "linux")]
#[test]
fn a_limit_of_memory_is_reported_in_one_line() {
    let campaign = CampaignFile::shipped_with(SHORT_GRID);
    let run =
        mapper_command(["run".as_ref(), campaign.path.as_os_str(), "--progress".as_ref(), "off".as_ref()]);
    let output = Command::new("sh")
        .args(["-c", "ulimit -v 400000; exec \"$@\"", "sh"])
        .arg(run.get_program())
        .args(run.get_args())
        .current_dir(campaign.directory())
        .output()
        .unwrap();
    let finished = Finished::from(output).exits(1);
    assert_eq!(finished.stderr.lines().count(), 1, "{}", finished.stderr);
    assert!(!campaign.runs().exists());
}
