//! Errors of the libraries under the CLI.

use mapper_tests::repository;
use std::path::Path;

/// Crates whose errors the Python package, a live page and the CLI show.
const LIBRARIES: [&str; 7] = ["core", "fleet", "history", "live", "maps", "recording", "session"];

/// The CLI adds the command or option for the remedy, in its `output/failure.rs`; elsewhere there is none.
#[test]
fn no_error_names_a_command_or_an_option_of_the_cli() {
    let mut errors = 0;
    for library in LIBRARIES {
        check(&repository().join("crates").join(library).join("src"), &mut errors);
    }
    assert!(errors > 100, "{errors} errors were read");
}

fn check(folder: &Path, errors: &mut usize) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            check(&path, errors);
            continue;
        }
        let text = std::fs::read_to_string(&path).unwrap();
        for attribute in text.split("#[error(").skip(1) {
            let message = attribute.split(")]").next().unwrap();
            // An option of Cargo.
            let named = message.replace("`--features", "");
            assert!(!named.contains("`mapper ") && !named.contains("`--"), "{}: {message}", path.display());
            *errors += 1;
        }
    }
}
