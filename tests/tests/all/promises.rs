//! Promises of ARCHITECTURE.md: what is added by one file and one line. Each is kept as a patch in `tests/promises`, put into
//! a copy of the tree, counted, built, and seen in the program.

use mapper_tests::{repository, scratch};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;

/// What a patch adds, and how the program shows that it has it.
struct Promise {
    /// File in `tests/promises`.
    patch: &'static str,
    /// Arguments of the program, and a word that it prints with the patch and does not print without.
    shown_by: (&'static [&'static str], &'static str),
}

/// Placeholder for a campaign with an unknown backend.
const ELSEWHERE: &str = "ELSEWHERE";

const PROMISES: &[Promise] = &[
    Promise { patch: "effect.patch", shown_by: (&["gap", "effects"], "seal_friction") },
    // A name that is not known is answered with those that are.
    Promise {
        patch: "format.patch",
        shown_by: (&["map", "convert", "campaigns/turbo_a.yaml", "x.unknown"], "names (.names)"),
    },
    Promise {
        patch: "command.patch",
        shown_by: (&["--help"], "List the quantities that a recording may hold"),
    },
    Promise { patch: "backend.patch", shown_by: (&["check", ELSEWHERE], "empty_cell") },
];

/// What git says of a patch: lines added and removed, by file.
fn changes(patch: &Path) -> BTreeMap<String, (usize, usize)> {
    let listed = git(&repository(), ["apply".as_ref(), "--numstat".as_ref(), patch.as_os_str()]);
    let change = |line: &str| {
        let mut columns = line.split('\t');
        let mut number = || columns.next().unwrap().parse().unwrap();
        let counts = (number(), number());
        (columns.next().unwrap().to_owned(), counts)
    };
    listed.lines().map(change).collect()
}

fn git<'a>(directory: &Path, arguments: impl IntoIterator<Item = &'a std::ffi::OsStr>) -> String {
    let output = Command::new("git")
        .args(arguments)
        .current_dir(directory)
        .output()
        .unwrap_or_else(|error| panic!("git: {error}"));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn each_promised_extension_needs_one_file_and_one_line() {
    for Promise { patch, .. } in PROMISES {
        let changes = changes(&repository().join("tests/promises").join(patch));
        let (new, old): (Vec<_>, Vec<_>) =
            changes.iter().partition(|(file, _)| !repository().join(file).exists());
        assert_eq!(new.len(), 1, "{patch}: one new file, not {new:?}");
        assert_eq!(old.len(), 1, "{patch}: one file that is there, not {old:?}");
        assert_eq!(*old[0].1, (1, 0), "{patch}: one line is added to {}", old[0].0);
    }
}

/// A copy of the tree with all patches, kept from run to run: only what differs is written, so that only that is built. What is
/// not patched has the times of the tree, so that its libraries are those that the tests have; what is patched has a version of
/// its own, so that it does not take their place.
fn patched_tree() -> PathBuf {
    let (root, tree) = (repository(), target().join("promises/tree"));
    // The files that patches change, apart, so that their times in the copy stay.
    let changed = scratch();
    let inside = changed.path();
    for Promise { patch, .. } in PROMISES {
        let patch = root.join("tests/promises").join(patch);
        for file in changes(&patch).keys() {
            let (from, to) = (root.join(file), inside.join(file));
            if from.exists() && !to.exists() {
                std::fs::create_dir_all(to.parent().unwrap()).unwrap();
                std::fs::copy(from, to).unwrap();
            }
        }
        // A line of context on each side: what others change nearby does not matter.
        git(inside, ["apply".as_ref(), "-C1".as_ref(), patch.as_os_str()]);
    }
    for package in patched() {
        let manifest = std::fs::read_to_string(root.join(&package).join("Cargo.toml")).unwrap();
        let shared = "version.workspace = true\n";
        assert_eq!(manifest.matches(&format!("\n{shared}")).count(), 1, "{package}");
        let own = manifest.replacen(&format!("\n{shared}"), "\nversion = \"0.1.0-promised\"\n", 1);
        std::fs::write(inside.join(&package).join("Cargo.toml"), own).unwrap();
    }
    let mut wanted: BTreeMap<PathBuf, PathBuf> = BTreeMap::new();
    let listed = git(&root, ["ls-files", "--cached", "--others", "--exclude-standard"].map(AsRef::as_ref));
    for file in listed.lines().filter(|file| root.join(file).is_file()) {
        wanted.insert(file.into(), root.join(file));
    }
    for file in files_below(inside) {
        wanted.insert(file.strip_prefix(inside).unwrap().to_owned(), file.clone());
    }
    for (file, from) in &wanted {
        let (to, content) = (tree.join(file), std::fs::read(from).unwrap());
        if std::fs::read(&to).ok().as_ref() != Some(&content) {
            std::fs::create_dir_all(to.parent().unwrap()).unwrap();
            std::fs::write(&to, content).unwrap();
        }
        if !from.starts_with(inside) {
            let time = |path: &Path| path.metadata().unwrap().modified().unwrap();
            if time(&to) != time(from) {
                std::fs::File::options().append(true).open(&to).unwrap().set_modified(time(from)).unwrap();
            }
        }
    }
    for file in files_below(&tree) {
        if !wanted.contains_key(file.strip_prefix(&tree).unwrap()) {
            std::fs::remove_file(file).unwrap();
        }
    }
    remove_empty_folders(&tree);
    tree
}

/// Folders of the packages that are patched.
fn patched() -> BTreeSet<String> {
    let files = PROMISES.iter().flat_map(|Promise { patch, .. }| {
        changes(&repository().join("tests/promises").join(patch)).into_keys()
    });
    files.map(|file| file.split_once("/src/").unwrap().0.to_owned()).collect()
}

/// What a folder is left with when its last file has gone would still be a crate to Cargo.
fn remove_empty_folders(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            remove_empty_folders(&path);
            // Fails where it is not empty, as it should.
            let _ = std::fs::remove_dir(&path);
        }
    }
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten() {
        let path = entry.unwrap().path();
        if path.is_dir() { files.extend(files_below(&path)) } else { files.push(path) }
    }
    files
}

