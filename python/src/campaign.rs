//! Campaigns, their plans and their first files.

use crate::attended::compute;
use crate::error::Fault;
use crate::plugins::plugins;
use mapper_maps::table::parse_reference;
use mapper_session::{FirstCampaignRequest, FirstRig, SessionError, first_campaign};
use pyo3::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A checked campaign.
#[pyclass(frozen, module = "mapper._mapper")]
pub struct Campaign {
    pub(crate) inner: mapper::Campaign,
}

#[pymethods]
impl Campaign {
    /// Reads and checks a campaign file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Campaign> {
        compute(py, None, move |_| {
            Ok(Campaign { inner: mapper::Campaign::load(path)?.with_plugins(plugins()) })
        })
    }

    /// Checks a campaign's text. `origin` names it in messages and is the base of relative paths.
    #[staticmethod]
    fn check(py: Python<'_>, text: String, origin: PathBuf) -> PyResult<Campaign> {
        compute(py, None, move |_| {
            Ok(Campaign { inner: mapper::Campaign::from_yaml(text, origin)?.with_plugins(plugins()) })
        })
    }

    /// Name of the campaign.
    #[getter]
    fn name(&self) -> &str {
        self.inner.name()
    }

    /// Name of the machine.
    #[getter]
    fn machine(&self) -> &str {
        self.inner.machine()
    }

    /// Name of the backend.
    #[getter]
    fn backend(&self) -> &str {
        &self.inner.settings().backend.name
    }

    /// Directory of the runs, as the campaign gives it.
    #[getter]
    fn output_directory(&self) -> &str {
        &self.inner.settings().outputs.directory
    }

    /// The text.
    #[getter]
    fn text(&self) -> &str {
        self.inner.text()
    }

    /// The file, or the name that messages show.
    #[getter]
    fn origin(&self) -> &Path {
        self.inner.origin()
    }

    /// Number of points.
    #[getter]
    fn points(&self) -> usize {
        self.inner.settings().points.len()
    }

    /// The plan, as `mapper plan --json` prints it.
    #[pyo3(signature = (effort=None))]
    fn plan(&self, py: Python<'_>, effort: Option<f64>) -> PyResult<String> {
        let inner = self.inner.clone();
        compute(py, None, move |_| Ok(plan_json(&inner, effort.unwrap_or(1.0))?.to_string()))
    }
}

/// The plan of a campaign as JSON; that of a script is a forecast.
fn plan_json(campaign: &mapper::Campaign, effort: f64) -> Result<Value, Fault> {
    let settings = campaign.settings();
    let planned = campaign.plan_with(effort)?;
    let mut value =
        mapper::with_messages(|| serde_json::to_value(&planned.plan)).map_err(SessionError::from)?;
    if settings.sequence.is_some() {
        value["forecast"] = true.into();
        value["notes"] = planned.notes.into();
    }
    if let Some(zero) = settings.zero {
        value["soak_s"] = zero.duration_s.into();
    }
    Ok(value)
}

/// Writes the first campaign of a machine and its nominal map, as `mapper init` does. Returns the JSON of that command.
#[pyfunction]
#[pyo3(signature = (name, directory, rig, wheel_diameter_m, map=None, reference=None))]
pub fn write_template(
    py: Python<'_>,
    name: String,
    directory: PathBuf,
    rig: &str,
    wheel_diameter_m: f64,
    map: Option<PathBuf>,
    reference: Option<&str>,
) -> PyResult<String> {
    let rig = match rig {
        "virtual_lab" => FirstRig::VirtualLab,
        "gas_stand" => FirstRig::GasStand,
        "log" => FirstRig::Log,
        other => {
            let message =
                format!("there is no template `{other}`; the templates are virtual_lab, gas_stand, log");
            return Err(Fault::Argument(message).into());
        }
    };
    let reference = reference.map(parse_reference).transpose();
    let reference = reference.map_err(|error| Fault::Argument(error.to_string()))?;
    let request = FirstCampaignRequest {
        name,
        directory,
        rig,
        wheel_diameter_m,
        inlet_diameter_m: None,
        outlet_diameter_m: None,
        has_static_taps: false,
        probe_diameter_m: None,
        map,
        reference,
        speeds_rpm: None,
    };
    compute(py, None, move |_| {
        let written = first_campaign(&plugins(), &request)?;
        Ok(serde_json::to_string(&written).map_err(SessionError::from)?)
    })
}
