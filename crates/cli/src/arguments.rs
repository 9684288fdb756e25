//! The command line.

use crate::exit_code;
use crate::gap_arguments::GapArguments;
use clap::{Args, Parser, Subcommand, ValueEnum};
use mapper_campaign::units::{Kind, parse};
use mapper_core::{Method, OperatingPoint};
use mapper_history::Metric;
use std::path::PathBuf;

/// From a campaign file to a complete turbocharger-compressor map, efficiency and heat transfer included.
#[derive(Debug, Parser)]
#[command(name = "mapper", version, after_help = exit_code::HELP, arg_required_else_help = true)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// One variant a command.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Check a campaign file and print all its mistakes, each with its line and what would be right
    Check(CheckArguments),
    /// Print the JSON schema of campaign files, for editors
    Schema,
    /// Show the steps of a campaign: order, turbine pressure, what each is expected to give, how long it takes
    Plan(PlanArguments),
    /// Run a campaign: plan, drive the rig, record, identify, assemble the map, report
    Run(RunArguments),
    /// Identify efficiency and heat transfer from a run directory or any MCAP recording
    Identify(IdentifyArguments),
    /// Diagnose the gap between nominal model and rig, and check that diagnosis on withheld data
    Gap(GapArguments),
    /// Say whether the rig stayed the same while a map was made: which sensor drifts, or the machine, since when, how fast
    Drift(DriftArguments),
    /// Run every map of a nightly campaign on the simulated rig and say what moved against the last nights
    Nightly(NightlyArguments),
    /// List, filter and draw what the nightly runs gave
    History(HistoryArguments),
    /// Redo the paper's figures 5 to 10 and 12 on the nominal model, beside what the paper states
    Reproduce(ReproduceArguments),
    /// Fit, convert and compare compressor maps
    Map(MapArguments),
}

/// `mapper map`.
#[derive(Debug, Args)]
pub struct MapArguments {
    /// What to do with the map
    #[command(subcommand)]
    pub command: MapCommand,
}

/// One variant a command on maps.
#[derive(Debug, Subcommand)]
pub enum MapCommand {
    /// Fit all speed lines together and print the error at each line when it is left out
    Fit(MapFitArguments),
    /// Write a map in another format, at another reference state
    Convert(MapConvertArguments),
    /// Show where two maps differ, in units and in their uncertainty
    Compare(MapCompareArguments),
    /// Write what a run gave beside the map: thermal model, turbine, pictures of h and of errors
    Rig(MapRigArguments),
}