/// The build directory of this test's own program: below it everything may be written.
fn target() -> PathBuf {
    let own = std::env::current_exe().unwrap();
    own.ancestors()
        .find(|folder| folder.ends_with("target"))
        .map_or_else(|| repository().join("target"), Path::to_owned)
}

#[test]
fn the_promised_extensions_compile_and_are_listed() {
    let tree = patched_tree();
    let programs = target().join("promises/programs");
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    // Variables that describe the package of a test: build scripts that look at them would make their libraries again, here and with
    // the next command outside.
    for (name, _) in std::env::vars_os() {
        let text = name.to_string_lossy();
        if text == "OUT_DIR" || ["CARGO_PKG_", "CARGO_MANIFEST_"].iter().any(|start| text.starts_with(start))
        {
            cargo.env_remove(&name);
        }
    }
    let built = cargo
        // One small test as well: with it libraries have the features that all tests gave them, and none of them is built
        // again but what is patched and what uses that.
        .args(["build", "--quiet", "--offline", "--workspace", "--all-features"])
        .args(["--bin", "mapper", "--test", "xls"])
        // What is built again here only answers questions about itself.
        .args(
            ["backends", "effects"]
                .map(|name| format!("--config=profile.dev.package.mapper-{name}.opt-level=0")),
        )
        .env("CARGO_BUILD_BUILD_DIR", target())
        .env("CARGO_TARGET_DIR", &programs)
        .current_dir(&tree)
        .output()
        .unwrap();
    assert!(built.status.success(), "{}", String::from_utf8_lossy(&built.stderr));
    let scratch = scratch();
    let elsewhere = scratch.path().join("elsewhere.yaml");
    let campaign = std::fs::read_to_string(repository().join("campaigns/turbo_a.yaml")).unwrap();
    std::fs::write(&elsewhere, campaign.replace("virtual_lab: {}", "nowhere: {}")).unwrap();
    for Promise { patch, shown_by: (arguments, word) } in PROMISES {
        let shown = |mut program: Command| {
            let arguments = arguments.iter().map(|argument| match *argument {
                ELSEWHERE => elsewhere.as_os_str(),
                argument => argument.as_ref(),
            });
            let output = program.args(arguments).current_dir(&tree).output().unwrap();
            let printed = [output.stdout, output.stderr].concat();
            String::from_utf8_lossy(&printed).contains(word)
        };
        let with = programs.join("debug").join(format!("mapper{}", std::env::consts::EXE_SUFFIX));
        assert!(shown(Command::new(with)), "{patch}: the program does not print `{word}`");
        let without = mapper_tests::mapper_command::<&str>([]);
        assert!(!shown(without), "{patch}: the program prints `{word}` without it");
    }
}
