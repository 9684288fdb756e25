//! Gives the program the commit it is built from, if git knows it.

use std::path::Path;
use std::process::Command;

fn git(arguments: &[&str]) -> Option<String> {
    let output =
        Command::new("git").args(arguments).output().ok().filter(|output| output.status.success())?;
    Some(String::from_utf8(output.stdout).ok()?.trim().to_owned())
}

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    // Of this tree, not of one that it has been copied into.
    let repository = git(&["rev-parse", "--show-toplevel"])
        .filter(|top| Path::new(top).join("crates/cli/build.rs").is_file());
    let commit = repository.and_then(|_| git(&["rev-parse", "--short=12", "HEAD"]));
    // Written with every commit; a file that is not there would build again each time.
    if let Some(log) = git(&["rev-parse", "--git-path", "logs/HEAD"]).filter(|log| Path::new(log).is_file()) {
        println!("cargo::rerun-if-changed={log}");
    }
    println!("cargo::rustc-env=MAPPER_COMMIT={}", commit.unwrap_or_default());
}
