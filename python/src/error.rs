//! Errors of a session as Python exceptions, with the message that the command prints.

use mapper_campaign::CampaignError as CampaignFault;
use mapper_recording::{ChannelMapError, RecordError};
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
    /// Of the session.
    Session(SessionError),
    /// Of a session that has to do with a campaign's text, which shows the place of a mistake.
    InCampaign(CampaignFault),
    /// An argument is wrong, or the rig.
    Argument(String),
}

impl From<SessionError> for Fault {
    fn from(error: SessionError) -> Self {
        Fault::Session(error)
    }
}

impl From<Fault> for PyErr {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::Session(error) => of_session(error),
            Fault::InCampaign(error) => of_campaign(&error),
            Fault::Argument(message) => MapperError::new_err(message),
        }
    }
}

/// A campaign's mistakes, each with its line.
pub fn of_campaign(error: &CampaignFault) -> PyErr {
    CampaignError::new_err(match error {
        CampaignFault::Mistakes(findings) => findings.render(false),
        CampaignFault::Read { .. } => error.to_string(),
    })
}

fn of_session(error: SessionError) -> PyErr {
    use SessionError as E;
    match &error {
        E::Campaign(error) => of_campaign(error),
        E::ChannelMap(ChannelMapError::Mistakes(findings)) | E::Record(RecordError::ChannelMap(findings)) => {
            RecordingError::new_err(findings.render(false))
        }
        E::ChannelMap(_)
        | E::Record(_)
        | E::Log(_)
        | E::LogOption(_)
        | E::SameRecording { .. }
        | E::NoRecording => RecordingError::new_err(error.to_string()),
        E::Identify(_)
        | E::NoPoints { .. }
        | E::OtherMachine(_)
        | E::MachineUnknown { .. }
        | E::DifferentCampaigns { .. }
        | E::Method(..)
        | E::Drift(_)
        | E::Driven(_)
        | E::Gap(_) => IdentificationError::new_err(error.to_string()),
        E::Model(_)
        | E::Plan(_)
        | E::NoSteps { .. }
        | E::Sequence(_)
        | E::Script(_)
        | E::Rehearsal(_)
        | E::RehearsalTripped { .. }
        | E::Backend(_)
        | E::Reader { .. }
        | E::FirstMap(_)
        | E::MissingGuards { .. }
        | E::GuardWithoutChannel { .. } => CampaignError::new_err(error.to_string()),
        _ => MapperError::new_err(error.to_string()),
    }
}
