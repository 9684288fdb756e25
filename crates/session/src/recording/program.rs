//! Name and version of the program.

/// Name and version of the program, as recordings carry it.
pub const PROGRAM: &str = concat!("mapper ", env!("CARGO_PKG_VERSION"));

/// Name, version and commit, for people. `commit`: empty if unknown.
pub fn program_and_commit(commit: &str) -> String {
    match commit {
        "" => PROGRAM.to_owned(),
        commit => format!("{PROGRAM}, commit {commit}"),
    }
}
