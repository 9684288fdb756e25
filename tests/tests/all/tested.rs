//! What manifests take out of the tests has nothing to test: an empty test program is compiled and linked too, and files that are one
//! program are all in it.

use cargo_metadata::{MetadataCommand, TargetKind};
use mapper_tests::tree::packages;
use std::path::{Path, PathBuf};

fn begins_a_test(line: &str) -> bool {
    let line = line.trim();
    line.starts_with("#[") && line.ends_with("test]") || line.starts_with("proptest!")
}

fn first_test<'a>(files: &[&'a PathBuf]) -> Option<&'a Path> {
    let holds = |file: &&&PathBuf| std::fs::read_to_string(file).unwrap().lines().any(begins_a_test);
    files.iter().find(holds).map(|file| file.as_path())
}

#[test]
fn targets_without_tests_have_no_test() {
    let manifest = mapper_tests::repository().join("Cargo.toml");
    let metadata = MetadataCommand::new().manifest_path(manifest).no_deps().exec().unwrap();
    let mut left_out = 0;
    for sources in packages() {
        let folder = mapper_tests::repository().join(&sources.folder);
        let of_folder = |package: &&cargo_metadata::Package| package.manifest_path.starts_with(&folder);
        let package = metadata.packages.iter().find(of_folder).unwrap();
        let of_kind = |kind: TargetKind| package.targets.iter().filter(move |one| one.kind.contains(&kind));
        let programs: Vec<&Path> = of_kind(TargetKind::Bin).map(|one| one.src_path.as_std_path()).collect();
        let (programs, library): (Vec<&PathBuf>, Vec<&PathBuf>) =
            sources.files.iter().partition(|file| programs.contains(&file.as_path()));
        // Without a library, all files belong to the program.
        let has_library = of_kind(TargetKind::Lib).next().is_some();
        let of_programs = if has_library { programs } else { sources.files.iter().collect() };
        for (kind, files) in [(TargetKind::Lib, &library), (TargetKind::Bin, &of_programs)] {
            for target in of_kind(kind.clone()) {
                let test = first_test(files).filter(|_| !target.test);
                assert_eq!(test, None, "take `test = false` out of {}", package.manifest_path);
                // The tests of the documentation also make it, with warnings denied.
                let documented = kind == TargetKind::Bin || target.doctest;
                assert!(documented, "take `doctest = false` out of {}", package.manifest_path);
                left_out += usize::from(!target.test);
            }
        }
    }
    assert!(left_out > 0, "nothing is left out any more");
}

/// With `autotests = false` Cargo takes no file in `tests` for a program: a file that `all.rs` does not declare would never run.
#[test]
fn every_test_file_is_in_the_test_program_of_its_crate() {
    let manifest = mapper_tests::repository().join("Cargo.toml");
    let metadata = MetadataCommand::new().manifest_path(manifest).no_deps().exec().unwrap();
    let mut joined = 0;
    for package in &metadata.packages {
        let programs: Vec<&Path> = package
            .targets
            .iter()
            .filter(|one| one.kind.contains(&TargetKind::Test))
            .map(|one| one.src_path.as_std_path())
            .collect();
        let all = package.manifest_path.as_std_path().with_file_name("tests").join("all.rs");
        let text = if programs.contains(&all.as_path()) {
            std::fs::read_to_string(&all).unwrap()
        } else {
            String::new()
        };
        let files = all.parent().unwrap().read_dir().into_iter().flatten().map(|entry| entry.unwrap().path());
        for file in files.filter(|file| file.extension().is_some_and(|extension| extension == "rs")) {
            let declared = format!("mod {};", file.file_stem().unwrap().to_str().unwrap());
            let is_program = programs.contains(&file.as_path());
            let is_inside = text.lines().any(|line| line == declared);
            assert!(
                is_program || is_inside,
                "write `{declared}` into {}: {} is in no program",
                all.display(),
                file.display()
            );
            joined += usize::from(is_inside);
        }
    }
    assert!(joined > 0, "no test files are joined any more");
}
