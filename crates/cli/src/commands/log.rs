//! `mapper log`: what a log of another program contains, and its samples in another format.

use crate::command_line::{key_and_value, subcommands};
use crate::environment::registry;
use crate::output::failure::Failure;
use crate::output::standard_output::{self, FileOutput};
use clap::Args;
use mapper_recording::ChannelMap;
use mapper_report::{Document, log_contents, with_messages};
use mapper_session::{Converted, channel_map, convert_recording, inspect_log};
use std::path::PathBuf;

/// Look into the log of a test stand, or write its samples in another format
#[derive(Debug, Args)]
pub struct Log {
    #[command(subcommand)]
    command: LogCommand,
}

subcommands! { LogCommand:
    Inspect, Convert,
}

impl Log {
    pub fn run(&self) -> Result<(), Failure> {
        self.command.run()
    }
}

/// Show every column of a log with unit, rate, range and gaps, and propose a channel map
#[derive(Debug, Args)]
pub struct Inspect {
    /// Log of a test stand
    pub log: PathBuf,
    /// How to read it if automatic detection gave the wrong answer, e.g. `separator=;`, `time=TS`; may be repeated
    #[arg(long = "with", value_name = "KEY=VALUE", value_parser = key_and_value)]
    pub with: Vec<(String, String)>,
    /// Campaign of the machine, whose map shows the unit of a flow without one
    #[arg(long, value_name = "CAMPAIGN")]
    pub machine: Option<PathBuf>,
    /// Write the proposed channel map to this new file
    #[arg(long, value_name = "FILE")]
    pub write_channels: Option<PathBuf>,
    #[command(flatten)]
    pub output: FileOutput,
}

impl Inspect {
    pub fn run(&self) -> Result<(), Failure> {
        let registry = registry();
        let log = inspect_log(&registry, &self.log, self.with.clone(), self.machine.as_deref())?;
        if let Some(file) = &self.write_channels {
            self.output.write(file, log.channel_map().as_bytes())?;
        }
        if self.output.json {
            return standard_output::print_json(&with_messages(|| log.json()));
        }
        let mut document = log_contents(log.format, &log.layout, &log.survey, &log.proposal);
        document.text(match &self.write_channels {
            Some(file) => format!("The channel map is in {}.", file.display()),
            None => "Save it with `--write-channels FILE`.".to_owned(),
        });
        standard_output::show(&document)
    }
}

/// Write the samples of a log or recording in SI units, each channel under its symbol
#[derive(Debug, Args)]
pub struct Convert {
    /// Log of a test stand, recording or run
    pub log: PathBuf,
    /// New file; its extension gives the format: csv, mf4, mcap, and parquet or arrow if the program was built with them
    pub out: PathBuf,
    /// Channel map of the log; `mapper log inspect --write-channels` writes one
    #[arg(long, value_name = "FILE")]
    pub channels: Option<PathBuf>,
    #[command(flatten)]
    pub output: FileOutput,
}

impl Convert {
    pub fn run(&self) -> Result<(), Failure> {
        let map = self.channels.as_deref().map_or_else(|| Ok(ChannelMap::native()), channel_map)?;
        let converted = convert_recording(&registry(), &self.log, &map, (&self.out, self.output.existing()))?;
        if self.output.json {
            return standard_output::print_json(&converted);
        }
        let Converted { file, channels, rows, steps, duration_s, warnings } = converted;
        let mut document = Document::default();
        warnings.into_iter().for_each(|warning| document.text(warning));
        document.text(format!(
            "{}: {rows} rows over {duration_s:.1} s, {steps} steps, in SI units: {}.",
            file.display(),
            channels.join(", ")
        ));
        standard_output::show(&document)
    }
}
