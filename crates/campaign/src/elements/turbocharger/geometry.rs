//! `machine.geometry:`, which overrides the machine of Burke et al., Appendix A, scaled to the given wheel.

use crate::machine_sizes::similar_machine;
use crate::units::{Area, Conductance, Conductivity, Inertia, Length, Mass, MassFlow, Quantity, Volume, set};
use mapper_core::InletConvection;
use mapper_physics::machine::params::Params;
use schemars::JsonSchema;
use serde::Deserialize;

/// Sizes and masses.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GeometryFile {
    /// Compressor side.
    compressor: Option<CompressorFile>,
    /// Turbine side.
    turbine: Option<TurbineFile>,
    /// Bearing housing and oil.
    bearing: Option<BearingFile>,
    /// Inertia of shaft and wheels.
    #[schemars(extend("x-above" = "0 kg m^2"))]
    shaft_inertia: Option<Quantity<Inertia>>,
    /// Back-pressure valve and the volume before it.
    outlet: Option<OutletFile>,
}

impl GeometryFile {
    /// The machine: the values of the file, and the reference machine scaled to its wheel for all others.
    pub(crate) fn machine(self) -> Params {
        let wheel = self.compressor.as_ref().and_then(|compressor| compressor.wheel_diameter);
        let mut params = wheel.map_or_else(Params::default, |wheel| similar_machine(wheel.value));
        self.apply(&mut params);
        params
    }

    fn apply(self, params: &mut Params) {
        self.compressor.unwrap_or_default().apply(params);
        self.turbine.unwrap_or_default().apply(params);
        self.bearing.unwrap_or_default().apply(params);
        set(&mut params.shaft_inertia_kgm2, self.shaft_inertia);
        self.outlet.unwrap_or_default().apply(params);
    }
}

/// Correlation `Nu = a Re^b Pr^(1/3) (mu/mu_skin)^0.14`.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct NusseltFile {
    /// a, a number above 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    coefficient: Option<f64>,
    /// b, a number from 0 to 2.
    #[schemars(range(min = 0, max = 2))]
    exponent: Option<f64>,
}

impl NusseltFile {
    fn apply(self, coefficient: &mut f64, exponent: &mut f64) {
        set(coefficient, self.coefficient);
        set(exponent, self.exponent);
    }
}

/// Compressor side.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct CompressorFile {
    /// Internal area that exchanges heat with the gas, A_c.
    #[schemars(extend("x-above" = "0 m^2"))]
    internal_area: Option<Quantity<Area>>,
    /// Share of the internal area before compression, alpha_A: a plain number from 0 to 1.
    #[schemars(range(min = 0, max = 1), example = 0.0)]
    alpha_area: Option<f64>,
    /// Diameter of the inlet pipe.
    #[schemars(extend("x-above" = "0 mm"))]
    inlet_diameter: Option<Quantity<Length>>,
    /// Heat-transfer coefficient before the wheel: `shared`, the default, equals that after the wheel; `own` follows the same Nusselt law at the inlet's diameter and temperature. It only matters if `alpha_area` is above 0.
    inlet_convection: Option<InletConvection>,
    /// Diameter of the outlet pipe.
    #[schemars(extend("x-above" = "0 mm"))]
    outlet_diameter: Option<Quantity<Length>>,
    /// Diameter of the wheel at its exit; omitted sizes are scaled to it from the 52 mm of Burke et al.
    #[schemars(extend("x-above" = "0 mm"))]
    wheel_diameter: Option<Quantity<Length>>,
    /// Mass of the housing.
    #[schemars(extend("x-above" = "0 kg"))]
    housing_mass: Option<Quantity<Mass>>,
    /// External area of the housing.
    #[schemars(extend("x-min" = "0 m^2"))]
    external_area: Option<Quantity<Area>>,
    /// External emissivity, a plain number from 0 to 1.
    #[schemars(range(min = 0, max = 1), example = 0.1)]
    emissivity: Option<f64>,
    /// Internal convection.
    nusselt: Option<NusseltFile>,
}

impl CompressorFile {
    fn apply(self, params: &mut Params) {
        let to = &mut params.compressor;
        set(&mut to.internal_area_m2, self.internal_area);
        set(&mut to.alpha_area_ratio, self.alpha_area);
        set(&mut to.inlet_diameter_m, self.inlet_diameter);
        set(&mut to.inlet_convection, self.inlet_convection);
        set(&mut to.outlet_diameter_m, self.outlet_diameter);
        set(&mut to.wheel_diameter_m, self.wheel_diameter);
        set(&mut to.housing_mass_kg, self.housing_mass);
        set(&mut to.external_area_m2, self.external_area);
        set(&mut to.emissivity_ratio, self.emissivity);
        self.nusselt.unwrap_or_default().apply(&mut to.nusselt_coefficient, &mut to.nusselt_exponent);
    }
}

