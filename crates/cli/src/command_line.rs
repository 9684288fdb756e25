//! The command line as the user sees it: commands grouped by task, their declaration, and arguments that several commands share.

use crate::output::failure::{Code, Failure};
use clap::{Args, Command};
use mapper_campaign::Campaign;
use mapper_core::{MapDescription, ReferenceState};
use mapper_maps::table::parse_reference;
use mapper_recording::ChannelMap;
use mapper_report::wrapped;
use mapper_session::map_description;
use std::path::{Path, PathBuf};

/// Statements about a map file.
#[derive(Debug, Default, Args)]
pub struct MapReading {
    /// Reference state of the file's corrected quantities, if the file does not give it: SAE, Garrett, BorgWarner or "T, P"
    #[arg(long, value_name = "STATE")]
    pub reference: Option<String>,
    /// Corrected speed of the design point, for a file with relative speeds (NPSS, pyCycle), e.g. "150000 rpm"
    #[arg(long, value_name = "SPEED")]
    pub design_speed: Option<String>,
    /// Map description (YAML) with data that are not in the file; `mapper map inspect --write-description` writes one
    #[arg(long, value_name = "FILE")]
    pub description: Option<PathBuf>,
    /// One entry of a map description, e.g. `flow=lb/min`, `speed=#1 [krpm]`; may be repeated
    #[arg(long = "with", value_name = "KEY=VALUE", value_parser = key_and_value)]
    pub with: Vec<(String, String)>,
}

impl MapReading {
    /// All statements together.
    pub fn description(&self) -> Result<MapDescription, Failure> {
        let with = self.with.iter().map(|(key, value)| (key.as_str(), value.as_str()));
        let design = self.design_speed.iter().map(|speed| ("design_speed", speed.as_str()));
        let stated = map_description(self.description.as_deref(), with.chain(design))?;
        Ok(MapDescription { reference: reference(self.reference.as_deref())?.or(stated.reference), ..stated })
    }
}

/// `KEY=VALUE`.
pub fn key_and_value(text: &str) -> Result<(String, String), String> {
    let (key, value) = text.split_once('=').ok_or("write KEY=VALUE, e.g. `separator=;`")?;
    Ok((key.trim().to_owned(), value.to_owned()))
}

/// Options to read recordings.
#[derive(Debug, Args)]
pub struct RecordingReading {
    /// Channel map: where a recording made by another program holds the rig's channels (YAML)
    #[arg(long, value_name = "FILE")]
    channels: Option<PathBuf>,
    /// Campaign with machine, sensors and window, instead of the one attached to the recording
    #[arg(long, value_name = "FILE")]
    campaign: Option<PathBuf>,
}

impl RecordingReading {
    /// The channel map, and the campaign if given.
    pub fn read(&self) -> Result<(ChannelMap, Option<Campaign>), Failure> {
        let campaign = self.campaign.as_deref().map(mapper_campaign::load).transpose();
        Ok((channel_map(self.channels.as_deref())?, campaign.map_err(Failure::of_campaign)?))
    }
}

/// The channel map of an option; by default the one for recordings of this program.
pub fn channel_map(path: Option<&Path>) -> Result<ChannelMap, Failure> {
    Ok(path.map(mapper_session::channel_map).transpose()?.unwrap_or_else(ChannelMap::native))
}

/// The reference state of an option: SAE, Garrett, BorgWarner or "T, P".
pub fn reference(text: Option<&str>) -> Result<Option<ReferenceState>, Failure> {
    text.map(|text| parse_reference(text).map_err(|error| Failure::new(Code::BadInput, error))).transpose()
}

/// Declares an enum with one variant for each of the options, whose help is their documentation; its `run` runs the one that was asked for.
/// Options of the form `module::Options` also declare their module.
macro_rules! subcommands {
    ($name:ident: $($module:ident::$options:ident),+ $(,)?) => {
        $(mod $module;)+
        use { $($module::$options),+ };
        subcommands! { $name: $($options),+ }
    };
    ($name:ident: $($options:ident),+ $(,)?) => {
        /// One variant a command.
        #[derive(Debug, clap::Subcommand)]
        pub enum $name {
            $(
                #[allow(missing_docs, reason = "a variant's documentation would replace that of its options in the help")]
                $options($options),
            )+
        }

        impl $name {
            /// Runs the selected command.
            pub fn run(&self) -> Result<(), Failure> {
                match self {
                    $($name::$options(options) => options.run(),)+
                }
            }
        }
    };
}

pub(crate) use subcommands;

/// Tasks with their commands; a command of no task is listed with the last one.
const TASKS: &[(&str, &[&str])] = &[
    ("Prepare a campaign", &["init", "check", "plan", "schema"]),
    ("Measure", &["run", "rig", "backend"]),
    ("From recordings to a map", &["log", "identify", "report", "map", "transient"]),
    ("Compare rig and model", &["gap", "drift"]),
    ("Many runs", &["studio", "nightly", "history", "fleet", "reproduce"]),
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
