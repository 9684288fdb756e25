//! Helpers for the tests of the whole program: the built program, campaigns to run, Python scripts that check the results.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod campaign;
mod cluster;
mod drift_campaign;
mod program;
mod python;
mod shared_run;
pub mod tree;

pub use campaign::{CampaignFile, SHIPPED, SHORT_GRID, SINGLE_STEP_METHOD};
pub use cluster::Cluster;
pub use drift_campaign::DriftCampaign;
pub use program::{Finished, build_driver, build_drivers, mapper, mapper_command, mapper_in};
pub use python::python;
pub use shared_run::{SharedRun, shared_run};

use std::path::{Path, PathBuf};

/// Root of the repository.
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// A new directory that is removed with the returned value.
pub fn scratch() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary directory can be made")
}

/// A directory in the target folder for pictures that people inspect after a test. It remains until the next run of the test.
pub fn pictures(name: &str) -> PathBuf {
    let folder = repository().join("target/looked-at").join(name);
    std::fs::create_dir_all(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    folder
}

/// The directory of the only run below `parent`.
pub fn only_run(parent: &Path) -> PathBuf {
    let mut runs: Vec<PathBuf> = std::fs::read_dir(parent)
        .unwrap_or_else(|error| panic!("{}: {error}", parent.display()))
        .map(|entry| entry.unwrap().path())
        .collect();
    assert_eq!(runs.len(), 1, "{runs:?}");
    runs.remove(0)
}
