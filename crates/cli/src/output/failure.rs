//! Why a command ended early, with what to print and what to return.

use crate::output::exit_code::Code;
use crate::output::terminal_lines::on_terminal;
use crate::output::{output_options, standard_error};
use mapper_campaign::{CampaignError, Findings, NightlyError};
use mapper_core::BackendError;
use mapper_driver_host::DriverError;
use mapper_fleet::{FleetError, StudyFileError};
use mapper_live::LiveError;
use mapper_recording::{ChannelMapError, RecordError};
use mapper_session::{DescriptionError, ErrorKind, MapWorkError, SessionError};
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
    /// Mistakes of a file, for programs.
    findings: Option<Value>,
    manner: Manner,
}

/// How a failure is reported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Manner {
    /// In a sentence behind "mapper: ".
    Sentence,
    /// The message has its own layout (a rendered list of mistakes).
    Rendered,
    /// It has been reported already; only the exit code remains.
    Printed,
    /// The reader of standard output went away: a normal end without a message.
    ClosedPipe,
}

impl Failure {
    /// A failure with a message that completes "mapper: ".
    pub fn new(code: Code, message: impl std::fmt::Display) -> Self {
        Failure { code, message: message.to_string(), findings: None, manner: Manner::Sentence }
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
        Failure {
            code: Code::BadInput,
            message: findings.render(output_options::warns_in_colour()),
            findings: Some(json!(findings.list)),
            manner: Manner::Rendered,
        }
    }

    /// An error of a session that has to do with a campaign file: a mistake in the backend's settings or in the formats of
    /// the map is shown in its text.
    pub fn in_campaign(error: SessionError, campaign: &Path) -> Self {
        let Ok(text) = mapper_campaign::read_text(campaign) else { return error.into() };
        let findings = match &error {
            SessionError::Backend(BackendError::Settings { backend, path, source }) => {
                let hidden = matches!(source.downcast_ref(), Some(DriverError::Secret));
                let at = format!("backend.{backend}");
                mapper_campaign::backend_mistake(&text, campaign, &at, path, &source.to_string(), hidden)
            }
            SessionError::Reader { at, setting, source } => {
                let hidden = matches!(source.downcast_ref(), Some(DriverError::Secret));
                mapper_campaign::backend_mistake(&text, campaign, at, setting, &source.to_string(), hidden)
            }
            SessionError::UnknownFormat { name, known } => {
                mapper_campaign::format_mistake(&text, campaign, name, known)
            }
            _ => return error.into(),
        };
        Failure::of_campaign(CampaignError::Mistakes(Box::new(findings)))
    }

    /// The live page cannot be had.
    pub fn of_live(error: LiveError) -> Self {
        let code = if matches!(error, LiveError::Address { .. }) { Code::BadInput } else { Code::Failure };
        Failure::new(code, error)
    }

    /// What a kind of study found, as the command of its own says it.
    fn of_kind(error: Box<dyn std::error::Error + Send + Sync>) -> Self {
        let error = match error.downcast::<CampaignError>() {
            Ok(error) => return Failure::of_campaign(*error),
            Err(error) => error,
        };
        let error = match error.downcast::<NightlyError>() {
            Ok(error) => return SessionError::from(*error).into(),
            Err(error) => error,
        };
        let error = match error.downcast::<SessionError>() {
            Ok(error) => return (*error).into(),
            Err(error) => error,
        };
        match error.downcast::<BlindError>() {
            Ok(error) => (*error).into(),
            Err(error) => Failure::new(Code::BadInput, error),
        }
    }

    /// Standard output was closed by its reader: a normal end of a pipe.
    pub fn closed_pipe() -> Self {
        Failure { manner: Manner::ClosedPipe, ..Failure::new(Code::Failure, "") }
    }

    /// A failure whose message is in the JSON on standard output.
    pub fn printed(code: Code) -> Self {
        Failure { manner: Manner::Printed, ..Failure::new(code, "") }
    }

    /// Prints the message to standard error and gives the exit code; `None` if the reader went away: a normal end.
    pub fn say(&self) -> Option<ExitCode> {
        match self.manner {
            Manner::ClosedPipe => return None,
            Manner::Printed => {}
            Manner::Rendered => standard_error::say_rendered(&self.message),
            Manner::Sentence => {
                let sentence = format!("mapper: {}\n", shortened(&self.message));
                standard_error::say(&on_terminal(&sentence, terminal_size_of(std::io::stderr())));
            }
        }
        Some(ExitCode::from(self.code as u8))
    }

    /// Code, message, and what to do: the text behind the message's last semicolon, or with the first mistake.
    pub fn json(&self) -> Value {
        let first = self.findings.as_ref().and_then(|findings| findings.get(0));
        let (message, help) = match first {
            Some(first) => (first["message"].clone(), first["remedy"].clone()),
            None => (json!(self.message), json!(self.message.rsplit_once("; ").map(|(_, help)| help))),
        };
        let mut value = json!({ "code": self.code as u8, "message": message, "help": help });
        if let Some(findings) = &self.findings {
            value["findings"] = findings.clone();
        }
        value
    }
}

/// Longest message, letters: a file can bring ten thousand names into one.
const MESSAGE_LIMIT: usize = 4000;

/// A message that fits a few screens. No colour in it is ours.
fn shortened(message: &str) -> String {
    let message = message.replace('\u{1b}', "\u{fffd}");
    match message.char_indices().nth(MESSAGE_LIMIT) {
        None => message,
        Some((end, _)) => format!("{} ... (and {} bytes more)", &message[..end], message.len() - end),
    }
}

impl From<SessionError> for Failure {
    fn from(error: SessionError) -> Self {
        let code = match error.kind() {
            ErrorKind::Failure => Code::Failure,
            ErrorKind::BadInput => Code::BadInput,
            ErrorKind::NoPlan => Code::NoPlan,
            ErrorKind::Rig => Code::Rig,
            ErrorKind::BadRecording => Code::BadRecording,
            ErrorKind::Interrupted => Code::Interrupted,
        };
        match error {
            SessionError::Exists { .. } if output_options::replaces() => {
                Failure::new(code, format!("{error}, or replace it with `--force`"))
            }
            SessionError::Campaign(error) => Failure::of_campaign(error),
            SessionError::Nightly(NightlyError::Mistakes(findings))
            | SessionError::ChannelMap(ChannelMapError::Mistakes(findings))
            | SessionError::MapWork(MapWorkError::Description(DescriptionError::Mistakes(findings)))
            | SessionError::Record(RecordError::ChannelMap(findings)) => Failure::of_findings(&findings),
            error => Failure::new(code, error),
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
            FleetError::File { .. } | FleetError::Queue { .. } | FleetError::NothingTried { .. } => {
                Code::Failure
            }
            FleetError::Interrupted => Code::Interrupted,
            _ => Code::BadInput,
        };
        match error {
            FleetError::StudyFile(StudyFileError::Mistakes(findings)) => Failure::of_findings(&findings),
            FleetError::StudyFile(error) => Failure::new(Code::Failure, error),
            FleetError::Kind(error) => Failure::of_kind(error),
            error => Failure::new(code, error),
        }
    }
}
