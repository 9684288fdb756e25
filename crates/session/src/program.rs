//! What the program is called.

/// Name and version of the program, as recordings carry it.
pub const PROGRAM: &str = concat!("mapper ", env!("CARGO_PKG_VERSION"));

/// Name, version and commit, for people. `commit`: empty where nobody knows it.
pub fn program_and_commit(commit: &str) -> String {
    match commit {
        "" => PROGRAM.to_owned(),
        commit => format!("{PROGRAM}, commit {commit}"),
    }
}
