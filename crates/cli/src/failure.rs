//! Why a command ended early, with what to print and what to return.

use crate::exit_code::Code;
use mapper_campaign::{Campaign, CampaignError};
use mapper_core::BackendError;
use std::io::IsTerminal;
use std::path::Path;
use std::process::ExitCode;

/// A command's error: a message for people and an exit code for scripts.
#[derive(Debug)]
pub struct Failure {
    code: Code,
    message: String,
    manner: Manner,
}

/// How a failure is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Manner {
    /// In a sentence behind "mapper: ".
    Sentence,
    /// The message has its own layout (a rendered list of mistakes).
    Rendered,
    /// It has been told already; the exit code is left.
    Told,
    /// The reader of standard output went away: a normal end, there is nobody to tell.
    ClosedPipe,
}

impl Failure {
    /// A failure with a message that completes "mapper: ".
    pub fn new(code: Code, message: impl std::fmt::Display) -> Self {
        Failure { code, message: message.to_string(), manner: Manner::Sentence }
    }

    /// All mistakes of a campaign, or that it cannot be read.
    pub fn of_campaign(error: CampaignError) -> Self {
        match error {
            CampaignError::Mistakes(findings) => Failure {
                code: Code::BadInput,
                message: findings.render(std::io::stderr().is_terminal()),
                manner: Manner::Rendered,
            },
            error => Failure::new(Code::Failure, error),
        }
    }

    /// A backend that could not be made: a mistake in its settings is shown in the campaign's text.
    pub fn of_backend(error: &BackendError, campaign: &Path) -> Self {
        let BackendError::Settings { backend, path, message } = error else {
            return Failure::new(Code::BadInput, error);
        };
        match std::fs::read_to_string(campaign) {
            Ok(text) => {
                let findings = mapper_campaign::backend_mistake(&text, campaign, backend, path, message);
                Failure::of_campaign(CampaignError::Mistakes(Box::new(findings)))
            }
            Err(_) => Failure::new(Code::BadInput, error),
        }
    }

    /// Formats of the map that the campaign asks for and nobody writes, at their place in its text.
    pub fn check_formats(of: &Campaign, campaign: &Path) -> Result<(), Self> {
        let known: Vec<&str> = mapper_exporters::EXPORTERS.iter().map(|format| format.name).collect();
        let Some(format) = of.outputs.formats.iter().find(|format| !known.contains(&format.name())) else {
            return Ok(());
        };
        let text = std::fs::read_to_string(campaign).unwrap_or_default();
        let findings = mapper_campaign::format_mistake(&text, campaign, format, &known);
        Err(Failure::of_campaign(CampaignError::Mistakes(Box::new(findings))))
    }

    /// Standard output was closed by its reader: a normal end of a pipe.
    pub fn closed_pipe() -> Self {
        Failure { manner: Manner::ClosedPipe, ..Failure::new(Code::Failure, "") }
    }

    /// What went wrong stands in the JSON on standard output.
    pub fn told(code: Code) -> Self {
        Failure { manner: Manner::Told, ..Failure::new(code, "") }
    }

    /// What went wrong.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// Prints the message and gives the exit code.
    #[allow(clippy::print_stderr)]
    pub fn report(&self) -> ExitCode {
        match self.manner {
            Manner::ClosedPipe => return ExitCode::SUCCESS,
            Manner::Told => {}
            Manner::Rendered => eprint!("{}", self.message),
            Manner::Sentence => eprintln!("mapper: {}", self.message),
        }
        ExitCode::from(self.code as u8)
    }
}
