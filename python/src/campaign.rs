//! Campaigns, their plans and their first files.

use crate::attended::compute;
use crate::error::Fault;
use crate::registry::registry;
use mapper_campaign::Campaign as Checked;
use mapper_campaign::CampaignError;
use mapper_core::{BackendError, NAMED_REFERENCES};
use mapper_physics::simulation::model::Model;
use mapper_session::{
    FirstCampaignRequest, FirstRig, PlanInputs, Rehearsal, Session, SessionError, first_campaign,
    nominal_model, plan_of, rehearse, with_messages,
};
use pyo3::prelude::*;
use serde_json::Value;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// A checked campaign.
#[pyclass(frozen, module = "mapper._mapper")]
pub struct Campaign {
    pub(crate) inner: Arc<Inner>,
}

/// A campaign with its text.
pub struct Inner {
    pub(crate) campaign: Checked,
    pub(crate) text: String,
    pub(crate) origin: PathBuf,
}

impl Inner {
    /// A session's error that has to do with this campaign: mistakes in the backend's settings and in the formats of the map are shown in
    /// its text.
    pub fn fault(&self, error: SessionError) -> Fault {
        let (text, origin) = (&self.text, &self.origin);
        let findings = match &error {
            SessionError::Backend(BackendError::Settings { backend, path, source }) => {
                let at = format!("backend.{backend}");
                mapper_campaign::backend_mistake(text, origin, &at, path, &source.to_string(), false)
            }
            SessionError::Reader { at, setting, source } => {
                mapper_campaign::backend_mistake(text, origin, at, setting, &source.to_string(), false)
            }
            SessionError::UnknownFormat { name, known } => {
                mapper_campaign::format_mistake(text, origin, name, known)
            }
            _ => return Fault::Session(error),
        };
        Fault::InCampaign(CampaignError::Mistakes(Box::new(findings)))
    }
}

#[pymethods]
impl Campaign {
    /// Reads and checks a campaign file.
    #[staticmethod]
    fn load(py: Python<'_>, path: PathBuf) -> PyResult<Campaign> {
        let inner = compute(py, None, move |_| {
            let campaign = mapper_campaign::load(&path).map_err(Fault::InCampaign)?;
            let text = mapper_campaign::read_text(&path).map_err(|source| SessionError::File {
                action: "read",
                path: path.clone(),
                source,
            })?;
            Ok(Inner { campaign, text, origin: path })
        })?;
        Ok(Campaign { inner: Arc::new(inner) })
    }

    /// Checks a campaign's text. `origin` names it in messages and is the base of relative paths.
    #[staticmethod]
    fn check(py: Python<'_>, text: String, origin: PathBuf) -> PyResult<Campaign> {
        let inner = compute(py, None, move |_| {
            let campaign = mapper_campaign::check(&text, &origin, &mapper_campaign::read_named_file)
                .map_err(|findings| Fault::InCampaign(CampaignError::Mistakes(Box::new(findings))))?;
            Ok(Inner { campaign, text, origin })
        })?;
        Ok(Campaign { inner: Arc::new(inner) })
    }

    /// Name of the campaign.
    #[getter]
    fn name(&self) -> &str {
        &self.inner.campaign.name
    }

    /// Name of the machine.
    #[getter]
    fn machine(&self) -> &str {
        &self.inner.campaign.machine.name
    }

    /// Name of the backend.
    #[getter]
    fn backend(&self) -> &str {
        &self.inner.campaign.backend.name
    }

    /// Directory of the runs, as the campaign gives it.
    #[getter]
    fn output_directory(&self) -> &str {
        &self.inner.campaign.outputs.directory
    }

    /// The text.
    #[getter]
    fn text(&self) -> &str {
        &self.inner.text
    }

    /// The file, or the name that messages show.
    #[getter]
    fn origin(&self) -> &Path {
        &self.inner.origin
    }

    /// Number of points.
    #[getter]
    fn points(&self) -> usize {
        self.inner.campaign.points.len()
    }

    /// The plan, as `mapper plan --json` prints it.
    #[pyo3(signature = (effort=None))]
    fn plan(&self, py: Python<'_>, effort: Option<f64>) -> PyResult<String> {
        let inner = self.inner.clone();
        compute(py, None, move |_| Ok(plan_json(&inner, effort)?.to_string()))
    }
}

/// The plan of a campaign as JSON; that of a script is a forecast.
fn plan_json(inner: &Inner, effort: Option<f64>) -> Result<Value, SessionError> {
    let campaign = &inner.campaign;
    let model: Model = nominal_model(campaign)?;
    let mut value = match &campaign.sequence {
        Some(source) => {
            let registry = registry();
            let Rehearsal { plan, notes } = rehearse(&Session::new(&registry), campaign, &model, source)?;
            let mut value = serde_json::to_value(&plan)?;
            value["forecast"] = true.into();
            value["notes"] = notes.into();
            value
        }
        None => {
            let inputs = PlanInputs::of(campaign)?;
            let mut request = inputs.request(campaign, &model);
            request.effort = effort.unwrap_or(request.effort);
            serde_json::to_value(plan_of(campaign, &request)?)?
        }
    };
    if let Some(zero) = campaign.zero {
        value["soak_s"] = zero.duration_s.into();
    }
    Ok(with_messages(value))
}

/// Writes the first campaign of a machine and its nominal map, as `mapper init` does. Returns the JSON of that command.
#[pyfunction]
#[pyo3(signature = (name, directory, rig, wheel_diameter_m, map=None, reference="SAE"))]
pub fn write_template(
    py: Python<'_>,
    name: String,
    directory: PathBuf,
    rig: &str,
    wheel_diameter_m: f64,
    map: Option<PathBuf>,
    reference: &str,
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
    let reference = NAMED_REFERENCES
        .iter()
        .find(|row| row.name.eq_ignore_ascii_case(reference))
        .ok_or_else(|| Fault::Argument(format!("`{reference}` is not one of SAE, Garrett, BorgWarner")))?;
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
        let written = first_campaign(&registry(), &request)?;
        Ok(serde_json::to_string(&written).map_err(SessionError::from)?)
    })
}
