//! Errors as Python exceptions, with the message that the command prints.

use mapper::{Error, Input};
use mapper_session::SessionError;
use pyo3::exceptions::PyException;
use pyo3::{PyErr, create_exception};

create_exception!(mapper, MapperError, PyException, "Base class of all errors of `mapper`.");
create_exception!(
    mapper,
    CampaignError,
    MapperError,
    "A campaign cannot be read, has mistakes, or has no plan; the message shows line and caret."
);
create_exception!(
    mapper,
    RecordingError,
    MapperError,
    "A recording or its channel map cannot be read; the message shows line and caret of the channel map."
);
create_exception!(
    mapper,
    IdentificationError,
    MapperError,
    "A recording does not contain the required data."
);

/// A fault of a request, on its way to Python.
#[derive(Debug)]
pub enum Fault {
    /// Of the library.
    Library(Error),
    /// An argument is wrong, or the rig.
    Argument(String),
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        Fault::Library(error)
    }
}

impl From<SessionError> for Fault {
    fn from(error: SessionError) -> Self {
        Fault::Library(error.into())
    }
}

impl From<Fault> for PyErr {
    fn from(fault: Fault) -> Self {
        let error = match fault {
            Fault::Library(error) => error,
            Fault::Argument(message) => return MapperError::new_err(message),
        };
        let message = error.to_string();
        match error.input() {
            Some(Input::Campaign) => CampaignError::new_err(message),
            Some(Input::Recording) => RecordingError::new_err(message),
            Some(Input::RecordedData) => IdentificationError::new_err(message),
            _ => MapperError::new_err(message),
        }
    }
}
