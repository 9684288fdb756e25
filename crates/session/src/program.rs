//! What the program is called.

/// What it was built from; empty where no git knew.
const COMMIT: &str = env!("MAPPER_COMMIT");

/// Name, version and commit, for people.
pub(crate) fn program_and_commit() -> String {
    match COMMIT {
        "" => PROGRAM.to_owned(),
        commit => format!("{PROGRAM}, commit {commit}"),
    }
}

/// Name and version of the program, as recordings carry it.
pub const PROGRAM: &str = concat!("mapper ", env!("CARGO_PKG_VERSION"));
