//! Failures of commands: message, remedy, and exit code.

use crate::output::output_options;
use crate::output::standard_error::{say, say_rendered, wrap_for_terminal};
use mapper_campaign::{CampaignError, Findings, NightlyError};
use mapper_core::{ExportError, ImportError};
use mapper_fleet::{FleetError, StudyFileError};
use mapper_history::HistoryError;
use mapper_live::LiveError;
use mapper_recording::RecordError;
use mapper_session::{
    ErrorKind, FirstMapError, FmuExportError, MapWorkError, SessionError, SessionError as E,
};
use mapper_validation::blind::BlindError;
use serde_json::{Value, json};
use std::path::Path;
use std::process::ExitCode;
use terminal_size::terminal_size_of;

/// A command's error: a message for people and an exit code for scripts.
#[derive(Debug)]
pub struct Failure {
    code: Code,
    message: String,
    command: Option<String>,
    findings: Option<Value>,
    presentation: Presentation,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Presentation {
    Sentence,
    /// The message has its own layout (a rendered list of mistakes).
    Rendered,
    /// It has been reported already; only the exit code remains.
    Printed,
    /// Standard output was closed by its reader: a normal end without a message.
    ClosedPipe,
}

impl Failure {
    /// A failure with a message that completes "mapper: ".
    pub fn new(code: Code, message: impl std::fmt::Display) -> Self {
        Failure {
            code,
            message: message.to_string(),
            command: None,
            findings: None,
            presentation: Presentation::Sentence,
        }
    }

    fn with_command(code: Code, error: &dyn std::fmt::Display, command: Option<String>) -> Self {
        let shown = command.as_ref().map(|command| format!(" ({command})")).unwrap_or_default();
        Failure { command, ..Failure::new(code, format!("{error}{shown}")) }
    }

    /// All mistakes of a campaign, or that it cannot be read.
    pub fn of_campaign(error: CampaignError) -> Self {
        match error {
            CampaignError::Mistakes(findings) => Failure::of_findings(&findings),
            error => Failure::new(Code::Failure, error),
        }
    }

    fn of_findings(findings: &Findings) -> Self {
        let message = findings.render(output_options::is_stderr_coloured());
        Failure {
            findings: Some(json!(findings.list)),
            presentation: Presentation::Rendered,
            ..Failure::new(Code::BadInput, message)
        }
    }

    /// A session error that concerns a campaign file. A mistake in the backend settings or in the map formats is shown at its line.
    pub fn in_campaign(error: SessionError, campaign: &Path) -> Self {
        let Ok(text) = mapper_campaign::read_text(campaign) else { return error.into() };
        mapper::show_in_campaign(error, &text, campaign).into()
    }

    /// The live page is not available.
    pub fn of_live(error: LiveError) -> Self {
        match error {
            LiveError::Session(error) => error.into(),
            LiveError::Listen(..) => {
                let command = "`run --live=ADDRESS`, `studio --address ADDRESS`".to_owned();
                Failure::with_command(Code::Failure, &error, Some(command))
            }
            error => Failure::new(Code::Failure, error),
        }
    }

    fn of_kind(error: Box<dyn std::error::Error + Send + Sync>) -> Self {
        let error = match error.downcast::<CampaignError>() {
            Ok(error) => return Failure::of_campaign(*error),
            Err(error) => error,
        };
        let error = match error.downcast::<NightlyError>() {
            Ok(error) => return SessionError::from(*error).into(),
            Err(error) => error,
        };
        error.downcast::<SessionError>().map_or_else(
            |error| match error.downcast::<BlindError>() {
                Ok(error) => (*error).into(),
                Err(error) => Failure::new(Code::BadInput, error),
            },
            |error| (*error).into(),
        )
    }

    /// Standard output was closed by its reader: a normal end of a pipe.
    pub fn closed_pipe() -> Self {
        Failure { presentation: Presentation::ClosedPipe, ..Failure::new(Code::Failure, "") }
    }

    /// A failure whose message is in the JSON on standard output.
    pub fn printed(code: Code) -> Self {
        Failure { presentation: Presentation::Printed, ..Failure::new(code, "") }
    }

