//! `mapper identify`: from recordings to points and a map, without a rig.

use crate::command_line::RecordingReading;
use crate::environment::registry;
use crate::output::failure::Failure;
use crate::output::{output_options, standard_output};
use crate::terminal::{DetailLevel, identified_text, results_text};
use clap::{Args, ValueEnum};
use mapper_core::Method;
use mapper_report::with_messages;
use mapper_session::{Recorded, Session};
use std::path::PathBuf;

/// Identify efficiency and heat transfer from run directories, MCAP recordings or logs of other programs
#[derive(Debug, Args)]
pub struct Identify {
    /// Run directory, MCAP file, or log of another program (see `mapper log inspect`); several of the same machine are identified together, each point once
    #[arg(required = true)]
    pub recordings: Vec<PathBuf>,
    /// Write the results of a run (points, map, pictures, report) to this directory; existing files are not replaced
    #[arg(long, value_name = "DIR")]
    pub out: Option<PathBuf>,
    #[command(flatten)]
    pub reading: RecordingReading,
    /// How to identify [default: the campaign's method, or joint]
    #[arg(long, value_enum)]
    pub method: Option<MethodArgument>,
    #[command(flatten)]
    pub shown: DetailLevel,
    /// Print one JSON object on standard output
    #[arg(long)]
    pub json: bool,
}

/// Size of a recording above which the screen says that it is read, bytes. Bound: reading takes more than a second.
const MIN_SHOWN_BYTES: u64 = 50_000_000;
/// Number of steps above which it says that they are identified. Bound: the same.
const MIN_SHOWN_STEPS: usize = 100;

/// The command that shows all details.
const FULL_COMMAND: &str = "the same command with `--full`";

impl Identify {
    pub fn run(&self) -> Result<(), Failure> {
        let (map, given) = self.reading.read()?;
        let registry = registry();
        let progress = output_options::progress();
        let read = |path: &PathBuf| {
            if std::fs::metadata(path).is_ok_and(|file| file.len() > MIN_SHOWN_BYTES) {
                progress.begin(&format!("reading {}", path.display()));
            }
            Recorded::read_run(&registry, path, &map, given.as_ref())
        };
        let runs = self.recordings.iter().map(read).collect::<Result<Vec<_>, _>>()?;
        let recorded: Vec<Recorded> = runs.into_iter().flatten().collect();
        let path = recorded.first().map(|first| first.path.clone());
        let warnings: Vec<String> =
            recorded.iter().flat_map(|one| &one.read.warnings).map(ToString::to_string).collect();
        let campaign = recorded.first().and_then(|first| first.campaign.as_ref());
        let display = campaign.map(|campaign| campaign.display.clone()).unwrap_or_default();
        let method = self.method.map(Method::from);
        let session = Session::new(&registry);
        let steps: usize = recorded.iter().map(|one| one.read.recording.steps.len()).sum();
        if steps > MIN_SHOWN_STEPS {
            progress.begin(&format!("identifying {steps} steps"));
        }
        if let Some(directory) = &self.out {
            let results = session.identify_into(recorded, &map, method, directory)?;
            progress.clear();
            return match self.json {
                true => standard_output::print_json(&results),
                false => standard_output::show(&results_text(&display, &results, FULL_COMMAND, self.shown)),
            };
        }
        let identified = session.identify(recorded, &map, method)?;
        progress.clear();
        identified.has_points(&warnings)?;
        match self.json {
            true => {
                standard_output::print_json(&with_messages(|| identified.json(path.as_deref(), &warnings)))
            }
            false => standard_output::show(&identified_text(
                &display,
                &identified,
                FULL_COMMAND,
                &warnings,
                self.shown,
            )),
        }
    }
}

/// Methods as written on the command line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum MethodArgument {
    /// Conventional: apparent efficiency from the temperature rise
    Steady,
    /// Efficiency and heat-transfer coefficient from the transient (Burke et al.)
    Dynamic,
    /// All points together, with common parameters
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
