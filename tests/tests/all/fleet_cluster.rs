//! A fleet on a real scheduler: tasks killed, items that fail once, the controller restarted; the result of one machine.

use crate::fleet::{fleet, make, write_study};
use mapper_tests::{Cluster, Finished, mapper_command, scratch};
use std::path::Path;
use std::process::Command;

fn on(cluster: &Cluster, arguments: Vec<&str>) -> Finished {
    cluster.on(mapper_command(arguments)).output().unwrap().into()
}

/// Who has begun an item in `directory` and not ended it.
fn under_way(directory: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(directory.join("begun")).into_iter().flatten().flatten();
    let part = |hash: std::ffi::OsString| directory.join("parts").join(hash).with_extension("part");
    entries
        .filter(|entry| !part(entry.file_name()).exists())
        .filter_map(|entry| std::fs::read_to_string(entry.path()).ok())
        .collect()
}

/// Whether the process `id` has begun an item in `directory` and not ended it.
fn holds_an_item(directory: &Path, id: &str) -> bool {
    under_way(directory).iter().any(|who| who.contains(&format!("process {id} ")))
}

/// Ids of the processes that work on an item in `directory` now.
fn workers(directory: &Path) -> Vec<String> {
    let wanted = format!("fleet\0work\0{}\0", directory.display());
    let entries = std::fs::read_dir("/proc").unwrap().flatten();
    let ids = entries.map(|entry| entry.file_name().to_string_lossy().into_owned());
    ids.filter(|id| {
        std::fs::read(format!("/proc/{id}/cmdline"))
            .is_ok_and(|line| String::from_utf8_lossy(&line).contains(&wanted))
            && holds_an_item(directory, id)
    })
    .collect()
}

#[test]
#[cfg_attr(not(with_slurm), ignore = "runs Slurm as root: run `cargo xtask test` as root")]
fn killed_and_failed_items_are_reported_and_retried() {
    let scratch = scratch();
    let folder = scratch.path().canonicalize().unwrap();
    let study = write_study(&folder, 12);
    let (here, there) = (folder.join("here"), folder.join("there"));
    make(&study, &here);
    make(&study, &there);
    let mut cluster = Cluster::start(&folder.join("slurm"));

    // What does not fit is not submitted.
    let refused = on(&cluster, fleet("submit", &there, &["--slurm", "--hours", "0.00001"])).exits(3);
    assert!(refused.stderr.contains("processor hours"), "{}", refused.stderr);
    // Two items without room for their recordings.
    let list = mapper_command(fleet("status", &there, &["--items", "--json"])).output().unwrap();
    let list = Finished::from(list).json();
    let parts = |hash: &str| there.join(format!("parts/{hash}.part")).exists();
    let hashes = list["items"].as_array().unwrap().iter().map(|item| item["hash"].as_str().unwrap());
    let unlucky: Vec<&str> = hashes.filter(|hash| !parts(hash)).take(2).collect();
    for hash in &unlucky {
        let work = fleet("work", &there, &["--item", hash]);
        let finished = mapper_command(work).env("TMPDIR", "/nowhere").output().unwrap();
        Finished::from(finished).exits(8);
    }

    let limits = ["--slurm", "--task", "0.02", "--array-limit", "12", "--json"];
    let sent = on(&cluster, fleet("submit", &there, &limits)).exits(0).json();
    assert!((3..=12).contains(&sent["tasks"].as_u64().unwrap()), "{sent}");
    let mut killed: Vec<String> = Vec::new();
    while killed.len() < 3 {
        cluster.wait_for("worker", || workers(&there).iter().any(|id| !killed.contains(id)));
        let Some(id) = workers(&there).into_iter().find(|id| !killed.contains(id)) else { continue };
        // The one process, by its own id. One that was killed between two items loses none.
        let killed_it = Command::new("kill").args(["-9", &id]).status().unwrap().success();
        if !killed_it || !holds_an_item(&there, &id) {
            continue;
        }
        killed.push(id);
        if killed.len() == 2 {
            cluster.restart_controller();
        }
    }
    let done = |cluster: &Cluster| cluster.ask("squeue", &["-h"]).trim().is_empty();
    cluster.wait_for("empty queue", || done(&cluster));

    let merge_log = there.join(format!("log/merge-{}.txt", sent["merge"].as_str().unwrap()));
    let merged = std::fs::read_to_string(&merge_log).unwrap();
    assert_eq!(merged.matches("failed: nightly_a").count(), 2, "{merged}");
    assert!(merged.contains("missing: nightly_a") && merged.contains("nothing merged"), "{merged}");
    let status = on(&cluster, fleet("status", &there, &["--json"])).exits(0).json();
    let lost = status["status"]["missing"].as_array().unwrap();
    assert!(lost.len() >= 3, "at least what was under way when {killed:?} were killed: {lost:?}");

    let again = on(&cluster, fleet("retry", &there, &["--json"])).exits(0).json();
    assert_ne!(again["work"], sent["work"]);
    cluster.wait_for("empty queue", || done(&cluster));
    let merged =
        std::fs::read_to_string(there.join(format!("log/merge-{}.txt", again["merge"].as_str().unwrap())))
            .unwrap();
    assert!(merged.contains("merged 24 of 24 items"), "{merged}");
    on(&cluster, fleet("retry", &there, &[])).exits(3);

    Finished::from(mapper_command(fleet("run", &here, &[])).output().unwrap()).exits(0);
    let result = |directory: &Path| std::fs::read(directory.join("result/runs.json")).unwrap();
    assert!(result(&here) == result(&there), "the result of a cluster is that of one machine");
}
