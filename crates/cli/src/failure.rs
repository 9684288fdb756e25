//! Why a command ended early, with what to print and what to return.

use crate::exit_code::Code;
use mapper_campaign::CampaignError;
use std::io::IsTerminal;
use std::process::ExitCode;

/// A command's error: a message for people and an exit code for scripts.
#[derive(Debug)]
pub struct Failure {
    code: Code,
    message: String,
    /// The message says everything, in its own layout (a rendered list of mistakes).
    rendered: bool,
    /// The reader of standard output went away; there is nobody to tell.
    silent: bool,
}

impl Failure {
    /// A failure with a message that completes "mapper: ".
    pub fn new(code: Code, message: impl std::fmt::Display) -> Self {
        Failure { code, message: message.to_string(), rendered: false, silent: false }
    }

    /// All mistakes of a campaign, or that it cannot be read.
    pub fn of_campaign(error: CampaignError) -> Self {
        match error {
            CampaignError::Mistakes(findings) => Failure {
                code: Code::BadInput,
                message: findings.render(std::io::stderr().is_terminal()),
                rendered: true,
                silent: false,
            },
            error => Failure::new(Code::Failure, error),
        }
    }

    /// Standard output was closed by its reader: a normal end of a pipe.
    pub fn closed_pipe() -> Self {
        Failure { silent: true, ..Failure::new(Code::Failure, "") }
    }

    /// What went wrong.
    pub fn message(&self) -> &str {
        &self.message
    }

    /// Prints the message and gives the exit code.
    #[allow(clippy::print_stderr)]
    pub fn report(&self) -> ExitCode {
        if self.silent {
            return ExitCode::SUCCESS;
        }
        if self.rendered {
            eprint!("{}", self.message);
        } else {
            eprintln!("mapper: {}", self.message);
        }
        ExitCode::from(self.code as u8)
    }
}
