//! The nightly run: no message without a change, and an own exit code after one.

use mapper_tests::{Finished, mapper, mapper_command, repository, scratch};
use std::io::{BufRead, BufReader};
use std::path::Path;

/// A campaign of six points by two methods.
fn write_nightly(folder: &Path, nusselt: &str) {
    write_nightly_on(folder, nusselt, LAB);
}

const LAB: &str = "virtual_lab: {}";

/// The same as shipped.
pub fn write_shipped_nightly(folder: &Path) {
    write_nightly(folder, AS_SHIPPED);
}

/// The same on another rig.
fn write_nightly_on(folder: &Path, nusselt: &str, lab: &str) {
    let shipped = std::fs::read_to_string(repository().join("campaigns/nightly/turbo_a.yaml")).unwrap();
    let changed = [
        (
            "speeds: [50 krpm, 70 krpm, 90 krpm, 110 krpm, 130 krpm, 150 krpm]",
            "speeds: [70 krpm, 100 krpm, 130 krpm]",
        ),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0]", "openings: [0.7, 1.0]"),
        // Two thirds of the recording otherwise.
        ("warm_up: 10 min ", "warm_up: 60 s "),
        ("zero: {soak: 30 min} ", ""),
        ("nusselt: {coefficient: 0.004,", nusselt),
    ];
    let campaign = changed.iter().fold(shipped, |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    assert!(campaign.contains(LAB), "{LAB}");
    std::fs::write(folder.join("small.yaml"), campaign.replace(LAB, lab)).unwrap();
    let nightly =
        "nightly: small\nruns:\n  - {campaign: small.yaml, methods: [dynamic, steady], seeds: [1]}\n";
    std::fs::write(folder.join("nightly.yaml"), nightly).unwrap();
}

const AS_SHIPPED: &str = "nusselt: {coefficient: 0.004,";

fn arguments(folder: &Path) -> [String; 4] {
    let path = |name: &str| folder.join(name).to_str().unwrap().to_owned();
    ["nightly".to_owned(), path("nightly.yaml"), "--db".to_owned(), path("history.db")]
}

fn night(folder: &Path, more: &[&str]) -> Finished {
    let arguments = arguments(folder);
    mapper(arguments.iter().map(String::as_str).chain(more.iter().copied()))
}

#[test]
fn nights_report_a_change_of_the_model_and_nothing_before_it() {
    let scratch = scratch();
    let folder = scratch.path();
    write_nightly(folder, AS_SHIPPED);
    let first = night(folder, &[]).exits(0);
    assert!(first.stdout.contains("The first night"), "{}", first.stdout);
    // A line per run in a pipe, with its duration and the remaining time at its end.
    let done: Vec<String> = first
        .stderr
        .lines()
        .map(|line| line.split_whitespace().take(3).collect::<Vec<_>>().join(" "))
        .collect();
    assert_eq!(done, ["0 of 2", "1 of 2", "2 of 2"], "{}", first.stderr);
    let second = night(folder, &["--json"]).exits(0).json();
    assert_eq!(second["quiet"], true);
    // Same seeds, same figures: nothing but noise of another compiler could move them.
    assert_eq!(second["night"]["runs"].as_array().unwrap().len(), 2);

    // 3 % more heat transfer in the model moves truth and results.
    write_nightly(folder, "nusselt: {coefficient: 0.00412,");
    let moved = night(folder, &[]).exits(7);
    for word in
        ["the true heat-transfer coefficient moved by +", "its model changed", "nominal model's parameters"]
    {
        assert!(in_one_line(&moved.stdout).contains(word), "{word} in\n{}", moved.stdout);
    }
    assert!(moved.stderr.contains("--accept"), "{}", moved.stderr);
    night(folder, &[]).exits(7);
    night(folder, &["--accept"]).exits(0);
    night(folder, &[]).exits(0);

    let history = |more: &[&str]| {
        let db = folder.join("history.db");
        mapper(["history", "--db", db.to_str().unwrap()].iter().chain(more)).exits(0)
    };
    let runs = |more: &[&str]| history(more).json()["runs"].as_array().unwrap().len();
    assert_eq!(runs(&["--json"]), 12);
    assert_eq!(runs(&["--json", "--method", "steady"]), 6);
    assert_eq!(runs(&["--json", "--machine", "nightly_a"]), 12);
    assert_eq!(runs(&["--json", "--since", "2999-01-01"]), 0);
    let svg = folder.join("trend.svg");
    let listed = history(&["--figure", "eta_mean", "--svg", svg.to_str().unwrap()]);
    assert!(listed.stdout.contains("eta_mean %") && listed.stdout.contains("accepted"), "{}", listed.stdout);
    let drawn = std::fs::read_to_string(svg).unwrap();
    assert!(drawn.starts_with("<svg"));
    // The pointer says night and value, a click opens that night's report.
    let link = drawn.split("<a href=\"").nth(1).unwrap().split('"').next().unwrap();
    assert!(drawn.contains("; eta_mean: ") && link.starts_with("history.nights/"), "{link}");
    let report = std::fs::read_to_string(folder.join(link)).unwrap();
    assert!(report.contains("nightly_a"), "{report}");
}

