//! Runs every command of the tutorials in docs, in their order.

use crate::pages::FOUR_POINTS;
use mapper_tests::{CampaignFile, mapper_in, python, repository, scratch, shared_run};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// The tutorials, in their order.
const TUTORIALS: [&str; 4] = ["first_map", "own_turbo", "your_log", "diagnose_gap"];

/// Commands of a tutorial: lines of its code blocks that call the program, without the text behind `#`.
fn commands(page: &str) -> Vec<String> {
    let mut inside = false;
    let mut commands = Vec::new();
    for line in page.lines() {
        if line.starts_with("```") {
            inside = !inside;
        } else if let Some(command) = line.strip_prefix("mapper ").filter(|_| inside) {
            // A comment follows spaces; `#` alone may be part of a name.
            commands.push(command.split(" #").next().unwrap().trim().to_owned());
        }
    }
    commands
}

/// What a tutorial writes as `runs/turbo_a-...`: the latest directory of such a name.
fn named(folder: &Path, word: &str) -> String {
    let Some((start, end)) = word.split_once("...") else { return word.to_owned() };
    let (parent, start) = start.rsplit_once('/').unwrap();
    let mut found: Vec<String> = fs::read_dir(folder.join(parent))
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.starts_with(start))
        .collect();
    found.sort();
    format!("{parent}/{}{end}", found.last().unwrap_or_else(|| panic!("nothing is called {word}")))
}

/// The first campaign of a machine with its first two speed lines: the others are minutes, and test no more of a command.
fn shorten(campaign: &Path) {
    let text = fs::read_to_string(campaign).unwrap();
    let mut lines_left = 2;
    let kept = text.lines().filter(|line| {
        let of_grid = line.trim_start().starts_with("- {speed_corrected:");
        lines_left -= i32::from(of_grid);
        !of_grid || lines_left >= 0
    });
    let text: String = kept.map(|line| format!("{line}\n")).collect();
    assert!(lines_left < 0, "{text}");
    fs::write(campaign, text).unwrap();
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let to = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy(&entry.path(), &to);
        } else {
            fs::copy(entry.path(), to).unwrap();
        }
    }
}

/// Eight speeds at six openings are minutes, and test no more of a command than two at two.
const SMALLER: [(&str, &str); 2] = [
    (
        "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
        "speeds: [80 krpm, 125 krpm]",
    ),
    ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.7, 1.4]"),
];

/// A run of a few points that goes by the name of a day.
fn run_of_a_day(folder: &Path, day: &str, seed: usize) {
    let seed = format!("seed: {seed} ");
    // Half an hour of soak is most of it.
    let changed = [
        ("seed: 1 ", seed.as_str()),
        ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
    ];
    let campaign = CampaignFile::shipped_with(&[&SMALLER[..], &changed].concat());
    copy(&shared_run(&campaign).run, &folder.join("runs").join(day));
}

#[test]
#[cfg_attr(not(with_python), ignore = "needs Python: run `cargo xtask test`")]
fn every_command_of_the_tutorials_runs() {
    let (scratch, root) = (scratch(), repository());
    let folder = scratch.path();
    for name in ["campaigns", "examples"] {
        copy(&root.join(name), &folder.join(name));
    }
    // What the tutorials presuppose: logs of another program, runs of three days, a campaign with an effect.
    fs::write(folder.join("campaigns/turbo_a.yaml"), CampaignFile::shipped_with(&SMALLER).text).unwrap();
    let changed = |text: String, (from, to): &(&str, &str)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    };
    let shipped = fs::read_to_string(root.join("campaigns/gap_rig.yaml")).unwrap();
    let gap_rig = FOUR_POINTS.iter().fold(shipped, changed);
    fs::write(folder.join("campaigns/gap_rig.yaml"), &gap_rig).unwrap();
    let lab = "    weather: wandering\n";
    let with_effect =
        changed(gap_rig.clone(), &(lab, &format!("{lab}    effects: {{stem_conduction: 5 %}}\n")));
    fs::write(folder.join("my_gap_rig.yaml"), with_effect).unwrap();
    for (day, seed) in [("monday", 11), ("tuesday", 12), ("wednesday", 13)] {
        run_of_a_day(folder, day, seed);
    }
    // Logs of two days: the same readings twice would be one recording.
    for (day, log) in [("monday", "stand.csv"), ("tuesday", "tuesday.csv")] {
        let (recording, to) = (folder.join("runs").join(day).join("recording.mcap"), folder.join(log));
        python("write_log.py", [recording.as_os_str(), to.as_os_str(), "csv".as_ref()]);
    }
    let page = |name: &str| fs::read_to_string(root.join(format!("docs/tutorials/{name}.md"))).unwrap();
    let commands: Vec<String> = TUTORIALS.iter().flat_map(|name| commands(&page(name))).collect();
    assert!(commands.len() > 15, "{commands:?}");
    // What is read again later in a tutorial has not changed.
    let mut done = BTreeSet::new();
    for command in commands.into_iter().filter(|command| done.insert(command.clone())) {
        let (words, to) =
            command.split_once('>').map_or((command.as_str(), None), |(a, b)| (a, Some(b.trim())));
        let words: Vec<String> = words.split_whitespace().map(|word| named(folder, word)).collect();
        eprintln!("mapper {}", words.join(" "));
        let finished = mapper_in(folder, &words).exits(0);
        if let Some(to) = to {
            fs::write(folder.join(to), &finished.stdout).unwrap();
        }
        if command.starts_with("init ") {
            shorten(&folder.join("my_turbo.yaml"));
        }
    }
    // The files that the tutorials announce are there.
    for left in ["campaign.schema.json", "maps/log/report.html", "maps/both/report.html", "gap.html"] {
        assert!(folder.join(left).metadata().unwrap().len() > 1000, "{left}");
    }
}
