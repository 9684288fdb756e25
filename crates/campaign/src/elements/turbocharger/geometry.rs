//! `machine.geometry:`, which overrides the machine of Burke et al., Appendix A, scaled to the given wheel.

use crate::machine_sizes::similar_machine;
use crate::si_values::element;
use crate::units::{
    Area, Conductance, Conductivity, Inertia, Length, Mass, MassFlow, Power, Quantity, Volume, set,
};
use mapper_core::InletConvection;
use mapper_physics::machine::params::{BearingParams, CompressorParams, OutletParams, Params, TurbineParams};
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
        let (compressor, turbine) = (self.compressor.unwrap_or_default(), self.turbine.unwrap_or_default());
        compressor.apply(&mut params.compressor);
        turbine.apply(&mut params.turbine);
        for (given, coefficient, exponent) in [
            (
                compressor.nusselt,
                &mut params.compressor.nusselt_coefficient,
                &mut params.compressor.nusselt_exponent,
            ),
            (turbine.nusselt, &mut params.turbine.nusselt_coefficient, &mut params.turbine.nusselt_exponent),
        ] {
            set(coefficient, given.and_then(|nusselt| nusselt.coefficient));
            set(exponent, given.and_then(|nusselt| nusselt.exponent));
        }
        self.bearing.unwrap_or_default().apply(&mut params.bearing);
        set(&mut params.shaft_inertia_kgm2, self.shaft_inertia);
        self.outlet.unwrap_or_default().apply(&mut params.outlet);
    }
}

/// Correlation `Nu = a Re^b Pr^(1/3) (mu/mu_skin)^0.14`.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct NusseltFile {
    /// a, a number above 0.
    #[schemars(extend("exclusiveMinimum" = 0))]
    coefficient: Option<f64>,
    /// b, a number from 0 to 2.
    #[schemars(range(min = 0, max = 2))]
    exponent: Option<f64>,
}

element! {
    /// Compressor side.
    pub(crate) CompressorFile for CompressorParams {
        /// Internal area that exchanges heat with the gas, A_c.
        internal_area => internal_area_m2: Quantity<Area> [extend("x-above" = "0 m^2")];
        /// Share of the internal area before compression, alpha_A: a plain number from 0 to 1.
        alpha_area => alpha_area_ratio: f64 [range(min = 0, max = 1), example = 0.0];
        /// Diameter of the inlet pipe.
        inlet_diameter => inlet_diameter_m: Quantity<Length> [extend("x-above" = "0 mm")];
        /// Heat-transfer coefficient before the wheel: `shared`, the default, equals that after the wheel; `own` follows the same Nusselt law at the inlet's diameter and temperature. It only matters if `alpha_area` is above 0.
        inlet_convection => inlet_convection: InletConvection [];
        /// Diameter of the outlet pipe.
        outlet_diameter => outlet_diameter_m: Quantity<Length> [extend("x-above" = "0 mm")];
        /// Diameter of the wheel at its exit; omitted sizes are scaled to it from the 52 mm of Burke et al.
        wheel_diameter => wheel_diameter_m: Quantity<Length> [extend("x-above" = "0 mm")];
        /// Mass of the housing.
        housing_mass => housing_mass_kg: Quantity<Mass> [extend("x-above" = "0 kg")];
        /// External area of the housing.
        external_area => external_area_m2: Quantity<Area> [extend("x-min" = "0 m^2")];
        /// External emissivity, a plain number from 0 to 1.
        emissivity => emissivity_ratio: f64 [range(min = 0, max = 1), example = 0.1];
        /// Internal convection.
        nusselt: NusseltFile [];
    }
}

element! {
    /// Turbine side.
    pub(crate) TurbineFile for TurbineParams {
        /// Internal area that exchanges heat with the gas, A_t.
        internal_area => internal_area_m2: Quantity<Area> [extend("x-above" = "0 m^2")];
        /// Diameter of the inlet pipe.
        inlet_diameter => inlet_diameter_m: Quantity<Length> [extend("x-above" = "0 mm")];
        /// Radius of the wheel at its inlet.
        wheel_radius => wheel_radius_m: Quantity<Length> [extend("x-above" = "0 mm")];
        /// Mass of the housing.
        housing_mass => housing_mass_kg: Quantity<Mass> [extend("x-above" = "0 kg")];
        /// External area of the housing.
        external_area => external_area_m2: Quantity<Area> [extend("x-min" = "0 m^2")];
        /// External emissivity, a plain number from 0 to 1.
        emissivity => emissivity_ratio: f64 [range(min = 0, max = 1), example = 0.6];
        /// Internal convection.
        nusselt: NusseltFile [];
        /// Swallowing capacity at a large expansion ratio, corrected to 288.15 K and 101.325 kPa.
        choked_flow => choked_flow_kg_s: Quantity<MassFlow> [extend("x-above" = "0 kg/s")];
        /// Best efficiency, a plain number above 0, at most 1.
        peak_efficiency => peak_efficiency: f64 [range(max = 1), extend("exclusiveMinimum" = 0), example = 0.75];
        /// Blade-speed ratio of the best efficiency, a plain number above 0.
        peak_blade_speed_ratio => peak_blade_speed_ratio: f64 [range(max = 2), extend("exclusiveMinimum" = 0), example = 0.65];
    }
}

element! {
    /// Bearing housing and oil.
    pub(crate) BearingFile for BearingParams {
        /// Thermal conductivity of the bearing housing.
        conductivity => conductivity_w_mk: Quantity<Conductivity> [extend("x-above" = "0 W/(m K)")];
        /// Section area of the bearing housing.
        section_area => section_area_m2: Quantity<Area> [extend("x-above" = "0 m^2")];
        /// Length of the bearing housing.
        length => length_m: Quantity<Length> [extend("x-above" = "0 mm")];
        /// Conductance from the bearing housing to the oil.
        oil_conductance => oil_conductance_w_k: Quantity<Conductance> [extend("x-min" = "0 W/K")];
        /// Heat of bearing friction to the bearing housing at 100 krpm, rising with the square of the speed; none if it is omitted. Its power belongs to the turbine's efficiency.
        friction_heat => friction_heat_w: Quantity<Power> [extend("x-min" = "0 W", "x-max" = "10 kW")];
    }
}

element! {
    /// Back-pressure valve and the volume before it.
    pub(crate) OutletFile for OutletParams {
        /// Volume between compressor and valve.
        volume => volume_m3: Quantity<Volume> [extend("x-above" = "0 m^3")];
        /// Valve area at opening 1.
        valve_area => valve_area_m2: Quantity<Area> [extend("x-above" = "0 m^2")];
        /// Discharge coefficient of the valve, a plain number above 0, at most 1.
        discharge_coefficient => discharge_coefficient: f64 [range(max = 1), extend("exclusiveMinimum" = 0), example = 0.6];
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
