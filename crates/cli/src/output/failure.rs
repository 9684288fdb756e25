//! Failures of commands, with message and exit code.

use crate::output::exit_code::Code;
use crate::output::remedy::{command_for, fleet_command_for};
use crate::output::terminal_lines::wrap_for_terminal;
use crate::output::{output_options, standard_error};
use mapper_campaign::{CampaignError, Findings, NightlyError};
use mapper_fleet::{FleetError, StudyFileError};
use mapper_live::LiveError;
use mapper_session::{ErrorKind, SessionError};
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
    /// The command for the remedy.
    command: Option<String>,
    /// Mistakes of a file, for programs.
    findings: Option<Value>,
    presentation: Presentation,
}

/// Presentation of a failure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Presentation {
    /// A sentence after "mapper: ".
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

    /// A library error with the command for its remedy, if there is one.
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

    /// All mistakes of a file that people write.
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
        let code = if matches!(error, LiveError::Address(_)) { Code::BadInput } else { Code::Failure };
        let command = matches!(error, LiveError::Listen(..)).then(|| "`--live=ADDRESS`".to_owned());
        Failure::with_command(code, &error, command)
    }

    /// An error of a kind of study, reported as by the command of that kind.
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
            Presentation::Rendered => standard_error::say_rendered(&self.message),
            Presentation::Sentence => {
                let sentence = format!("mapper: {}\n", shorten(&self.message));
                standard_error::say(&wrap_for_terminal(&sentence, terminal_size_of(std::io::stderr())));
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

/// Shortens a message to a few screens.
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