/// A night without any figures is not the first one.
#[test]
fn a_night_of_failed_runs_is_not_the_first_night() {
    let scratch = scratch();
    let folder = scratch.path();
    write_nightly(folder, AS_SHIPPED);
    night(folder, &[]).exits(0);
    // Settings that the rig refuses when a run begins.
    write_nightly_on(folder, AS_SHIPPED, "virtual_lab: {effects: {efficiency_scale: {factor: 0.997}}}");
    let failed = night(folder, &["--json"]).exits(7).json();
    let runs = failed["night"]["runs"].as_array().unwrap();
    assert!(runs.iter().all(|run| run["failure"].is_string()), "{failed}");
    assert_eq!(failed["comparison"]["stored_nights"], 1);
    assert_eq!(failed["comparison"]["nights"], 1);
}

/// Text without the ends of its lines.
fn in_one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// 0.2 points of 70 %: truth moves as well, so that no error against it shows anything.
#[test]
fn an_efficiency_change_of_0_2_points_is_reported_the_next_night() {
    let scratch = scratch();
    let folder = scratch.path();
    write_nightly(folder, AS_SHIPPED);
    night(folder, &[]).exits(0);
    night(folder, &[]).exits(0);
    write_nightly_on(folder, AS_SHIPPED, "virtual_lab: {effects: {efficiency_scale: 1.0028}}");
    let moved = night(folder, &[]).exits(7);
    let moves = "the true efficiency moved by +0.";
    let text = in_one_line(&moved.stdout);
    let conclusion = &text[text.find(moves).unwrap_or_else(|| panic!("{text}"))..];
    assert!(conclusion.contains("simulated machine or its model changed"), "{conclusion}");
    let points: f64 =
        conclusion.split("moved by +").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    // 0.28 % of efficiencies between 66 and 74 %, at points that move with it by next to nothing.
    assert!((0.17..=0.22).contains(&points), "{conclusion}");
    assert!(text.contains("at 6 of 6 points"), "{text}");
}

/// After a kill at any moment, the history has the complete night or none of it.
#[cfg(unix)]
#[test]
fn a_killed_night_leaves_the_history_intact() {
    let scratch = scratch();
    let folder = scratch.path();
    write_nightly(folder, AS_SHIPPED);
    night(folder, &[]).exits(0);
    let db = folder.join("history.db");
    let runs = || {
        let listed = mapper(["history", "--json", "--db", db.to_str().unwrap()]).exits(0).json();
        listed["runs"].as_array().unwrap().len()
    };
    let mut before = runs();
    assert_eq!(before, 2);
    for wait in 0..3_u64 {
        let mut killed = mapper_command(arguments(folder))
            .stdout(std::process::Stdio::null())
            .stderr(std::process::Stdio::piped())
            .spawn()
            .unwrap();
        let progress = BufReader::new(killed.stderr.take().unwrap());
        let last =
            progress.lines().map_while(Result::ok).find(|line| line.trim_start().starts_with("2 of 2"));
        assert!(last.is_some(), "no run ended");
        // The journal next to the history exists while the night is written, and the process is killed on sight of it, or a little later.
        let journal = folder.join("history.db-journal");
        let mut spins = 0;
        while killed.try_wait().unwrap().is_none() && spins <= wait * 30 {
            spins += u64::from(spins > 0 || journal.exists());
            std::thread::yield_now();
        }
        // It may have ended by itself.
        let _ = killed.kill();
        killed.wait().unwrap();
        let after = runs();
        assert!(after == before || after == before + 2, "{before} runs before, {after} after");
        before = after;
    }
    night(folder, &[]).exits(0);
    assert_eq!(runs(), before + 2);
}

