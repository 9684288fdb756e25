//! `cargo xtask docs`: generates documents with the program.

use crate::checks::lints;
use crate::error::Error;
use crate::files::{self, Mode, at, write};
use crate::step::{command, output, run, say};
use crate::workspace;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use xtask::constants;

/// Generated files and folders below docs.
const GENERATED: &[&str] = &[
    "images/plan.svg",
    "images/turbine.svg",
    "images/turbo_a.svg",
    "reference/campaign.md",
    "reference/cli.md",
    "reference/constants.md",
    "reference/sequences.md",
    "validation/real-data",
    "validation/reproduction",
    "validation/reproduction.md",
];

/// Pictures of the README and of the planner's page are made from this campaign.
const SHIPPED: &str = "campaigns/turbo_a.yaml";

/// The example that writes the pages of sequences and of campaigns.
const EXAMPLE: &str = "reference_docs";

/// Folder of the measured data that docs/validation/real-data.md describes, with the inputs of `mapper transient`.
const MEASURED: &str = "examples/real/turbotools";

/// Head of the page of commands.
const COMMAND_LINE_HEAD: &str = "\
# Command line

<!-- Generated from the program's own help by `cargo xtask docs`; do not edit. -->

`--json` prints one object on standard output for every command, failures included (`code`, `message`, `help`). Progress goes to
standard error, as JSON lines with `--progress json`. Ctrl-C brings the rig into its safe state at the end of the step and keeps the
measurements; press it again to stop immediately.
";

/// Builds the program, and writes or checks everything that is generated.
pub fn docs(mode: Mode) -> Result<(), Error> {
    build()?;
    generated(mode)
}

