//! Runs shared by several tests: the first test that needs a run makes it, and the others read it from the target folder.
//!
//! Each test is a process, so nothing in memory is shared. A test of the run itself makes its own run.

use crate::{CampaignFile, Finished, mapper_command, only_run, repository};
use serde_json::Value;
use std::fs;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::{Path, PathBuf};

/// A finished run; read only.
#[derive(Debug)]
pub struct SharedRun {
    /// Its directory.
    pub run: PathBuf,
    /// Its output with `--json`.
    pub result: Value,
    /// Its messages on standard error.
    pub stderr: String,
}

/// Runs the campaign, which must not refer to other files, or returns its earlier run by the same program. The run must succeed.
pub fn shared_run(campaign: &CampaignFile) -> SharedRun {
    let program = hash(|hasher| {
        let program = mapper_command([""; 0]).get_program().to_owned();
        let built = fs::metadata(&program).unwrap();
        (program, built.len(), built.modified().unwrap()).hash(hasher);
    });
    let all = repository().join("target/made-once");
    let folder = all.join(program).join(hash(|hasher| campaign.text.hash(hasher)));
    fs::create_dir_all(&all).unwrap();
    remove_others(&all, folder.parent().unwrap());
    fs::create_dir_all(&folder).unwrap();
    // Other tests wait until the run is complete.
    let lock = fs::File::create(folder.join("lock")).unwrap();
    lock.lock().unwrap();
    let (runs, printed, messages) =
        (folder.join("runs"), folder.join("printed.json"), folder.join("messages.txt"));
    // The output is written last, because it marks a complete run.
    if !printed.exists() {
        let _ = fs::remove_dir_all(&runs);
        let file = folder.join("campaign.yaml");
        fs::write(&file, &campaign.text).unwrap();
        let arguments =
            ["run".as_ref(), file.as_os_str(), "--json".as_ref(), "--out".as_ref(), runs.as_os_str()];
        let mut command = mapper_command(arguments);
        // Its own locks and lockouts.
        command.env("MAPPER_STATE_DIR", folder.join("states"));
        let finished = Finished::from(command.output().unwrap()).exits(0);
        fs::write(&messages, finished.stderr).unwrap();
        let unfinished = folder.join("printing.json");
        fs::write(&unfinished, finished.stdout).unwrap();
        fs::rename(&unfinished, &printed).unwrap();
    }
    SharedRun {
        run: only_run(&runs),
        result: serde_json::from_slice(&fs::read(&printed).unwrap()).unwrap(),
        stderr: fs::read_to_string(&messages).unwrap(),
    }
}

fn hash(of: impl FnOnce(&mut DefaultHasher)) -> String {
    let mut hasher = DefaultHasher::new();
    of(&mut hasher);
    format!("{:016x}", hasher.finish())
}

/// Removes the results of earlier programs.
fn remove_others(all: &Path, ours: &Path) {
    for entry in fs::read_dir(all).unwrap().flatten().filter(|entry| entry.path() != ours) {
        // Another test may remove it at the same time.
        let _ = fs::remove_dir_all(entry.path());
    }
}
