//! Checks the documentation: links, commands, campaigns, warning codes, and length.

use mapper_core::EventKind;
use mapper_recording::{ReadOptions, read_marks};
use mapper_tests::{CampaignFile, mapper_in, repository, scratch, shared_run};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Pages below docs that a program writes, and the table of contents: not counted as prose.
const NOT_PROSE: [&str; 12] = [
    "SUMMARY.md",
    "reference/campaign.md",
    "reference/cli.md",
    "reference/constants.md",
    "reference/sequences.md",
    "validation/coverage.md",
    "validation/drift_orders.md",
    "validation/identification.md",
    "validation/orders.md",
    "validation/performance.md",
    "validation/reproduction.md",
    "validation/turbine.md",
];
/// Limit of all other pages together, the tables for developers included: an engineer reads them in three hours.
const MAX_WORDS: usize = 37_400;
/// Limit of a page that explains.
const MAX_WORDS_OF_EXPLANATION: usize = 1_500;

/// Markdown of the repository: the pages of docs, and those of the folders above and next to it.
fn pages() -> Vec<PathBuf> {
    let root = repository();
    let mut found = Vec::new();
    below(&root.join("docs"), &mut found);
    for folder in ["", "python", "benches/peers", "crates/physics/tests/reference"] {
        let entries = fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap().path());
        found.extend(entries.filter(|path| is_page(path)));
    }
    found.sort();
    found
}

fn is_page(path: &Path) -> bool {
    path.extension().is_some_and(|end| end == "md")
}

fn below(folder: &Path, found: &mut Vec<PathBuf>) {
    for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        match path.is_dir() {
            true => below(&path, found),
            false if is_page(&path) => found.push(path),
            false => {}
        }
    }
}

/// Lines outside of code blocks, each with what is between backticks left out, and code blocks with their language.
fn prose_and_code(page: &str) -> (Vec<String>, Vec<(String, String)>) {
    let (mut prose, mut code) = (Vec::new(), Vec::new());
    let mut block: Option<(String, String)> = None;
    for line in page.lines() {
        match (&mut block, line.strip_prefix("```")) {
            (None, Some(language)) => block = Some((language.to_owned(), String::new())),
            (None, None) => prose.push(line.split('`').step_by(2).collect()),
            (Some(_), Some(_)) => code.extend(block.take()),
            (Some((_, text)), None) => *text += &format!("{line}\n"),
        }
    }
    (prose, code)
}

/// The anchor that a heading gets: letters, digits, `-` and `_`, blanks as `-`.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().to_lowercase();
    let kept = kept.chars().filter(|letter| letter.is_alphanumeric() || " -_".contains(*letter));
    kept.map(|letter| if letter == ' ' { '-' } else { letter }).collect()
}

fn anchors(page: &Path) -> Vec<String> {
    let mut inside = false;
    let mut found = Vec::new();
    for line in fs::read_to_string(page).unwrap().lines() {
        inside ^= line.starts_with("```");
        if !inside && line.starts_with('#') {
            found.push(anchor(line.trim_start_matches('#')));
        }
    }
    found
}

#[test]
fn every_link_leads_to_a_file_and_a_heading() {
    let mut broken = Vec::new();
    let mut links = 0;
    for page in pages() {
        let (prose, _) = prose_and_code(&fs::read_to_string(&page).unwrap());
        for target in
            prose.iter().flat_map(|line| line.split("](").skip(1)).filter_map(|rest| rest.split(')').next())
        {
            if target.contains("://") {
                continue;
            }
            links += 1;
            let (path, heading) = target.split_once('#').unwrap_or((target, ""));
            let file = if path.is_empty() { page.clone() } else { page.parent().unwrap().join(path) };
            if !file.exists() || !(heading.is_empty() || anchors(&file).iter().any(|known| known == heading))
            {
                broken.push(format!("{}: {target}", page.strip_prefix(repository()).unwrap().display()));
            }
        }
    }
    assert!(links > 200, "{links} links were found");
    assert!(broken.is_empty(), "links that lead nowhere:\n{}", broken.join("\n"));
}

#[test]
fn every_page_is_in_the_table_of_contents() {
    let docs = repository().join("docs");
    let contents = fs::read_to_string(docs.join("SUMMARY.md")).unwrap();
    for page in pages().iter().filter_map(|page| page.strip_prefix(&docs).ok()) {
        let name = page.to_str().unwrap();
        assert!(
            name == "SUMMARY.md" || contents.contains(&format!("]({name})")),
            "{name} is not in docs/SUMMARY.md"
        );
    }
}

