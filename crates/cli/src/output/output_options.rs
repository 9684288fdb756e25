//! Options that every command has.

use crate::terminal::{Progress, ProgressFormat};
use clap::{ArgMatches, Args, ColorChoice};
use mapper_report::Paint;
use std::ffi::{OsStr, OsString};
use std::io::IsTerminal;
use std::sync::OnceLock;

/// Options of every command.
#[derive(Debug, Args)]
pub struct OutputOptions {
    /// When to colour; `auto`: on a terminal, unless NO_COLOR is set
    #[arg(long, global = true, value_enum, value_name = "WHEN", default_value_t, help_heading = "Output")]
    color: ColorChoice,
    /// Progress on standard error [default: a bar on a terminal, lines in a pipe, none with --json]
    #[arg(long, global = true, value_parser = ProgressFormat::NAMES, value_name = "FORM", help_heading = "Output")]
    progress: Option<String>,
}

#[derive(Debug, Clone, Copy, Default)]
struct ChosenOptions {
    colour: ColorChoice,
    progress: Option<ProgressFormat>,
    json: bool,
    replaces: bool,
}

/// All commands with their options, as `main` has them.
static COMMANDS: OnceLock<fn() -> clap::Command> = OnceLock::new();

static CHOSEN: OnceLock<ChosenOptions> = OnceLock::new();

fn chosen_options() -> ChosenOptions {
    CHOSEN.get().copied().unwrap_or_default()
}

/// Stores the chosen options for all later output.
pub fn set_options(arguments: &OutputOptions, matches: &ArgMatches) {
    let progress = arguments.progress.as_deref().map(ProgressFormat::from_name);
    let command = std::iter::successors(Some(matches), |of| of.subcommand().map(|(_, deeper)| deeper)).last();
    let json =
        command.is_some_and(|of| of.try_get_one::<bool>("json").ok().flatten().is_some_and(|json| *json));
    let replaces = command.is_some_and(|of| of.try_contains_id("force").unwrap_or(false));
    // It is kept once: `main` alone calls this.
    let _ = CHOSEN.set(ChosenOptions { colour: arguments.color, progress, json, replaces });
}

/// Whether invalid arguments request JSON, and their choice of colours.
pub fn scan_raw_arguments(arguments: &[OsString]) -> (bool, ColorChoice) {
    let has_arguments = |words: &[&str]| arguments.windows(words.len()).any(|window| window == words);
    let never = has_arguments(&["--color", "never"]) || has_arguments(&["--color=never"]);
    let always = has_arguments(&["--color", "always"]) || has_arguments(&["--color=always"]);
    let colour = match (never, always) {
        (true, _) => ColorChoice::Never,
        (_, true) => ColorChoice::Always,
        _ => ColorChoice::Auto,
    };
    (has_arguments(&["--json"]), colour)
}

/// Stores the list of commands for completions and manual pages.
pub fn set_commands(commands: fn() -> clap::Command) {
    let _ = COMMANDS.set(commands);
}

/// All commands with their options.
pub fn commands() -> clap::Command {
    COMMANDS.get().map_or_else(|| clap::Command::new("mapper"), |commands| commands())
}

/// Whether results are one JSON object.
pub fn json() -> bool {
    chosen_options().json
}

/// Whether the command has an option to replace existing files.
pub fn has_force() -> bool {
    chosen_options().replaces
}

/// Colours of standard output.
pub fn paint() -> Paint {
    if coloured(shows_escapes(&std::io::stdout())) { Paint::Coloured } else { Paint::Plain }
}

/// Whether standard error is coloured.
pub fn is_stderr_coloured() -> bool {
    coloured(shows_escapes(&std::io::stderr()))
}

/// Whether this is a terminal that moves its cursor and shows colours.
fn shows_escapes(stream: &impl IsTerminal) -> bool {
    stream.is_terminal() && understands_escapes(std::env::var_os("TERM").as_deref())
}

/// Whether a terminal understands escape sequences, by the environment variable `TERM`: `dumb` is a printer, or an editor's shell.
fn understands_escapes(term: Option<&OsStr>) -> bool {
    term.is_none_or(|term| term != "dumb")
}

fn coloured(terminal: bool) -> bool {
    is_coloured(chosen_options().colour, terminal, std::env::var_os("NO_COLOR").as_deref())
}

/// Whether the output is coloured. `no_color`: the environment variable of that name (no-color.org).
fn is_coloured(choice: ColorChoice, to_terminal: bool, no_color: Option<&OsStr>) -> bool {
    match choice {
        ColorChoice::Always => true,
        ColorChoice::Never => false,
        ColorChoice::Auto => to_terminal && no_color.is_none_or(OsStr::is_empty),
    }
}

/// The display of progress.
pub fn progress() -> Progress {
    let default_format = match (shows_escapes(&std::io::stderr()), json()) {
        (true, _) => ProgressFormat::Bar,
        (false, true) => ProgressFormat::Quiet,
        (false, false) => ProgressFormat::Lines,
    };
    Progress::new(chosen_options().progress.unwrap_or(default_format))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dumb_terminal_gets_no_escapes() {
        assert!(!understands_escapes(Some(OsStr::new("dumb"))));
        assert!(understands_escapes(Some(OsStr::new("xterm-256color"))));
        assert!(understands_escapes(None));
    }

    #[test]
    fn what_was_asked_for_outranks_the_environment_and_an_empty_no_color_is_none() {
        let set = Some(OsStr::new("1"));
        assert!(is_coloured(ColorChoice::Always, false, set));
        assert!(!is_coloured(ColorChoice::Never, true, None));
        assert!(is_coloured(ColorChoice::Auto, true, None));
        assert!(!is_coloured(ColorChoice::Auto, true, set));
        assert!(is_coloured(ColorChoice::Auto, true, Some(OsStr::new(""))));
        assert!(!is_coloured(ColorChoice::Auto, false, None));
    }
}
