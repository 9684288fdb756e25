//! `machine:`

use super::ReferenceFile;
use crate::units::{Area, Conductance, Conductivity, Inertia, Length, Mass, MassFlow, Quantity, Volume};
use schemars::JsonSchema;
use serde::Deserialize;

/// The turbocharger under test.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct MachineFile {
    /// Name of the machine, as it stands on the map.
    #[schemars(length(min = 1), example = &"turbo_a")]
    pub name: String,
    /// Serial number; put it into quotes if it is a number.
    #[schemars(example = &"TA-0001")]
    pub serial_number: Option<String>,
    /// Sizes and masses; what is left out is that of Burke et al., Appendix A.
    pub geometry: Option<GeometryFile>,
    /// The nominal compressor map: `closed_form`, or a table as `file` with its `reference` state.
    #[schemars(example = &"closed_form")]
    pub map: MapFile,
}

// Untagged: which of the two it is shows in the YAML's own form, and the schema is checked before.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(untagged)]
pub(crate) enum MapFile {
    Named(NamedMap),
    Table(TableFile),
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum NamedMap {
    ClosedForm,
}

/// A map as a table.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TableFile {
    /// CSV file, relative to the campaign file.
    #[schemars(length(min = 1), example = &"maps/x.csv")]
    pub file: String,
    /// State to which the table's corrected flow and speed refer. The usual choices: SAE (298 K, 100 kPa), Garrett (545 degR, 13.95 psia), BorgWarner (293 K, 98.1 kPa); or `temperature` and `pressure`.
    #[schemars(example = &"SAE")]
    pub reference: ReferenceFile,
}

/// Sizes and masses.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GeometryFile {
    /// Compressor side.
    pub compressor: Option<CompressorFile>,
    /// Turbine side.
    pub turbine: Option<TurbineFile>,
    /// Bearing housing and oil.
    pub bearing: Option<BearingFile>,
    /// Inertia of shaft and wheels.
    #[schemars(extend("x-above" = "0 kg m^2"))]
    pub shaft_inertia: Option<Quantity<Inertia>>,
    /// Back-pressure valve and the volume before it.
    pub outlet: Option<OutletFile>,
}

/// Correlation `Nu = a Re^b Pr^(1/3) (mu/mu_skin)^0.14`.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct NusseltFile {
    /// a, a number above 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub coefficient: Option<f64>,
    /// b, a number from 0 to 2.
    #[schemars(range(min = 0, max = 2))]
    pub exponent: Option<f64>,
}

/// Compressor side.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct CompressorFile {
    /// Internal area that exchanges heat with the gas, A_c.
    #[schemars(extend("x-above" = "0 m^2"))]
    pub internal_area: Option<Quantity<Area>>,
    /// Share of the internal area before compression, alpha_A: a plain number from 0 to 1.
    #[schemars(range(min = 0, max = 1), example = 0.0)]
    pub alpha_area: Option<f64>,
    /// Diameter of the outlet pipe.
    #[schemars(extend("x-above" = "0 mm"))]
    pub outlet_diameter: Option<Quantity<Length>>,
    /// Diameter of the wheel at its exit.
    #[schemars(extend("x-above" = "0 mm"))]
    pub wheel_diameter: Option<Quantity<Length>>,
    /// Mass of the housing.
    #[schemars(extend("x-above" = "0 kg"))]
    pub housing_mass: Option<Quantity<Mass>>,
    /// External area of the housing.
    #[schemars(extend("x-min" = "0 m^2"))]
    pub external_area: Option<Quantity<Area>>,
    /// External emissivity, a plain number from 0 to 1.
    #[schemars(range(min = 0, max = 1), example = 0.1)]
    pub emissivity: Option<f64>,
    /// Internal convection.
    pub nusselt: Option<NusseltFile>,
}

/// Turbine side.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TurbineFile {
    /// Internal area that exchanges heat with the gas, A_t.
    #[schemars(extend("x-above" = "0 m^2"))]
    pub internal_area: Option<Quantity<Area>>,
    /// Diameter of the inlet pipe.
    #[schemars(extend("x-above" = "0 mm"))]
    pub inlet_diameter: Option<Quantity<Length>>,
    /// Radius of the wheel at its inlet.
    #[schemars(extend("x-above" = "0 mm"))]
    pub wheel_radius: Option<Quantity<Length>>,
    /// Mass of the housing.
    #[schemars(extend("x-above" = "0 kg"))]
    pub housing_mass: Option<Quantity<Mass>>,
    /// External area of the housing.
    #[schemars(extend("x-min" = "0 m^2"))]
    pub external_area: Option<Quantity<Area>>,
    /// External emissivity, a plain number from 0 to 1.
    #[schemars(range(min = 0, max = 1), example = 0.6)]
    pub emissivity: Option<f64>,
    /// Internal convection.
    pub nusselt: Option<NusseltFile>,
    /// Flow swallowed at large expansion ratio, corrected to 288.15 K and 101.325 kPa.
    #[schemars(extend("x-above" = "0 kg/s"))]
    pub choked_flow: Option<Quantity<MassFlow>>,
    /// Best efficiency, a plain number above 0, at most 1.
    #[schemars(range(max = 1), extend("exclusiveMinimum" = 0), example = 0.75)]
    pub peak_efficiency: Option<f64>,
    /// Blade-speed ratio of the best efficiency, a plain number above 0.
    #[schemars(range(max = 2), extend("exclusiveMinimum" = 0), example = 0.65)]
    pub peak_blade_speed_ratio: Option<f64>,
}

/// Bearing housing and oil.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct BearingFile {
    /// Thermal conductivity of the bearing housing.
    #[schemars(extend("x-above" = "0 W/(m K)"))]
    pub conductivity: Option<Quantity<Conductivity>>,
    /// Section area of the bearing housing.
    #[schemars(extend("x-above" = "0 m^2"))]
    pub section_area: Option<Quantity<Area>>,
    /// Length of the bearing housing.
    #[schemars(extend("x-above" = "0 mm"))]
    pub length: Option<Quantity<Length>>,
    /// Conductance from the bearing housing to the oil.
    #[schemars(extend("x-min" = "0 W/K"))]
    pub oil_conductance: Option<Quantity<Conductance>>,
}

/// Back-pressure valve and the volume before it.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct OutletFile {
    /// Volume between compressor and valve.
    #[schemars(extend("x-above" = "0 m^3"))]
    pub volume: Option<Quantity<Volume>>,
    /// Valve area at opening 1.
    #[schemars(extend("x-above" = "0 m^2"))]
    pub valve_area: Option<Quantity<Area>>,
    /// Discharge coefficient of the valve, a plain number above 0, at most 1.
    #[schemars(range(max = 1), extend("exclusiveMinimum" = 0), example = 0.6)]
    pub discharge_coefficient: Option<f64>,
}