/// Files that sources, messages and scripts name.
#[test]
fn every_page_referenced_in_the_sources_exists() {
    let root = repository();
    let mut named = BTreeSet::new();
    for (_, text) in sources() {
        let rests = text.split("docs/").skip(1);
        let pages = rests.filter_map(|rest| Some(format!("docs/{}.md", rest.split_once(".md")?.0)));
        // A page name has no blanks: what is between was text.
        named.extend(
            pages.filter(|page| page.chars().all(|c| c.is_ascii_alphanumeric() || "/_-.".contains(c))),
        );
    }
    assert!(named.len() > 15, "{named:?}");
    let missing: Vec<_> = named.iter().filter(|name| !root.join(name).exists()).collect();
    assert!(missing.is_empty(), "sources name pages that do not exist: {missing:?}");
}

/// Sources, scripts, campaigns and services, with their text.
fn sources() -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    for folder in ["benches", "campaigns", "crates", "examples", "plugins", "python", "tests", "xtask"] {
        sources_below(&repository().join(folder), &mut found);
    }
    found
}

fn sources_below(folder: &Path, found: &mut Vec<(PathBuf, String)>) {
    for path in fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_dir() {
            if !["target", "venv", "__pycache__"].contains(&name.as_str()) && !name.starts_with('.') {
                sources_below(&path, found);
            }
        } else if [".rs", ".py", ".yaml", ".yml", ".md", ".service"].iter().any(|end| name.ends_with(end)) {
            let text = fs::read_to_string(&path).unwrap_or_default();
            found.push((path, text));
        }
    }
}

/// Commands of cargo in a text that build something, each to its end. A command has options; the name of a subcommand in a sentence has
/// none.
fn building_commands(text: &str) -> Vec<&str> {
    let builds = ["build", "run", "install", "nextest", "test", "bench", "check", "clippy", "doc"];
    let rests = text.match_indices("cargo ").map(|(start, _)| &text[start..]);
    let commands = rests.map(|rest| rest.split(['`', '\n', '\\', '"', '#', ';']).next().unwrap().trim_end());
    let is_build = |command: &&str| {
        let mut words = command.split(' ').skip(1);
        words.next().is_some_and(|name| builds.contains(&name)) && words.any(|word| word.starts_with('-'))
    };
    commands.filter(is_build).collect()
}

/// Without `--locked`, cargo may take other versions of the libraries than those that were tested.
#[test]
fn every_cargo_command_in_the_documentation_uses_the_lock_file() {
    let pages = pages().into_iter().map(|page| (page.clone(), fs::read_to_string(&page).unwrap()));
    let mut all: Vec<(PathBuf, String)> = pages.chain(sources()).collect();
    sources_below(&repository().join(".github"), &mut all);
    let commands =
        all.iter().flat_map(|(path, text)| building_commands(text).into_iter().map(move |line| (path, line)));
    let (locked, unlocked): (Vec<_>, Vec<_>) =
        commands.partition(|(_, command)| command.split(' ').any(|word| word == "--locked"));
    assert!(locked.len() > 50, "{} commands were found", locked.len());
    assert!(unlocked.is_empty(), "commands without --locked: {unlocked:#?}");
}

fn words(text: &str) -> usize {
    text.split_whitespace().filter(|word| word.chars().any(char::is_alphabetic)).count()
}

#[test]
fn the_documentation_keeps_its_word_limit() {
    let docs = repository().join("docs");
    let mut total = 0;
    for page in pages() {
        let Ok(name) = page.strip_prefix(&docs) else { continue };
        let name = name.to_str().unwrap();
        let count = words(&fs::read_to_string(&page).unwrap());
        assert!(
            !name.starts_with("explanation") || count <= MAX_WORDS_OF_EXPLANATION,
            "{name}: {count} words"
        );
        total += if NOT_PROSE.contains(&name) { 0 } else { count };
    }
    assert!(total <= MAX_WORDS, "{total} words; at most {MAX_WORDS}: shorten, or delete what nobody acts on");
}

#[test]
fn every_warning_code_has_a_remedy() {
    let page = fs::read_to_string(repository().join("docs/reference/warnings.md")).unwrap();
    let rows: Vec<&str> = page.lines().filter(|line| line.starts_with("| `")).collect();
    let first_cells = rows.iter().filter_map(|row| row.split(" | ").next());
    let documented: Vec<&str> = first_cells.flat_map(|cell| cell.split('`').skip(1).step_by(2)).collect();
    let named: BTreeSet<&str> = documented.iter().copied().collect();
    assert_eq!(named, mapper_core::Warning::CODES.iter().copied().collect());
    assert_eq!(documented.len(), named.len(), "a code has two rows");
    assert!(
        rows.iter().all(|row| row.matches(" | ").count() == 3),
        "a row without verdict, meaning or remedy"
    );
}

