//! Identification of recordings.

use crate::campaign::Campaign;
use crate::error::Error;
use crate::recording::Recording;
use mapper_core::{CompressorMap, IdentifiedPoint, Method, ResultRemark, TurbineMap, TurbinePoint};
use mapper_report::{Message, with_messages};
use mapper_session::{Identified, Recorded, Session, SessionError, compressor_map};
use serde_json::Value;
use std::path::PathBuf;

/// Points of one recording or of several, with everything that was identified. [`details`](Identification::details) has the zero, the fused
/// sensors, the uncertainty budgets and, on a simulated rig, the errors against the truth.
#[derive(Clone)]
pub struct Identification {
    details: Identified,
    machine: String,
    first_file: Option<PathBuf>,
    warnings: Vec<String>,
}

/// Identifies all steps of recordings of one machine together. `campaign`: in place of the recordings' own; without either, the channel
/// map defines the machine. `method`: in place of the campaign's.
///
/// # Errors
/// If the recordings do not belong together, no machine is known, or data that the method needs are missing.
pub fn identify(
    recordings: &[Recording],
    campaign: Option<&Campaign>,
    method: Option<Method>,
) -> Result<Identification, Error> {
    let first = recordings.first().ok_or(SessionError::NoRecording)?;
    let channels = &first.contents.channels;
    if recordings.iter().any(|recording| recording.contents.channels != *channels) {
        return Err(SessionError::DifferentChannelMaps.into());
    }
    let parts = recordings.iter().map(|recording| recording.described_by(campaign));
    let recorded = parts.collect::<Result<Vec<_>, _>>()?.concat();
    let described = Described::of(&recorded);
    let found = Session::new(&first.plugins).identify(recorded, channels, method)?;
    found.has_points(&described.warnings)?;
    Ok(described.identification(found))
}

impl Recording {
    /// Identifies efficiency and heat transfer of every step, with the machine and the sensors of this campaign.
    ///
    /// # Errors
    /// If the recording is of another machine, or data that the method needs are missing.
    pub fn identify(&self, campaign: &Campaign) -> Result<Identification, Error> {
        identify(std::slice::from_ref(self), Some(campaign), None)
    }
}

pub(crate) struct Described {
    machine: String,
    first_file: Option<PathBuf>,
    warnings: Vec<String>,
}

impl Described {
    pub(crate) fn of(recorded: &[Recorded]) -> Described {
        let first = recorded.first();
        // Name of the machine: the campaign's, or the file's.
        let named =
            |part: &Recorded| part.path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let machine = |part: &Recorded| {
            part.campaign.as_ref().map_or_else(|| named(part), |campaign| campaign.machine.name.clone())
        };
        let warnings = recorded.iter().flat_map(|part| &part.read.warnings);
        Described {
            machine: first.map(machine).unwrap_or_default(),
            first_file: first.map(|part| part.path.clone()),
            warnings: warnings.map(ToString::to_string).collect(),
        }
    }

    pub(crate) fn identification(self, details: Identified) -> Identification {
        let Described { machine, first_file, warnings } = self;
        Identification { details, machine, first_file, warnings }
    }
}

impl Identification {
    /// The points.
    pub fn points(&self) -> impl Iterator<Item = &IdentifiedPoint> {
        self.details.points_alone()
    }

    /// Everything that was identified.
    pub fn details(&self) -> &Identified {
        &self.details
    }

    /// The map of the points, with a fitted surface if there are enough of them.
    ///
    /// # Errors
    /// If the points make no map; the reasons are in the message.
    pub fn map(&self) -> Result<CompressorMap, Error> {
        let mut remarks = Vec::new();
        let map = compressor_map(&self.machine, &self.details, &mut remarks);
        map.ok_or_else(|| SessionError::NoMap(remarks_text(&remarks)).into())
    }

    /// The turbine at the points whose turbine side was measured.
    pub fn turbine_points(&self) -> impl Iterator<Item = &TurbinePoint> {
        self.details.turbine.iter().map(|scored| &scored.point)
    }

    /// The map of the turbine, with a fitted surface; `None` with fewer than four usable points.
    pub fn turbine_map(&self) -> Option<TurbineMap> {
        self.details.turbine_map(&self.machine)
    }

    /// The object that `mapper identify --json` prints.
    pub fn json(&self) -> Value {
        with_messages(|| self.details.json(self.first_file.as_deref(), &self.warnings))
    }
}

pub(crate) fn remarks_text(remarks: &[ResultRemark]) -> String {
    remarks.iter().map(Message::message).collect::<Vec<_>>().join("; ")
}