    /// Prints the message to standard error and returns the exit code; `None` after a closed pipe, which is a normal end.
    pub fn report(&self) -> Option<ExitCode> {
        match self.presentation {
            Presentation::ClosedPipe => return None,
            Presentation::Printed => {}
            Presentation::Rendered => say_rendered(&self.message),
            Presentation::Sentence => {
                let sentence = format!("mapper: {}\n", shorten(&self.message));
                say(&wrap_for_terminal(&sentence, terminal_size_of(std::io::stderr())));
            }
        }
        Some(ExitCode::from(self.code as u8))
    }

    /// Code, message, and help: the remedy of the first mistake, or the command that helps.
    pub fn json(&self) -> Value {
        let (message, help) = match self.findings.as_ref().and_then(|findings| findings.get(0)) {
            Some(first) => (first["message"].clone(), first["remedy"].clone()),
            None => (json!(self.message), json!(self.command)),
        };
        let mut value = json!({ "code": self.code as u8, "message": message, "help": help });
        if let Some(findings) = &self.findings {
            value["findings"] = findings.clone();
        }
        value
    }
}

/// Maximum length of a message, characters: a file could put thousands of names into one.
const MAX_MESSAGE_CHARS: usize = 4000;

fn shorten(message: &str) -> String {
    match message.char_indices().nth(MAX_MESSAGE_CHARS) {
        None => message.to_owned(),
        Some((end, _)) => format!("{} ... (and {} bytes more)", &message[..end], message.len() - end),
    }
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        let code = match error.kind() {
            ErrorKind::BadInput => Code::BadInput,
            ErrorKind::NoPlan => Code::NoPlan,
            ErrorKind::Rig => Code::Rig,
            ErrorKind::BadRecording => Code::BadRecording,
            ErrorKind::Interrupted => Code::Interrupted,
            _ => Code::Failure,
        };
        match error {
            SessionError::Exists(_) if output_options::has_force() => {
                Failure::new(code, format!("{error}, or replace it with `--force`"))
            }
            error => match error.findings() {
                Some(findings) => Failure::of_findings(findings),
                None => Failure::with_command(code, &error, command_for(&error)),
            },
        }
    }
}

impl From<BlindError> for Failure {
    fn from(error: BlindError) -> Self {
        let code = match error {
            BlindError::Content { .. }
            | BlindError::TooLarge { .. }
            | BlindError::Seal { .. }
            | BlindError::UnknownCause { .. }
            | BlindError::CauseRange { .. }
            | BlindError::CauseParameters { .. }
            | BlindError::Cases { .. } => Code::BadInput,
            _ => Code::Failure,
        };
        Failure::new(code, error)
    }
}

impl From<FleetError> for Failure {
    fn from(error: FleetError) -> Self {
        let code = match &error {
            FleetError::File { .. } | FleetError::Queue { .. } | FleetError::UnknownCost(_) => Code::Failure,
            FleetError::Interrupted => Code::Interrupted,
            _ => Code::BadInput,
        };
        match error {
            FleetError::StudyFile(StudyFileError::Mistakes(findings)) => Failure::of_findings(&findings),
            FleetError::StudyFile(error) => Failure::new(Code::Failure, error),
            FleetError::Kind(error) => Failure::of_kind(error),
            error => Failure::with_command(code, &error, fleet_command_for(&error)),
        }
    }
}

/// Exit codes, stable for scripts; `mapper --help` lists them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u8)]
pub enum Code {
    /// A file could not be read or written, or the program is at fault.
    Failure = 1,
    // 2 is clap's: wrong arguments.
    /// The campaign or another input file has mistakes; all of them were printed.
    BadInput = 3,
    /// There is no plan, or the plan given is stale.
    NoPlan = 4,
    /// The rig failed or a guard tripped; the rig is safe and the recording is kept.
    Rig = 5,
    /// The recording lacks data that identification needs.
    BadRecording = 6,
    /// A nightly run failed, or a metric is outside the band of the nights before.
    Moved = 7,
    /// Items of a fleet are missing or failed.
    Incomplete = 8,
    /// Stopped by the operator; the rig is safe and the recording is kept.
    Interrupted = 130,
}

