//! Output for users and programs during a run, at its end, and after a failure.

use mapper_tests::{
    CampaignFile, SHIPPED, SHORT_GRID, SINGLE_STEP_METHOD, mapper, mapper_command, only_run, scratch,
    shared_run,
};
use serde_json::Value;

#[test]
fn a_run_into_a_pipe_prints_a_line_per_step_within_80_columns() {
    let campaign = CampaignFile::shipped_with(&[SHORT_GRID, SINGLE_STEP_METHOD].concat());
    let run = |more: &[&str]| {
        let out = scratch();
        let mut command = mapper_command(["run".as_ref(), campaign.path.as_os_str(), "--out".as_ref()]);
        let finished = command.arg(out.path()).args(more).output().unwrap();
        mapper_tests::Finished::from(finished).exits(0)
    };
    let quiet = run(&[]);
    let steps = quiet.stderr.lines().filter(|line| line.contains("  step ")).count();
    assert_eq!(steps, 4, "{}", quiet.stderr);
    let (table, files) = quiet.stdout.split_once("\nmap  ").unwrap();
    assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
    assert!(!quiet.stdout.contains('\u{1b}') && !quiet.stderr.contains('\u{1b}'), "{}", quiet.stdout);
    assert!(!table.contains("truth") && files.contains("report.html"), "{}", quiet.stdout);
    // One row a point, fastest line last.
    let rows = table.lines().skip_while(|line| !line.starts_with("krpm")).skip(1);
    let rows: Vec<&str> = rows.take_while(|line| !line.is_empty()).collect();
    assert_eq!(rows.len(), 4, "{table}");

    let printed = run(&["--progress", "json", "--truth", "--full", "--color", "always"]);
    assert!(printed.stdout.contains("\u{1b}[3") && printed.stdout.contains("true"), "{}", printed.stdout);
    let events: Vec<Value> = printed.stderr.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let of = |name: &str| events.iter().filter(|event| event["event"] == name).count();
    assert_eq!(
        [of("run_started"), of("step_started"), of("step_ended"), of("point_identified")],
        [1, 4, 4, 4]
    );
}

/// A parameter that is held fixed is stated next to the verdict, before the figures: on the page, in the report and at the end of the output.
#[test]
fn what_all_results_depend_on_is_next_to_the_verdict() {
    let fixed = (
        "  method: joint ",
        "  joint: {alpha_area: fixed, probe: fixed, heating_cooling_ratio: fixed}\n  method: joint ",
    );
    let campaign = CampaignFile::shipped_with(&[SHORT_GRID, &[fixed]].concat());
    let run = shared_run(&campaign).run;
    let read = |name: &str| std::fs::read_to_string(run.join(name)).unwrap();
    let key = "identification.joint";
    let page = read("report.html");
    assert!(page.split("<nav").next().unwrap().contains(key));
    assert!(read("report.md").split("## Conditions").next().unwrap().contains(key));
    let shown = mapper(["identify".as_ref(), run.as_os_str()]).exits(0).stdout;
    let (_, after_the_legend) = shown.rsplit_once("--full").unwrap();
    assert!(after_the_legend.contains(key), "{shown}");
}

#[test]
fn a_failure_is_one_json_object() {
    let failed = |arguments: &[&str], code: i32| {
        let finished = mapper(arguments.iter().chain(&["--json"])).exits(code);
        let value = finished.json();
        assert_eq!(value["code"], code, "{value}");
        assert!(!value["message"].as_str().unwrap().is_empty(), "{value}");
        value
    };
    failed(&["check", "no/such.yaml"], 1);
    let wrong = failed(&["plan", SHIPPED, "--no-such-option"], 2);
    assert!(wrong["message"].as_str().unwrap().contains("--no-such-option"), "{wrong}");
    let campaign = CampaignFile::shipped_with(&[("seed: 1 ", "sed: 1 ")]);
    let path = campaign.path.to_str().unwrap();
    for command in ["check", "plan", "run"] {
        let mistakes = failed(&[command, path], 3);
        assert_eq!(mistakes["findings"][0]["kind"], "unknown_key", "{mistakes}");
        assert!(mistakes["help"].as_str().unwrap().contains("seed"), "{mistakes}");
    }
    failed(&["run", SHIPPED, "--live=nowhere"], 2);
}