/// Turbine side.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct TurbineFile {
    /// Internal area that exchanges heat with the gas, A_t.
    #[schemars(extend("x-above" = "0 m^2"))]
    internal_area: Option<Quantity<Area>>,
    /// Diameter of the inlet pipe.
    #[schemars(extend("x-above" = "0 mm"))]
    inlet_diameter: Option<Quantity<Length>>,
    /// Radius of the wheel at its inlet.
    #[schemars(extend("x-above" = "0 mm"))]
    wheel_radius: Option<Quantity<Length>>,
    /// Mass of the housing.
    #[schemars(extend("x-above" = "0 kg"))]
    housing_mass: Option<Quantity<Mass>>,
    /// External area of the housing.
    #[schemars(extend("x-min" = "0 m^2"))]
    external_area: Option<Quantity<Area>>,
    /// External emissivity, a plain number from 0 to 1.
    #[schemars(range(min = 0, max = 1), example = 0.6)]
    emissivity: Option<f64>,
    /// Internal convection.
    nusselt: Option<NusseltFile>,
    /// Swallowing capacity at a large expansion ratio, corrected to 288.15 K and 101.325 kPa.
    #[schemars(extend("x-above" = "0 kg/s"))]
    choked_flow: Option<Quantity<MassFlow>>,
    /// Best efficiency, a plain number above 0, at most 1.
    #[schemars(range(max = 1), extend("exclusiveMinimum" = 0), example = 0.75)]
    peak_efficiency: Option<f64>,
    /// Blade-speed ratio of the best efficiency, a plain number above 0.
    #[schemars(range(max = 2), extend("exclusiveMinimum" = 0), example = 0.65)]
    peak_blade_speed_ratio: Option<f64>,
}

impl TurbineFile {
    fn apply(self, params: &mut Params) {
        let to = &mut params.turbine;
        set(&mut to.internal_area_m2, self.internal_area);
        set(&mut to.inlet_diameter_m, self.inlet_diameter);
        set(&mut to.wheel_radius_m, self.wheel_radius);
        set(&mut to.housing_mass_kg, self.housing_mass);
        set(&mut to.external_area_m2, self.external_area);
        set(&mut to.emissivity_ratio, self.emissivity);
        self.nusselt.unwrap_or_default().apply(&mut to.nusselt_coefficient, &mut to.nusselt_exponent);
        set(&mut to.choked_flow_kg_s, self.choked_flow);
        set(&mut to.peak_efficiency, self.peak_efficiency);
        set(&mut to.peak_blade_speed_ratio, self.peak_blade_speed_ratio);
    }
}

/// Bearing housing and oil.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct BearingFile {
    /// Thermal conductivity of the bearing housing.
    #[schemars(extend("x-above" = "0 W/(m K)"))]
    conductivity: Option<Quantity<Conductivity>>,
    /// Section area of the bearing housing.
    #[schemars(extend("x-above" = "0 m^2"))]
    section_area: Option<Quantity<Area>>,
    /// Length of the bearing housing.
    #[schemars(extend("x-above" = "0 mm"))]
    length: Option<Quantity<Length>>,
    /// Conductance from the bearing housing to the oil.
    #[schemars(extend("x-min" = "0 W/K"))]
    oil_conductance: Option<Quantity<Conductance>>,
}

impl BearingFile {
    fn apply(self, params: &mut Params) {
        let to = &mut params.bearing;
        set(&mut to.conductivity_w_mk, self.conductivity);
        set(&mut to.section_area_m2, self.section_area);
        set(&mut to.length_m, self.length);
        set(&mut to.oil_conductance_w_k, self.oil_conductance);
    }
}

/// Back-pressure valve and the volume before it.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct OutletFile {
    /// Volume between compressor and valve.
    #[schemars(extend("x-above" = "0 m^3"))]
    volume: Option<Quantity<Volume>>,
    /// Valve area at opening 1.
    #[schemars(extend("x-above" = "0 m^2"))]
    valve_area: Option<Quantity<Area>>,
    /// Discharge coefficient of the valve, a plain number above 0, at most 1.
    #[schemars(range(max = 1), extend("exclusiveMinimum" = 0), example = 0.6)]
    discharge_coefficient: Option<f64>,
}

impl OutletFile {
    fn apply(self, params: &mut Params) {
        let to = &mut params.outlet;
        set(&mut to.volume_m3, self.volume);
        set(&mut to.valve_area_m2, self.valve_area);
        set(&mut to.discharge_coefficient, self.discharge_coefficient);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_stays_as_in_the_paper() {
        assert_eq!(GeometryFile::default().machine(), Params::default());
        let text =
            "{compressor: {outlet_diameter: 40 mm, nusselt: {exponent: 0.8}}, shaft_inertia: 1e-5 kg m^2}";
        let params = crate::testing::any::<GeometryFile>(text).unwrap().machine();
        assert!((params.compressor.outlet_diameter_m - 0.04).abs() < 1e-12);
        assert_eq!((params.compressor.nusselt_exponent, params.shaft_inertia_kgm2), (0.8, 1e-5));
        let default = Params::default();
        assert_eq!(params.turbine, default.turbine);
        assert_eq!(params.compressor.nusselt_coefficient, default.compressor.nusselt_coefficient);
    }
}