/// Commands in code blocks, and in indented ones, without the text behind `#`.
fn commands(page: &str) -> Vec<String> {
    let lines =
        page.lines().filter_map(|line| line.strip_prefix("    ").unwrap_or(line).strip_prefix("mapper "));
    lines.map(|line| line.split(" #").next().unwrap().to_owned()).collect()
}

#[test]
fn every_command_in_the_pages_and_its_options_exist() {
    let docs = repository().join("docs");
    let reference = fs::read_to_string(docs.join("reference/cli.md")).unwrap();
    let help_of = |name: &str| {
        let start = format!("## mapper {name}\n");
        let (_, rest) = reference.split_once(&start)?;
        Some(rest.split("\n## ").next().unwrap())
    };
    let mut count = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).unwrap();
        if page.ends_with("reference/cli.md") {
            continue;
        }
        for command in commands(&text) {
            let words: Vec<&str> = command.split_whitespace().collect();
            let two = words.iter().take(2).copied().collect::<Vec<_>>().join(" ");
            let three = words.iter().take(3).copied().collect::<Vec<_>>().join(" ");
            let help = help_of(&three).or_else(|| help_of(&two)).or_else(|| help_of(words[0]));
            let help = help.unwrap_or_else(|| panic!("{}: no command `mapper {command}`", page.display()));
            let options = words.iter().filter(|word| word.starts_with("--"));
            for option in
                options.map(|word| word.split('=').next().unwrap().trim_matches([']', '[', '`', ',', ';']))
            {
                count += 1;
                assert!(help.contains(option), "{}: `mapper {command}` has no {option}", page.display());
            }
        }
    }
    assert!(count > 40, "{count} options were found");
}

/// The campaign with keys replaced by those of a page.
fn with_part(campaign: &str, part: &str) -> String {
    let key = |line: &str| {
        let start = line.chars().next().is_some_and(char::is_alphabetic);
        start.then(|| line.split(':').next().unwrap().to_owned())
    };
    let replaced: Vec<String> = part.lines().filter_map(key).collect();
    // A page shows only some sensors; the others are kept.
    let kept = |line: &&str| {
        !part.lines().any(|new| new.starts_with("  ") && new.split(':').next() == line.split(':').next())
    };
    let (mut text, mut inside) = (String::new(), false);
    for line in campaign.lines() {
        if let Some(key) = key(line) {
            inside = replaced.contains(&key);
        }
        if !inside {
            text += &format!("{line}\n");
        }
    }
    text += part;
    if replaced.contains(&"sensors".to_owned()) {
        let own = campaign.lines().skip_while(|line| *line != "sensors:").skip(1);
        let own = own.take_while(|line| line.is_empty() || line.starts_with(' '));
        let single = own.filter(|line| {
            line.starts_with("  ") && line.contains('{') && !line.trim_start().starts_with(['-', '#'])
        });
        text += &single.filter(kept).map(|line| format!("{line}\n")).collect::<String>();
    }
    text
}

