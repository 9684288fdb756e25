//! Help, exit codes and schema.

use mapper_tests::{SHIPPED, mapper};

/// Commands as the top level lists them, by task, before its options.
fn commands(help: &str) -> Vec<String> {
    help.lines()
        .take_while(|line| *line != "Options:")
        // Descriptions go on in deeper lines.
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .map(str::to_owned)
        .collect()
}

#[test]
fn every_command_has_help() {
    let top = mapper(["--help"]).exits(0);
    let commands = commands(&top.stdout);
    for expected in
        ["check", "schema", "plan", "run", "identify", "gap", "drift", "nightly", "history", "map"]
    {
        assert!(commands.iter().any(|command| command == expected), "{expected} in {commands:?}");
    }
    for command in commands.iter().filter(|command| *command != "help") {
        let help = mapper([command, "--help"]).exits(0);
        assert!(help.stdout.contains(&format!("Usage: mapper {command}")), "{}", help.stdout);
        assert_eq!(help.stderr, "");
    }
}

#[test]
fn the_exit_codes_are_listed() {
    let top = mapper(["--help"]).exits(0);
    let (_, codes) = top.stdout.split_once("Exit codes:").expect("a list of exit codes");
    let listed: Vec<i32> =
        codes.lines().filter_map(|line| line.split_whitespace().next()?.parse().ok()).collect();
    assert_eq!(listed, [0, 1, 2, 3, 4, 5, 6, 7, 8, 130]);
    // Wrong arguments need no campaign.
    mapper(["plan", "--no-such-option", SHIPPED]).exits(2);
    for address in ["nonsense", "localhost", "localhost:99999", "1.2.3"] {
        mapper(["run", SHIPPED, &format!("--live={address}")]).exits(2);
    }
}

#[test]
fn the_schema_describes_the_shipped_campaign() {
    let schema = mapper(["schema"]).exits(0).json();
    let properties = schema["properties"].as_object().expect("properties of a campaign");
    let text = std::fs::read_to_string(mapper_tests::repository().join(SHIPPED)).unwrap();
    let keys: Vec<&str> = text
        .lines()
        .filter(|line| line.starts_with(|first: char| first.is_ascii_alphabetic()))
        .filter_map(|line| line.split_once(':').map(|(key, _)| key))
        .collect();
    assert!(keys.len() > 10, "{keys:?}");
    for key in keys {
        assert!(properties.contains_key(key), "{key}");
    }
}