/// `mapper map rig`.
#[derive(Debug, Args)]
pub struct MapRigArguments {
    /// Run directory, or MCAP file of a run
    pub recording: PathBuf,
    /// Directory for the files; those that are there are not replaced
    #[arg(long, value_name = "DIR")]
    pub out: PathBuf,
    /// Campaign that says machine, sensors and window, instead of the one attached to the recording
    #[arg(long, value_name = "FILE")]
    pub campaign: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// `mapper map fit`.
#[derive(Debug, Args)]
pub struct MapFitArguments {
    /// Map (CSV, JSON or SAE text)
    pub map: PathBuf,
    /// State to which the file's corrected quantities refer, where the file does not say: SAE, Garrett, BorgWarner or "T, P"
    #[arg(long, value_name = "STATE")]
    pub reference: Option<String>,
    /// Corrected speeds of further lines, rpm, instead of two below and one above the measured ones
    #[arg(long, value_delimiter = ',', value_name = "RPM,...")]
    pub speeds: Option<Vec<f64>>,
    /// Nodes on each line
    #[arg(long, default_value_t = 41, value_parser = clap::value_parser!(u16).range(5..=400))]
    pub nodes: u16,
    /// Write the fitted map to this new file; the extension says the format, unless `--to` does
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Format of `--out`
    #[arg(long, value_name = "FORMAT", requires = "out")]
    pub to: Option<String>,
    /// Do not leave lines out
    #[arg(long)]
    pub no_leave_out: bool,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// `mapper map convert`.
#[derive(Debug, Args)]
pub struct MapConvertArguments {
    /// Map (CSV, JSON or SAE text)
    pub map: PathBuf,
    /// New file; the extension says the format, unless `--to` does
    pub out: PathBuf,
    /// Format of the new file
    #[arg(long, value_name = "FORMAT")]
    pub to: Option<String>,
    /// State to which the file's corrected quantities refer, where the file does not say: SAE, Garrett, BorgWarner or "T, P"
    #[arg(long, value_name = "STATE")]
    pub reference: Option<String>,
    /// State to which the new file shall refer [default: as before]
    #[arg(long, value_name = "STATE")]
    pub to_reference: Option<String>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// `mapper map compare`.
#[derive(Debug, Args)]
pub struct MapCompareArguments {
    /// Map that counts as the known one
    pub first: PathBuf,
    /// Map that is compared with it
    pub second: PathBuf,
    /// State of the first map, where its file does not say
    #[arg(long, value_name = "STATE")]
    pub reference: Option<String>,
    /// State of the second map, where its file does not say
    #[arg(long, value_name = "STATE")]
    pub second_reference: Option<String>,
    /// Draw both maps and their difference in this new file (.svg or .png)
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// `mapper check`.
#[derive(Debug, Args)]
pub struct CheckArguments {
    /// Campaign file (YAML)
    pub campaign: PathBuf,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// `mapper plan`.
#[derive(Debug, Args)]
pub struct PlanArguments {
    /// Campaign file (YAML)
    pub campaign: PathBuf,
    /// Print the plan as one JSON object on standard output
    #[arg(long)]
    pub json: bool,
    /// Also store the plan in this new file, for `mapper run --plan`
    #[arg(long, value_name = "FILE")]
    pub out: Option<PathBuf>,
    /// Draw the path on the map beside the conventional one, in this new SVG file
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    /// Also compare with conventional mapping and with the same points along speed lines
    #[arg(long)]
    pub compare: bool,
    /// Make this jump after all else, e.g. the one that a gap diagnosis asks for: 130krpm@0.5 50krpm@0.7
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], value_parser = operating_point)]
    pub append: Vec<OperatingPoint>,
    /// Say what the jump between two points gives and what forbids it, e.g. 110krpm@0.5 50krpm@0.7
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], value_parser = operating_point)]
    pub why: Vec<OperatingPoint>,
    /// Work of the search: 1 is the usual, 100 takes a hundred times as long
    #[arg(long, value_name = "FACTOR", hide_short_help = true)]
    pub effort: Option<f64>,
}

/// A point as `speed@opening`; the speed carries its unit.
fn operating_point(text: &str) -> Result<OperatingPoint, String> {
    let form = || format!("`{text}` is no point; write speed@opening, e.g. 110krpm@0.5");
    let (speed, opening) = text.split_once('@').ok_or_else(form)?;
    let opening: f64 = opening.trim().parse().map_err(|_| form())?;
    let digits = speed.find(|c: char| c.is_ascii_alphabetic()).unwrap_or(speed.len());
    // Units are written apart from their value elsewhere; here a blank would need quotes.
    let spaced = format!("{} {}", speed[..digits].trim(), speed[digits..].trim());
    let speed_rpm = parse(Kind::Speed, spaced.trim()).map_err(|error| error.to_string())?;
    if !(opening > 0.0 && opening <= 2.5 && speed_rpm > 0.0) {
        return Err(form());
    }
    Ok(OperatingPoint { speed_rpm, valve_opening_ratio: opening })
}

