//! What manifests take out of the tests, since an empty test program is compiled and linked too, has nothing to test.

use cargo_metadata::{MetadataCommand, TargetKind};
use mapper_tests::tree::packages;
use std::path::{Path, PathBuf};

fn begins_a_test(line: &str) -> bool {
    let line = line.trim();
    line.starts_with("#[") && line.ends_with("test]") || line.starts_with("proptest!")
}

fn begins_an_example(line: &str) -> bool {
    let line = line.trim();
    ["///", "//!"]
        .iter()
        .any(|start| line.strip_prefix(start).is_some_and(|text| text.trim().starts_with("```")))
}

fn first_with<'a>(wanted: fn(&str) -> bool, files: &[&'a PathBuf]) -> Option<&'a Path> {
    let holds = |file: &&&PathBuf| std::fs::read_to_string(file).unwrap().lines().any(wanted);
    files.iter().find(holds).map(|file| file.as_path())
}

#[test]
fn what_is_left_out_of_the_tests_has_none() {
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
        // A program without a library has all files to itself.
        let has_library = of_kind(TargetKind::Lib).next().is_some();
        let of_programs = if has_library { programs } else { sources.files.iter().collect() };
        for (kind, files) in [(TargetKind::Lib, &library), (TargetKind::Bin, &of_programs)] {
            for target in of_kind(kind.clone()) {
                let test = first_with(begins_a_test, files).filter(|_| !target.test);
                assert_eq!(test, None, "take `test = false` out of {}", package.manifest_path);
                let examples = kind == TargetKind::Lib && !target.doctest;
                let example = first_with(begins_an_example, files).filter(|_| examples);
                assert_eq!(example, None, "take `doctest = false` out of {}", package.manifest_path);
                left_out += usize::from(!target.test);
            }
        }
    }
    assert!(left_out > 0, "nothing is left out any more");
}