/// Every failure prints one object on standard output, with the exit code of the process.
#[test]
fn failures_of_every_kind_have_the_same_form() {
    let folder = scratch();
    let file = |name: &str, text: &[u8]| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (empty, junk) = (file("empty", b""), file("junk.mcap", b"\x89no recording at all"));
    let (not_yaml, table) = (file("bad.yaml", b"campaign: [1, 2"), file("m.csv", b"a,b\n1,2\n"));
    let there = file("there.map", b"kept");
    let nowhere = CampaignFile::shipped_with(&[("  virtual_lab: {}", "  nosuch: {}")]);
    let hot = CampaignFile::shipped_with(&[("temperature: 500 degC", "temperature: 5000 degC")]);
    let failures: [(i32, &[&str]); 24] = [
        (1, &["run", "nosuch.yaml"]),
        (3, &["run", &not_yaml]),
        (3, &["run", nowhere.path.to_str().unwrap()]),
        (3, &["check", hot.path.to_str().unwrap()]),
        (3, &["check", &empty]),
        (1, &["plan", "."]),
        (1, &["run", SHIPPED, "--plan", "nosuch.json"]),
        (4, &["run", SHIPPED, "--plan", &empty]),
        (1, &["run", "--resume", "nosuch"]),
        (2, &["run"]),
        (2, &["nosuch"]),
        (1, &["identify", "nosuch"]),
        (6, &["identify", &junk]),
        (6, &["identify", &empty]),
        (1, &["report", "nosuch", "-o", "never.html"]),
        (6, &["gap", "diagnose", SHIPPED, "--recording", &junk]),
        (1, &["gap", "effects", "--effect", "nosuch"]),
        (6, &["drift", &junk]),
        (1, &["nightly", "nosuch.yaml"]),
        (3, &["map", "fit", &table]),
        (1, &["map", "convert", "nosuch.csv", &there]),
        (6, &["log", "inspect", &empty]),
        (3, &["fleet", "status", "nosuch"]),
        (1, &["man", "--out", "/proc/nosuch"]),
    ];
    for (code, arguments) in failures {
        let finished = mapper(arguments.iter().chain(&["--json"])).exits(code);
        let failure = finished.json();
        assert_eq!(failure["code"], code, "{arguments:?}: {failure}");
        assert!(failure["message"].as_str().is_some_and(|text| !text.is_empty()), "{arguments:?}: {failure}");
        assert!(failure.as_object().unwrap().contains_key("help"), "{arguments:?}: {failure}");
    }
}

/// On a terminal, which `script` makes, mistakes are coloured unless the user switches colour off; `--color` outranks `NO_COLOR`.
#[test]
#[cfg(target_os = "linux")]
fn colour_follows_the_terminal_and_the_options() {
    let campaign = CampaignFile::shipped_with(&[("seed: 1 ", "sed: 1 ")]);
    let coloured = |when: &str, no_color: bool| {
        let program = mapper_command(["check", campaign.path.to_str().unwrap(), "--color", when]);
        let words: Vec<String> = std::iter::once(program.get_program())
            .chain(program.get_args())
            .map(|word| format!("'{}'", word.to_str().unwrap()))
            .collect();
        let mut terminal = std::process::Command::new("script");
        terminal.args(["-qec", &words.join(" "), "/dev/null"]).stdin(std::process::Stdio::null());
        terminal.env_remove("NO_COLOR").env("TERM", "xterm");
        if no_color {
            terminal.env("NO_COLOR", "1");
        }
        let output = String::from_utf8(terminal.output().unwrap().stdout).unwrap();
        assert!(output.contains("there is no key"), "{output}");
        output.contains("\u{1b}[")
    };
    let wanted = [("auto", false), ("auto", true), ("always", true), ("never", false)];
    assert_eq!(wanted.map(|(when, no_color)| coloured(when, no_color)), [true, false, true, false]);
}

#[test]
fn an_existing_file_is_replaced_only_with_force() {
    let folder = scratch();
    let file = folder.path().join("plan.json");
    let plan = |more: &[&str]| {
        let arguments = ["plan", "campaigns/grid18.yaml", "--out", file.to_str().unwrap()];
        mapper(arguments.iter().chain(more))
    };
    std::fs::write(&file, "kept").unwrap();
    let refused = plan(&["--json"]).exits(1);
    assert!(refused.stderr.contains("plan.json") && refused.stderr.contains("--force"), "{}", refused.stderr);
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "kept");
    plan(&["--force"]).exits(0);
    assert!(std::fs::read_to_string(&file).unwrap().contains("\"steps\""));
    assert_eq!(only_run(folder.path()), file, "nothing else is left");
}

#[test]
fn a_jump_is_explained_to_programs_and_commands_are_completed() {
    let why = mapper(["plan", SHIPPED, "--why", "110krpm@0.5", "50krpm@0.7", "--json"]).exits(0).json();
    assert_eq!(why["allowed"], why["rejections"].as_array().unwrap().is_empty());
    for shell in ["bash", "zsh", "fish"] {
        let script = mapper(["completions", shell]).exits(0).stdout;
        assert!(script.contains("diagnose") && script.contains("resume"), "{shell}");
    }
    let pages = scratch();
    mapper(["man", "--out", pages.path().to_str().unwrap()]).exits(0);
    let page = std::fs::read_to_string(pages.path().join("mapper-run.1")).unwrap();
    assert!(page.starts_with(".ie") || page.contains(".TH mapper-run"), "{page}");
}