/// `mapper run`.
#[derive(Debug, Args)]
pub struct RunArguments {
    /// Campaign file (YAML)
    pub campaign: PathBuf,
    /// Run this stored plan instead of making one; refused when campaign or model have changed since
    #[arg(long, value_name = "FILE")]
    pub plan: Option<PathBuf>,
    /// Show the plan and what would be written, and touch nothing
    #[arg(long)]
    pub dry_run: bool,
    /// Directory for the run's own directory, instead of the campaign's `outputs.directory`
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    /// End with one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// `mapper identify`.
#[derive(Debug, Args)]
pub struct IdentifyArguments {
    /// Run directory, or MCAP file
    pub recording: PathBuf,
    /// Where a recording made by another program holds the rig's channels (YAML)
    #[arg(long, value_name = "FILE")]
    pub channels: Option<PathBuf>,
    /// Campaign that says machine, sensors and window, instead of the one attached to the recording
    #[arg(long, value_name = "FILE")]
    pub campaign: Option<PathBuf>,
    /// How to identify [default: the campaign's method, or dynamic]
    #[arg(long, value_enum)]
    pub method: Option<MethodArgument>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// `mapper drift`.
#[derive(Debug, Args)]
pub struct DriftArguments {
    /// Run directories in the order in which they were made; with `--recording`, the one campaign of the recordings
    #[arg(required = true, value_name = "RUN|CAMPAIGN")]
    pub paths: Vec<PathBuf>,
    /// MCAP recording, also of another program; may be given more than once, in the order in which they were made
    #[arg(long, value_name = "FILE")]
    pub recording: Vec<PathBuf>,
    /// Where recordings made by another program hold the rig's channels (YAML)
    #[arg(long, value_name = "FILE", requires = "recording")]
    pub channels: Option<PathBuf>,
    /// Write the points without the drift into this new CSV file
    #[arg(long, value_name = "FILE")]
    pub corrected: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// `mapper nightly`.
#[derive(Debug, Args)]
pub struct NightlyArguments {
    /// Nightly campaign (YAML): campaigns, methods, seeds
    pub nightly: PathBuf,
    /// History to compare with and append to, instead of the file's `history`
    #[arg(long, value_name = "FILE")]
    pub db: Option<PathBuf>,
    /// What moves tonight is right: begin a new band with this night
    #[arg(long)]
    pub accept: bool,
    /// Runs at a time [default: all cores]
    #[arg(long, value_name = "COUNT")]
    pub jobs: Option<usize>,
    /// End with one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// `mapper history`.
#[derive(Debug, Args)]
pub struct HistoryArguments {
    /// The history
    #[arg(long, value_name = "FILE", default_value = "runs/history.db")]
    pub db: PathBuf,
    /// Only this machine, or campaign
    #[arg(long, value_name = "NAME")]
    pub machine: Option<String>,
    /// Only this method
    #[arg(long, value_name = "METHOD")]
    pub method: Option<String>,
    /// Show this figure instead of the usual ones; may be given more than once
    #[arg(long, value_name = "FIGURE", value_parser = figure)]
    pub figure: Vec<Metric>,
    /// Only nights from this day on (UTC)
    #[arg(long, value_name = "YYYY-MM-DD", value_parser = day)]
    pub since: Option<jiff::Timestamp>,
    /// A row for each run, instead of the medians over the seeds
    #[arg(long)]
    pub runs: bool,
    /// Draw the trends into this new SVG file
    #[arg(long, value_name = "FILE")]
    pub svg: Option<PathBuf>,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

fn figure(text: &str) -> Result<Metric, String> {
    Metric::find(text).ok_or_else(|| {
        let names: Vec<&str> = Metric::ALL.into_iter().map(Metric::name).collect();
        format!("there is no figure `{text}`; there are {}", names.join(", "))
    })
}

/// Midnight UTC at the begin of a day.
fn day(text: &str) -> Result<jiff::Timestamp, String> {
    let day: jiff::civil::Date = text.parse().map_err(|error| format!("{error}; write e.g. 2026-11-21"))?;
    let midnight = day.to_zoned(jiff::tz::TimeZone::UTC).map_err(|error| error.to_string())?;
    Ok(midnight.timestamp())
}

/// `mapper reproduce`.
#[derive(Debug, Args)]
pub struct ReproduceArguments {
    /// Directory for `reproduction.md` and the pictures; files of an earlier reproduction there are replaced
    #[arg(long, value_name = "DIR", default_value = "reproduction")]
    pub out: PathBuf,
    /// Print what the paper states beside what came out as one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// Methods as written on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodArgument {
    /// Conventional: apparent efficiency from the temperature rise
    Steady,
    /// Efficiency and heat-transfer coefficient from the transient (Burke et al.)
    Dynamic,
    /// All points together: what they share is fitted over all of them
    Joint,
}

impl From<MethodArgument> for Method {
    fn from(argument: MethodArgument) -> Self {
        match argument {
            MethodArgument::Steady => Method::Steady,
            MethodArgument::Dynamic => Method::Dynamic,
            MethodArgument::Joint => Method::Joint,
        }
    }
}
