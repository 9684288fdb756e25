//! Results in addition to the compressor map: thermal model, turbine, pictures of h and of errors.

use crate::recording::files::{Existing, json_text, write_files};
use crate::recording::recording_file::Recorded;
use crate::{Session, SessionError};
use mapper_chart::Figure;
use mapper_core::{ExportError, IdentifiedPoint, ThermalModel};
use mapper_recording::ChannelMap;
use mapper_report::{
    ThermalExport, TurbinePoint, error_figure, heat_transfer_figure, turbine_points, turbine_text,
};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// The written files and their contents.
#[derive(Debug, Serialize)]
pub struct RigFiles {
    /// The files.
    pub files: Vec<PathBuf>,
    /// The turbine at each point.
    pub turbine: Vec<TurbinePoint>,
    /// Parameters common to all points (joint method).
    pub thermal: Option<ThermalModel>,
}

impl Session<'_> {
    /// Identifies a recording by its campaign's method and writes the files to `out`. Creates the directory if missing.
    ///
    /// # Errors
    /// [`SessionError`] if the machine is unknown, the recording cannot be identified or a file cannot be written.
    pub fn rig_files(
        &self,
        recorded: Vec<Recorded>,
        map: &ChannelMap,
        out: &Path,
    ) -> Result<RigFiles, SessionError> {
        let first = recorded.first().ok_or(SessionError::NoRecording)?;
        let campaign = first.require_campaign()?.clone();
        let identified = self.identify(recorded, map, None)?;
        let points: Vec<IdentifiedPoint> = identified.points_alone().cloned().collect();
        let (machine, params) = (&campaign.machine.name, &campaign.machine.params);
        let thermal = ThermalExport { machine, params, found: identified.thermal.as_ref() };
        let gases = identified.gases();
        let turbine = turbine_points(&identified.recording, &points, &gases);
        let law = identified.thermal.as_ref().and_then(|found| found.convection.as_ref()?.exponent.value);
        let heat = heat_transfer_figure(machine, &points, law.unwrap_or(params.compressor.nusselt_exponent));
        let mut contents: Vec<(&str, Vec<u8>)> = vec![
            ("thermal_model.json", thermal.json()?),
            ("thermal_model.txt", thermal.text().into_bytes()),
            ("turbine.txt", turbine_text(machine, &gases, &turbine).into_bytes()),
            ("turbine.json", json_text(&turbine)?.into_bytes()),
            ("heat_transfer.svg", heat.to_svg().into_bytes()),
            ("heat_transfer.png", png(&heat)?),
        ];
        if let Some(figure) = error_figure(machine, &identified.points) {
            contents.push(("error.svg", figure.to_svg().into_bytes()));
            contents.push(("error.png", png(&figure)?));
        }
        let files = write_files(out, &contents, Existing::Kept)?;
        Ok(RigFiles { files, turbine, thermal: identified.thermal })
    }
}

/// The figure as PNG, with two pixels per unit.
pub(crate) fn png(figure: &Figure) -> Result<Vec<u8>, SessionError> {
    Ok(figure.to_png(2.0).map_err(ExportError::failed("png"))?)
}