/// Writes or checks everything that is generated, with the program that has been built: a build would replace the one that tests run.
pub fn generated(mode: Mode) -> Result<(), Error> {
    // The documents are made in another directory and compared by content, independently of git.
    let made = workspace::target_dir().join("xtask-docs");
    let docs = workspace::root().join("docs");
    files::remove(&made)?;
    let programs = programs();
    // In parallel, because each uses one core.
    let (reproduced, others) = std::thread::scope(|scope| {
        let others = scope.spawn(|| {
            for page in ["sequences", "campaign"] {
                let text = output(command(&programs.reference_docs, &[page]))? + "\n";
                write(&made.join(format!("reference/{page}.md")), text)?;
            }
            write(&made.join("reference/cli.md"), command_line(&programs)?)?;
            let constants = constants::page(&workspace::root());
            let constants = constants.map_err(|violations| Error::Constants { violations })?;
            write(&made.join("reference/constants.md"), constants)?;
            mapped(&programs, &made)?;
            measured(&programs, &made)
        });
        let figures = made.join("validation");
        let reproduced = run(command(&programs.mapper, &["reproduce", "--out", &figures.to_string_lossy()]));
        (reproduced, others.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
    });
    reproduced?;
    others?;

    let (new, old) = (contents(&made)?, contents(&docs)?);
    let names: BTreeSet<&PathBuf> = new.keys().chain(old.keys()).collect();
    let mut differences = Vec::new();
    for name in names {
        let change = match (new.get(name), old.get(name)) {
            (Some(new), Some(old)) if new == old => continue,
            (Some(_), Some(_)) => "differs",
            (Some(_), None) => "is new",
            (None, _) => "is made no more",
        };
        differences.push(format!("docs/{} {change}", name.display()));
        let path = docs.join(name);
        match (mode, new.get(name)) {
            (Mode::Check, _) => {}
            (Mode::Write, Some(content)) => write(&path, content)?,
            (Mode::Write, None) => fs::remove_file(&path).map_err(at(&path))?,
        }
    }
    if differences.is_empty() {
        say("generated documents are up to date\n");
        return Ok(());
    }
    if mode == Mode::Check {
        return Err(Error::Stale { differences });
    }
    say(&format!("{}\n", differences.join("\n")));
    Ok(())
}

/// Help of every command.
fn command_line(programs: &Programs) -> Result<String, Error> {
    let pages = workspace::target_dir().join("xtask-docs-man");
    files::remove(&pages)?;
    output(command(&programs.mapper, &["man", "--out", &pages.to_string_lossy()]))?;
    // One manual page per command: mapper-gap-diagnose.1.
    let mut names = Vec::new();
    for page in files::entries(&pages)? {
        let name = page.file_name().unwrap_or_default().to_string_lossy();
        names.extend(name.strip_suffix(".1").map(|name| name.replace('-', " ")));
    }
    names.sort();
    let mut text = COMMAND_LINE_HEAD.to_owned();
    for name in names {
        let mut words: Vec<&str> = name.split(' ').skip(1).collect();
        words.push("--help");
        let mut help = command(&programs.mapper, &words);
        // Lines as on a terminal of 100 columns, independent of this terminal.
        let help = help.env("COLUMNS", "100").stdin(Stdio::null()).output();
        let help = help.map_err(|source| Error::Start { command: name.clone(), source })?.stdout;
        text.push_str(&format!(
            "\n## {name}\n\n```text\n{}\n```\n",
            String::from_utf8_lossy(&help).trim_end()
        ));
    }
    Ok(text)
}

/// The picture of the plan, and the maps of compressor and turbine, of the shipped campaign.
fn mapped(programs: &Programs, made: &Path) -> Result<(), Error> {
    let runs = workspace::target_dir().join("xtask-docs-runs");
    files::remove(&runs)?;
    fs::create_dir_all(made.join("images")).map_err(at(made))?;
    let plan = made.join("images/plan.svg");
    output(command(&programs.mapper, &["plan", SHIPPED, "--svg", &plan.to_string_lossy()]))?;
    run(command(&programs.mapper, &["run", SHIPPED, "--out", &runs.to_string_lossy()]))?;
    for run in files::entries(&runs)? {
        for (picture, image) in [("map.svg", "turbo_a.svg"), ("turbine_map.svg", "turbine.svg")] {
            let picture = run.join(picture);
            write(&made.join("images").join(image), &fs::read(&picture).map_err(at(&picture))?)?;
        }
    }
    Ok(())
}

/// Results of the program for measured data: text and picture.
fn measured(programs: &Programs, made: &Path) -> Result<(), Error> {
    let file = |name: &str| format!("{MEASURED}/{name}");
    let out = workspace::target_dir().join("xtask-docs-measured");
    files::remove(&out)?;
    let (log, channels, campaign) = (file("measured.csv"), file("channels.yaml"), file("campaign.yaml"));
    let given =
        ["transient", &log, "--channels", &channels, "--campaign", &campaign, "--fit-until", "13.2 s"];
    let shown = out.to_string_lossy().into_owned();
    run(command(&programs.mapper, &[&given[..], &["--out", &shown]].concat()))?;
    for name in ["transient.svg", "transient.txt"] {
        let path = out.join(name);
        write(&made.join("validation/real-data").join(name), &fs::read(&path).map_err(at(&path))?)?;
    }
    Ok(())
}

/// Programs that make documents.
struct Programs {
    mapper: PathBuf,
    reference_docs: PathBuf,
}

/// Builds them with the profile of the tests: results are identical in every profile, and most of the build usually exists already.
fn build() -> Result<(), Error> {
    // Names the whole workspace and one test, so that libraries have the same features as in the tests. With all tests, those that depend
    // on capabilities of the computer would be rebuilt.
    let arguments = [
        "build",
        "--locked",
        "--quiet",
        "--workspace",
        "--all-features",
        "--test",
        "reference_pages",
        "--bin",
        "mapper",
    ];
    let examples = ["--example", EXAMPLE];
    run(lints::linting(command(workspace::cargo(), &[&arguments[..], &examples].concat())))
}

fn programs() -> Programs {
    let built = workspace::target_dir().join("debug");
    let program = |name: &str| built.join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    Programs { mapper: program("mapper"), reference_docs: program(&format!("examples/{EXAMPLE}")) }
}

/// All generated files below a folder, by their path in it.
fn contents(root: &Path) -> Result<BTreeMap<PathBuf, Vec<u8>>, Error> {
    let mut contents = BTreeMap::new();
    for path in GENERATED.iter().map(|name| root.join(name)).filter(|path| path.exists()) {
        for file in if path.is_dir() { files::all_files(&path)? } else { vec![path] } {
            let content = fs::read(&file).map_err(at(&file))?;
            contents.insert(file.strip_prefix(root).unwrap_or(&file).to_owned(), content);
        }
    }
    Ok(contents)
}
