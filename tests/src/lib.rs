//! Helpers for the tests of the whole program: the built program, campaigns to run, Python scripts that check the results.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod campaign;
mod cluster;
mod drift_campaign;
mod made_once;
mod program;
mod python;
pub mod tree;

pub use campaign::{BY_ITSELF, CampaignFile, SHIPPED, SHORT_GRID};
pub use cluster::Cluster;
pub use drift_campaign::DriftCampaign;
pub use made_once::{MadeOnce, made_once};
pub use program::{Finished, build_driver, build_drivers, mapper, mapper_command, mapper_in};
pub use python::python;

use std::path::{Path, PathBuf};

/// Root of the repository.
pub fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap().to_owned()
}

/// A new directory that is removed with the returned value.
pub fn scratch() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary directory can be made")
}

/// A directory for pictures that people look at after a test; it stays, below the target folder, until the next run of that test.
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