/// Parts of campaigns in the pages: a campaign with them has no mistakes. Drivers have tests of their own.
#[test]
fn the_campaigns_in_the_pages_pass_their_check() {
    let root = repository();
    let shipped = fs::read_to_string(root.join("campaigns/turbo_a_redundant.yaml")).unwrap();
    // Four short steps: their forecast takes a fifth of a second.
    let smaller = [
        ("[50 krpm, 80 krpm, 110 krpm, 140 krpm]", "[80 krpm, 110 krpm]"),
        ("openings: [0.5, 0.7, 1.0, 1.4]", "openings: [0.7, 1.0]"),
        ("dwell: 120 s", "dwell: 40 s"),
        // Verdicts and advice are forecast for `joint` alone.
        ("method: joint", "method: dynamic"),
    ];
    let shipped = smaller.iter().fold(shipped, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    let known: Vec<&str> = shipped.lines().filter(|line| line.starts_with(char::is_alphabetic)).collect();
    let known: BTreeSet<&str> = known.iter().filter_map(|line| line.split(':').next()).collect();
    let further = ["campaign", "drift", "guards", "safe_state", "speed_control", "surge_search"];
    let scratch = scratch();
    let mut count = 0;
    for page in pages() {
        let (_, code) = prose_and_code(&fs::read_to_string(&page).unwrap());
        for (_, part) in code.iter().filter(|(language, _)| language == "yaml") {
            let first = part.lines().find_map(|line| {
                line.starts_with(char::is_alphabetic).then(|| line.split(':').next().unwrap())
            });
            let simulated = !part.contains("backend:") || part.contains("virtual_lab");
            if !simulated || !first.is_some_and(|key| known.contains(key) || further.contains(&key)) {
                continue;
            }
            let whole = if part.starts_with("campaign:") { part.clone() } else { with_part(&shipped, part) };
            fs::write(scratch.path().join("page.yaml"), &whole).unwrap();
            eprintln!("{}:\n{part}", page.display());
            mapper_in(scratch.path(), ["check", "page.yaml"]).exits(0);
            count += 1;
        }
    }
    assert!(count >= 8, "{count} campaigns were found");
}

/// The short campaign of the README is the first run of many readers, on any seed.
#[test]
fn the_campaign_of_the_readme_does_not_surge() {
    let readme = fs::read_to_string(repository().join("README.md")).unwrap();
    let (_, code) = prose_and_code(&readme);
    let (_, text) = code.iter().find(|(_, part)| part.starts_with("campaign:")).unwrap();
    assert_eq!(*text, fs::read_to_string(repository().join("examples/short.yaml")).unwrap());
    for seed in 1..=2 {
        let run = shared_run(&CampaignFile::of(format!("{text}seed: {seed}\n"))).run;
        let (_, events) = read_marks(&run.join("recording.mcap"), &ReadOptions::default()).unwrap();
        let surges: Vec<_> = events.iter().filter(|event| event.kind == EventKind::SurgeEntered).collect();
        assert!(surges.is_empty(), "seed {seed}: {surges:?}");
    }
}

/// The README has the same table as the validation page.
#[test]
fn the_readme_has_the_measured_errors() {
    let root = repository();
    let readme = fs::read_to_string(root.join("README.md")).unwrap();
    let measured = fs::read_to_string(root.join("docs/validation/orders.md")).unwrap();
    let cells = |text: &str, start: &str| -> Vec<String> {
        let row =
            text.lines().find(|line| line.starts_with(start)).unwrap_or_else(|| panic!("no row {start}"));
        row.split('|').map(|cell| cell.trim().to_owned()).filter(|cell| !cell.is_empty()).collect()
    };
    for (ours, theirs) in [
        ("| conventional |", "| turbo_a | conventional |"),
        ("| dynamic (Burke et al.) |", "| turbo_a | thermal_gradient, dynamic, 120 s |"),
        ("| joint |", "| turbo_a | thermal_gradient, no zero |"),
        ("| joint after a zero of 30 min |", "| turbo_a | thermal_gradient |"),
        (
            "| the same with a screw compressor's air, 12 campaigns |",
            "| turbo_a | thermal_gradient, screw compressor |",
        ),
    ] {
        let (ours, theirs) = (cells(&readme, ours), cells(&measured, theirs));
        let [_, minutes, median, worst] = &ours[..] else { panic!("{ours:?}") };
        assert_eq!([minutes, median, worst], [&theirs[2], &theirs[6], &theirs[8]], "{theirs:?}");
    }
}

/// Words between backticks that are paths.
fn quoted_paths(text: &str) -> Vec<&str> {
    let quoted = text.split('`').skip(1).step_by(2);
    quoted.filter(|word| word.contains('/') && !word.contains(char::is_whitespace)).collect()
}

/// Paths in the tables of the structure and of what to add where.
#[test]
fn every_file_named_to_developers_exists() {
    let pages = ["ARCHITECTURE.md", "docs/how-to/extend.md", "docs/explanation/one_campaign.md"];
    let texts = pages.map(|page| fs::read_to_string(repository().join(page)).unwrap());
    let paths: Vec<&str> = texts.iter().flat_map(|text| quoted_paths(text)).collect();
    assert!(paths.len() > 90, "{} paths", paths.len());
    let missing: Vec<_> = paths
        .into_iter()
        .filter(|path| !path.starts_with('/') && !repository().join(path).exists())
        .collect();
    assert!(missing.is_empty(), "{pages:?} name files that do not exist: {missing:?}");
}

/// The page that follows a campaign names functions: each is defined in the file of its row.
#[test]
fn the_functions_that_a_campaign_passes_exist() {
    let page = fs::read_to_string(repository().join("docs/explanation/one_campaign.md")).unwrap();
    let mut count = 0;
    for row in page.lines().filter(|line| line.starts_with("| `")) {
        let cells: Vec<&str> = row.split(" | ").collect();
        let file = quoted_paths(cells[0])[0];
        let text = fs::read_to_string(repository().join(file)).unwrap();
        for name in cells[1].split('`').skip(1).step_by(2) {
            let function = name.rsplit("::").next().unwrap();
            let is_defined = ["(", "<"].iter().any(|after| text.contains(&format!("fn {function}{after}")));
            assert!(is_defined, "{file} has no function {name}");
            count += 1;
        }
    }
    assert!(count > 20, "{count} functions were found");
}