#[test]
fn two_nights_at_once_are_both_kept() {
    let scratch = scratch();
    write_nightly(scratch.path(), AS_SHIPPED);
    let start =
        || mapper_command(arguments(scratch.path())).stdout(std::process::Stdio::null()).spawn().unwrap();
    let both = [start(), start()];
    for mut night in both {
        assert!(night.wait().unwrap().success());
    }
    let db = scratch.path().join("history.db");
    let listed = mapper(["history", "--json", "--db", db.to_str().unwrap()]).exits(0).json();
    assert_eq!(listed["runs"].as_array().unwrap().len(), 4);
    // A night with other seeds misses the runs of these, and is not a first night.
    let nightly = scratch.path().join("nightly.yaml");
    let other = std::fs::read_to_string(&nightly).unwrap().replace("seeds: [1]", "seeds: [2]");
    std::fs::write(&nightly, other).unwrap();
    let other = night(scratch.path(), &[]).exits(7);
    let text = in_one_line(&other.stdout);
    assert!(text.contains("missing: nightly_a turbo_a dynamic seed 1:"), "{text}");
    assert!(!other.stdout.contains("first night"), "{}", other.stdout);
}

#[test]
fn mistakes_are_reported_before_anything_runs() {
    let scratch = scratch();
    let folder = scratch.path();
    for (text, word) in [
        ("nightly: a\nruns: [{campaign: none.yaml}]\n", "none.yaml"),
        ("nightly: a\nruns: []\n", "0 runs"),
        ("nightly: a\nruns: [{campaign: small.yaml, seeds: [1, 1]}]\n", "twice"),
        ("nightly: a\nruns: [{campaign: small.yaml, methods: [magic]}]\n", "magic"),
        ("nightly: a\nnight: b\nruns: [{campaign: small.yaml}]\n", "night"),
        ("nightly: a\nband: {nights: 0}\nruns: [{campaign: small.yaml}]\n", "nights"),
    ] {
        write_nightly(folder, AS_SHIPPED);
        std::fs::write(folder.join("nightly.yaml"), text).unwrap();
        let finished = night(folder, &[]);
        assert!(matches!(finished.code, Some(1 | 3)), "{:?}: {}", finished.code, finished.stderr);
        assert!(finished.stderr.contains(word), "{word}: {}", finished.stderr);
        assert!(!folder.join("history.db").exists(), "{text}");
    }
    let missing = mapper(["history", "--db", folder.join("no.db").to_str().unwrap()]).exits(1);
    assert!(missing.stderr.contains("mapper nightly"), "{}", missing.stderr);
}

#[test]
fn the_shipped_nightly_files_refer_to_existing_files() {
    let nightly = repository().join("campaigns/nightly.yaml");
    let text = std::fs::read_to_string(&nightly).unwrap();
    for campaign in text.lines().filter_map(|line| line.trim().strip_prefix("- campaign: ")) {
        // Their contents: `every_shipped_campaign_is_right`.
        assert!(nightly.with_file_name(campaign).is_file(), "{campaign}");
    }
    let folder = repository().join("examples/nightly");
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    for name in ["nightly.yml", "mapper-nightly.service", "mapper-nightly.timer"] {
        assert!(read("nightly.yml").contains("examples/nightly/") && !read(name).is_empty());
    }
    let service = read("mapper-nightly.service");
    for named in ["examples/nightly/mapper-nightly.timer", "examples/nightly/mapper-nightly.service"] {
        assert!(service.contains(named) && repository().join(named).is_file(), "{named}");
    }
    assert_systemd_accepts_the_units(&folder);
    // On the night of summer time, an hour of the local clock is missing.
    for line in read("mapper-nightly.timer").lines().filter_map(|line| line.strip_prefix("OnCalendar=")) {
        assert!(line.ends_with(" UTC"), "{line}");
    }
    // What workflow and service start exists; the package has the campaigns below /usr/share/mapper.
    assert!(read("nightly.yml").contains("mapper nightly campaigns/nightly.yaml"));
    assert!(
        service.contains("/usr/bin/mapper nightly /usr/share/mapper/campaigns/nightly.yaml"),
        "{service}"
    );
}

/// If systemd is there to ask: the units as installed, but for the program, which need not be built for release.
fn assert_systemd_accepts_the_units(folder: &Path) {
    let scratch = scratch();
    for unit in ["mapper-nightly.service", "mapper-nightly.timer"] {
        let text = std::fs::read_to_string(folder.join(unit)).unwrap();
        let text = text
            .replace("/usr/bin/mapper ", "/bin/true ")
            .replace("/var/lib/mapper", scratch.path().to_str().unwrap());
        std::fs::write(scratch.path().join(unit), text).unwrap();
    }
    let asked = std::process::Command::new("systemd-analyze")
        .args(["verify", "--man=no", "./mapper-nightly.service", "./mapper-nightly.timer"])
        .current_dir(scratch.path())
        .output();
    let Ok(answer) = asked else { return };
    let messages = String::from_utf8_lossy(&answer.stderr);
    // Other units of this machine are not ours to judge.
    let ours: Vec<&str> = messages.lines().filter(|line| line.contains("mapper-nightly")).collect();
    assert!(ours.is_empty(), "{ours:?}");
}
