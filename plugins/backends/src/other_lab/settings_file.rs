//! Settings of the lab in a campaign, below `backend: {other_lab: ...}`: all keys of the virtual lab, and `structure`.

use super::motion::apply_structure;
use crate::other_lab::machine::{NAME, OtherStructure};
use crate::virtual_lab::{LabSettings, SettingProblem, check_range, read_settings};
use mapper_core::BackendError;
use mapper_physics::rig::backend_plugin::NominalRig;
use mapper_yaml::units::{Conductance, Fraction, Length, Quantity, set};
use serde::Deserialize;

/// The keys below `structure`. All are optional.
#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct StructureFile {
    /// Conductance between neighbouring nodes of the housing; default 5 W/K.
    housing_coupling: Option<Quantity<Conductance>>,
    /// Fall of h along the passage; default 50 %.
    uneven_h: Option<Quantity<Fraction>>,
    /// Whether the gas has one temperature in the whole passage; default false.
    mixed_gas: Option<bool>,
    /// Length of the duct; default 400 mm.
    duct_length: Option<Quantity<Length>>,
    /// Loss of the duct over its dynamic pressure; default 0.2.
    duct_loss: Option<f64>,
    /// Share of the outlet volume before the duct; default 30 %.
    volume_share: Option<Quantity<Fraction>>,
    /// Loss of efficiency after flow separation; default 1 %.
    hysteresis: Option<Quantity<Fraction>>,
    /// Factor on the natural frequencies of the sensors; default 1.
    sensor_speed: Option<f64>,
    /// Change of the exponent of the law of convection; default 0.
    convection_exponent: Option<f64>,
    /// Share of the turbine housing that meets the gas; default 0 %, one mass.
    turbine_inner: Option<Quantity<Fraction>>,
    /// Change of the turbine's efficiency with ln(P3/P4), ratio; default 0.
    turbine_slope: Option<f64>,
}

/// Reads a campaign's settings for this lab.
pub(super) fn read(settings: &serde_json::Value, nominal: &NominalRig) -> Result<LabSettings, BackendError> {
    read_keys(settings, nominal).map_err(|error| match error {
        BackendError::Settings { path, source, .. } => {
            BackendError::Settings { backend: NAME.to_owned(), path, source }
        }
        other => other,
    })
}

fn read_keys(settings: &serde_json::Value, nominal: &NominalRig) -> Result<LabSettings, BackendError> {
    let mut lab_settings = settings.clone();
    let structure =
        lab_settings.as_object_mut().and_then(|keys| keys.remove("structure")).unwrap_or_default();
    let file: StructureFile = if structure.is_null() {
        StructureFile::default()
    } else {
        serde_path_to_error::deserialize(&structure).map_err(|error| {
            let key = format!("structure.{}", error.path());
            SettingProblem::Form(error.into_inner()).at(key.trim_end_matches('.').to_owned())
        })?
    };
    let mut lab = read_settings(&lab_settings, nominal)?;
    apply_structure(&mut lab, file.structure()?);
    Ok(lab)
}

impl StructureFile {
    fn structure(&self) -> Result<OtherStructure, BackendError> {
        let mut structure = OtherStructure::default();
        set(&mut structure.housing_coupling_w_k, self.housing_coupling);
        set(&mut structure.uneven_h_ratio, self.uneven_h);
        set(&mut structure.mixed_gas, self.mixed_gas);
        set(&mut structure.duct_length_m, self.duct_length);
        set(&mut structure.duct_loss_ratio, self.duct_loss);
        set(&mut structure.volume_share_ratio, self.volume_share);
        set(&mut structure.hysteresis_ratio, self.hysteresis);
        set(&mut structure.sensor_speed_ratio, self.sensor_speed);
        set(&mut structure.convection_exponent_change, self.convection_exponent);
        set(&mut structure.turbine_inner_ratio, self.turbine_inner);
        set(&mut structure.turbine_efficiency_slope, self.turbine_slope);
        for (key, value, unit, range) in [
            ("housing_coupling", structure.housing_coupling_w_k, "W/K", 0.1..=1e6),
            ("uneven_h", 100.0 * structure.uneven_h_ratio, "%", 0.0..=90.0),
            ("duct_length", 1e3 * structure.duct_length_m, "mm", 1.0..=5e3),
            ("duct_loss", structure.duct_loss_ratio, "", 0.0..=5.0),
            ("volume_share", 100.0 * structure.volume_share_ratio, "%", 2.0..=90.0),
            ("hysteresis", 100.0 * structure.hysteresis_ratio, "%", 0.0..=10.0),
            ("sensor_speed", structure.sensor_speed_ratio, "", 0.1..=100.0),
            ("convection_exponent", structure.convection_exponent_change, "", -0.7..=0.7),
            ("turbine_inner", 100.0 * structure.turbine_inner_ratio, "%", 0.0..=90.0),
            ("turbine_slope", structure.turbine_efficiency_slope, "", -0.5..=0.5),
        ] {
            check_range(value, unit, range).map_err(|problem| problem.at(format!("structure.{key}")))?;
        }
        Ok(structure)
    }
}
