//! The commands by task, as `mapper --help` lists them.

use clap::Command;
use mapper_report::wrapped;

/// Tasks with their commands; a command of no task is listed with the last one.
const TASKS: &[(&str, &[&str])] = &[
    ("Prepare a campaign", &["init", "check", "plan", "schema"]),
    ("Measure", &["run", "rig", "backend"]),
    ("From recordings to a map", &["log", "identify", "report", "map", "transient"]),
    ("Compare rig and model", &["gap", "drift"]),
    ("Many runs", &["nightly", "history", "fleet", "reproduce"]),
    ("Shell", &["completions", "man", "help"]),
];

/// Examples below the list of options.
const EXAMPLES: &str = "\
Examples:
  mapper init my_turbo --wheel 60mm     a campaign, a nominal map, ready to run
  mapper check my_turbo.yaml            mistakes, and the verdicts to expect
  mapper run my_turbo.yaml              the whole map
  mapper identify log.csv --channels channels.yaml --campaign my_turbo.yaml
Documentation: docs/README.md in the repository.";

/// Columns of a description's first one, and of the whole text.
const COLUMNS: (usize, usize) = (15, 80);

/// `command` with a help text that lists its commands by task.
pub fn by_task(command: Command) -> Command {
    let listed = |name: &str| TASKS.iter().any(|(_, names)| names.contains(&name));
    let row = |sub: &Command| {
        let about = sub.get_about().map(ToString::to_string).unwrap_or_default();
        let about = wrapped(&about, COLUMNS.1 - COLUMNS.0, 0);
        let about = about.trim_end().replace('\n', &format!("\n{:1$}", "", COLUMNS.0));
        format!("  {:12} {about}\n", sub.get_name())
    };
    let mut text = String::new();
    for (index, (task, names)) in TASKS.iter().enumerate() {
        text += &format!("{task}:\n");
        text.extend(names.iter().filter_map(|name| command.find_subcommand(name)).map(row));
        if index + 1 == TASKS.len() {
            text.extend(command.get_subcommands().filter(|sub| !listed(sub.get_name())).map(row));
        }
        text.push('\n');
    }
    let template = format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{text}Options:\n{{options}}\n\n{EXAMPLES}{{after-help}}\n"
    );
    command.help_template(template).term_width(COLUMNS.1)
}
