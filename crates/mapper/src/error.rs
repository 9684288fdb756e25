//! The one error of this crate.

use mapper_campaign::CampaignError;
use mapper_core::BackendError;
use mapper_driver_host::DriverError;
use mapper_session::{ErrorKind, Input, SessionError};
use std::fmt;
use std::path::Path;

/// Why a request failed. [`kind`](Error::kind) is what a program decides by; the text is for people: it names values and units and says
/// what to do. Mistakes in a file are shown with line and caret.
pub struct Error(Box<SessionError>);

impl Error {
    /// Category of the error, by which the command line sets its exit code.
    pub fn kind(&self) -> ErrorKind {
        self.0.kind()
    }

    /// The input that the error is about, by which the Python package chooses its exception; `None` for anything else.
    pub fn input(&self) -> Option<Input> {
        self.0.input()
    }
}

impl From<SessionError> for Error {
    fn from(error: SessionError) -> Self {
        Error(Box::new(error))
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0.findings() {
            Some(findings) => f.write_str(&findings.render(false)),
            None => self.0.fmt(f),
        }
    }
}

/// The text for people, because `main` prints an error it returns in this form.
impl fmt::Debug for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl std::error::Error for Error {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.0.source()
    }
}

/// Shows a mistake in the backend's settings or in the map formats at its place in the campaign's text. Other errors stay as they are.
pub fn show_in_campaign(error: SessionError, text: &str, origin: &Path) -> SessionError {
    let is_secret =
        |source: &mapper_core::BackendCause| matches!(source.downcast_ref(), Some(DriverError::Secret));
    let findings = match &error {
        SessionError::Backend(BackendError::Settings { backend, path, source }) => {
            let at = format!("backend.{backend}");
            let message = source.to_string();
            mapper_campaign::backend_mistake(text, origin, &at, path, &message, is_secret(source))
        }
        SessionError::Reader { at, setting, source } => {
            let message = source.to_string();
            mapper_campaign::backend_mistake(text, origin, at, setting, &message, is_secret(source))
        }
        SessionError::UnknownFormat { name, known } => {
            mapper_campaign::format_mistake(text, origin, name, known)
        }
        _ => return error,
    };
    CampaignError::Mistakes(Box::new(findings)).into()
}
