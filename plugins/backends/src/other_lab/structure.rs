//! Parameters of the equations of this lab that the lumped model does not have, and its settings in a campaign, below
//! `backend: {other_lab: ...}`: all keys of the virtual lab, and `structure`.

use crate::other_lab::motion::apply_structure;
use crate::virtual_lab::{LabSettings, SettingProblem, check_range, read_settings};
use mapper_core::{BackendError, Channel};
use mapper_physics::rig::backend_plugin::NominalRig;
use mapper_yaml::units::{Conductance, Fraction, Length, Quantity, set};
use serde::Deserialize;

/// Name of this backend in campaigns.
pub const NAME: &str = "other_lab";

/// The structure. The defaults were set from the usual design of such machines before any diagnosis, and
/// are not fitted to the results of a diagnosis.
#[derive(Debug, Clone, PartialEq)]
pub struct OtherStructure {
    /// Conductance between neighbouring nodes of the housing, W/K, > 0. Aluminium, 160 W/(m K), a wall of 150 mm by 8 mm,
    /// nodes 40 mm apart: 5 W/K.
    pub housing_coupling_w_k: f64,
    /// Decrease of h along the passage, ratio: 0 is uniform; 0.5 is from 1.5 times the mean after the wheel to 0.5
    /// times at the outlet flange.
    pub uneven_h_ratio: f64,
    /// Whether the gas has one temperature in the whole passage, as in the lumped model; otherwise it cools along it.
    pub mixed_gas: bool,
    /// Length of the duct between the two volumes, m, > 0: its gas has inertia.
    pub duct_length_m: f64,
    /// Pressure loss of the duct, relative to its dynamic pressure.
    pub duct_loss_ratio: f64,
    /// Share of the outlet volume between wheel and duct, in the open interval 0..1.
    pub volume_share_ratio: f64,
    /// Loss of efficiency after flow separation, as a ratio; the loss of flow is half of it.
    pub hysteresis_ratio: f64,
    /// Factor on the natural frequencies of all sensors; infinity for sensors without lag.
    pub sensor_speed_ratio: f64,
    /// Added to the exponent of the compressor's law of convection, `h ~ m^n`; h is unchanged at 0.05 kg/s.
    pub convection_exponent_change: f64,
    /// Share of the turbine housing's mass that meets the gas; the other part has the Tt probe and all losses. 0: one mass.
    pub turbine_inner_ratio: f64,
    /// Relative change of the turbine's efficiency for a change of ln(P3/P4) by 1, unchanged at P3/P4 = 2.
    pub turbine_efficiency_slope: f64,
}

/// Flow at which the other law of convection meets that of the model, kg/s: the middle of the map.
pub(crate) const CONVECTION_FLOW_KG_S: f64 = 0.05;
/// Expansion ratio at which both turbines have equal efficiency: the middle of their range.
pub(crate) const TURBINE_EXPANSION_RATIO: f64 = 2.0;
/// Conductance between the two masses of the turbine housing, W/K: a flange of 40 cm2, 4000 W/(m2 K) at its joint.
pub(crate) const TURBINE_JOINT_W_K: f64 = 16.0;

impl Default for OtherStructure {
    fn default() -> Self {
        OtherStructure {
            housing_coupling_w_k: 5.0,
            uneven_h_ratio: 0.5,
            mixed_gas: false,
            duct_length_m: 0.4,
            duct_loss_ratio: 0.2,
            volume_share_ratio: 0.3,
            hysteresis_ratio: 0.01,
            sensor_speed_ratio: 1.0,
            convection_exponent_change: 0.0,
            turbine_inner_ratio: 0.0,
            turbine_efficiency_slope: 0.0,
        }
    }
}

impl OtherStructure {
    /// Another machine: a turbine housing of two masses, a flatter law of convection, a turbine that gains efficiency with expansion, a
    /// compressor housing of loosely coupled nodes, a short duct, slow sensors, no hysteresis.
    pub fn two_masses() -> Self {
        OtherStructure {
            housing_coupling_w_k: 2.0,
            uneven_h_ratio: 0.2,
            mixed_gas: true,
            duct_length_m: 0.1,
            duct_loss_ratio: 0.5,
            volume_share_ratio: 0.5,
            hysteresis_ratio: 0.0,
            sensor_speed_ratio: 0.5,
            convection_exponent_change: -0.2,
            turbine_inner_ratio: 0.4,
            turbine_efficiency_slope: 0.1,
        }
    }

    /// Second-order sensors: channel, natural frequency in Hz, damping. Pressure lines oscillate, meters are filtered, probes
    /// in a sheath have two lags.
    pub(crate) fn sensors(&self) -> Vec<(Channel, f64, f64)> {
        let defaults = [
            (Channel::P2, 8.0, 0.5),
            (Channel::CompressorFlow, 3.0, 0.7),
            (Channel::TurbineFlow, 3.0, 0.7),
            (Channel::T2, 2.0, 1.2),
            (Channel::T4, 1.0, 1.2),
            (Channel::Tc, 0.2, 1.2),
            (Channel::Tt, 0.2, 1.2),
        ];
        if self.sensor_speed_ratio.is_infinite() {
            return Vec::new();
        }
        defaults.map(|(channel, hz, damping)| (channel, hz * self.sensor_speed_ratio, damping)).to_vec()
    }
}

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
///
/// # Errors
/// [`BackendError::Settings`] with the wrong key and the correct form.
pub(crate) fn read(settings: &serde_json::Value, nominal: &NominalRig) -> Result<LabSettings, BackendError> {
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