/// The table of exit codes for `--help`.
pub const HELP: &str = "\
Exit codes:
  0    done
  1    a file could not be read or written, or the program has a defect
  2    wrong arguments
  3    the campaign or another input file has mistakes (all are printed)
  4    no plan is possible, or the given plan is stale
  5    the rig failed, a guard tripped, or the rig is in use, locked out or without its required guards; the recording is kept
  6    the recording lacks data that identification needs
  7    a nightly run failed, or a metric is outside the band of the nights before
  8    items of a fleet are missing or failed (all are listed)
  130  stopped by the operator; the rig is safe, the recording is kept";

/// The command or option for the remedy in the error's message; `None` if there is none.
pub fn command_for(error: &E) -> Option<String> {
    let fixed = match error {
        E::RigAbandoned { rig, run, .. } => {
            let acknowledge = acknowledge_command(rig);
            return Some(format!("`mapper run --resume {}`, or {acknowledge}", run.display()));
        }
        E::RigLockedOut { rig, .. } => return Some(acknowledge_command(rig)),
        E::DifferentCampaigns { .. } | E::MachineUnknown { channel_map_suffices: false } => {
            "`--campaign FILE`"
        }
        E::MachineUnknown { channel_map_suffices: true } => "`--campaign FILE`, or `--channels FILE`",
        E::Record(RecordError::LogWithoutMap { path }) => {
            let log = path.display();
            return Some(format!(
                "`--channels FILE`; `mapper log inspect {log} --write-channels FILE` proposes a channel map"
            ));
        }
        E::LostSteps { run, .. } => {
            return Some(format!("`mapper run --resume {} --repeat-lost`", run.display()));
        }
        E::StalePlan { .. } | E::InvalidPlan { .. } => "`mapper plan CAMPAIGN --out FILE`",
        E::StoredDiagnosis { .. } => "`mapper gap diagnose --out FILE`",
        E::UnknownOutputFormat { .. } => "`--to FORMAT`",
        E::FirstMap(error) if matches!(**error, FirstMapError::NotAMap(..)) => "`mapper map convert`",
        E::Fmu(FmuExportError::Platform | FmuExportError::Compiler { .. }) => "without `--compile`",
        E::MapWork(MapWorkError::NotMeasured(_)) => "`mapper map inspect`",
        E::MapWork(MapWorkError::NoDefinition) => "`--efficiency DEFINITION`",
        E::Import(_, source) => match source {
            ImportError::NoUnit { .. } | ImportError::FlowUnit => "`--with KEY=VALUE`",
            ImportError::RelativeSpeed { .. } | ImportError::DesignSpeedUnused { .. } => "`--design-speed`",
            ImportError::NoReference | ImportError::ReferenceConflict { .. } => "`--reference`",
            _ => return None,
        },
        E::Export(ExportError::NeedsFit { .. }) => "`mapper map fit FILE --out NEW`",
        E::History(HistoryError::Missing(_)) => "`mapper nightly`, or `--db FILE`",
        E::History(HistoryError::Foreign { .. } | HistoryError::ReadOnly(_) | HistoryError::NoSpace(_)) => {
            "`--db FILE`"
        }
        _ => return None,
    };
    Some(fixed.to_owned())
}

/// As [`command_for`], for an error of a fleet directory.
pub fn fleet_command_for(error: &FleetError) -> Option<String> {
    Some(match error {
        FleetError::NoStudy(_) | FleetError::Changed(_) => {
            "`mapper fleet make STUDY.yaml --out DIR`".to_owned()
        }
        FleetError::NoItem(_) => "`mapper fleet status DIR --items`".to_owned(),
        FleetError::NothingLeft { directory, .. } => format!("`mapper fleet merge {}`", directory.display()),
        FleetError::NotSubmitted(_) => "`mapper fleet submit`".to_owned(),
        FleetError::StillQueued { .. } => "`mapper fleet retry`".to_owned(),
        _ => return None,
    })
}

fn acknowledge_command(rig: &str) -> String {
    let plain = !rig.is_empty() && rig.chars().all(|c| c.is_alphanumeric() || "-_./:@".contains(c));
    let quoted = if plain { rig.to_owned() } else { format!("'{}'", rig.replace('\'', r"'\''")) };
    format!("`mapper rig acknowledge {quoted}`")
}
