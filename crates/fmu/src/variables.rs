//! Variables of the FMU, and the machine behind them.

use mapper_core::{EfficiencyDefinition, FittedMap, FittedNode, InletConvection, ReferenceState};
use mapper_physics::compressor_map::closed_form_map::ClosedFormMap;
use mapper_physics::compressor_map::tabulated_map::{MapError, MapRow, TabulatedMap};
use mapper_physics::machine::params::{BoundaryConditions, Params, State};

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Causality {
    /// Fixed before the simulation runs.
    Parameter,
    /// Set at communication points.
    Input,
    /// Read at communication points.
    Output,
}

/// A real variable. Its index in the list is its value reference.
#[derive(Debug, Clone, Copy)]
pub struct Variable {
    pub name: &'static str,
    pub causality: Causality,
    /// Unit, one of [`UNITS`].
    pub unit: &'static str,
    pub start: Option<f64>,
    pub description: &'static str,
}

/// A boolean parameter. Its index in the list is its value reference.
#[derive(Debug, Clone, Copy)]
pub struct Switch {
    pub name: &'static str,
    pub start: bool,
    pub description: &'static str,
}

/// Every unit of the variables, with its base units of the standard and their exponents (kg, m, s, K, rad), and the factor if it is not 1, as
/// attributes of XML.
pub const UNITS: &[(&str, &str)] = &[
    ("1", ""),
    ("m", r#"m="1""#),
    ("m2", r#"m="2""#),
    ("m3", r#"m="3""#),
    ("kg", r#"kg="1""#),
    ("kg/s", r#"kg="1" s="-1""#),
    ("kg.m2", r#"kg="1" m="2""#),
    ("K", r#"K="1""#),
    ("Pa", r#"kg="1" m="-1" s="-2""#),
    ("W", r#"kg="1" m="2" s="-3""#),
    ("W/K", r#"kg="1" m="2" s="-3" K="-1""#),
    ("W/(m.K)", r#"kg="1" m="1" s="-3" K="-1""#),
    ("W/(m2.K)", r#"kg="1" s="-3" K="-1""#),
    ("W.s2/rad2", r#"kg="1" m="2" s="-1" rad="-2""#),
    ("rpm", r#"rad="1" s="-1" factor="0.10471975511965977""#),
];

#[rustfmt::skip]
pub fn variables(machine: &FmuMachine<'_>) -> Vec<Variable> {
    let (params, boundary, start) = (machine.params, machine.boundary, machine.start);
    let (c, t, b) = (&params.compressor, &params.turbine, &params.bearing);
    let wheel_m = match machine.map {
        FmuMap::ClosedForm(map) => map.wheel_diameter_m,
        FmuMap::Table(_) => c.wheel_diameter_m,
    };
    let gamma = if let EfficiencyDefinition::ConstantGamma(gamma) = c.efficiency { gamma } else { 0.0 };
    let parameter = |name, value, unit, description| Variable { name, causality: Causality::Parameter, unit, start: Some(value), description };
    let input = |name, value, unit, description| Variable { name, causality: Causality::Input, unit, start: Some(value), description };
    let output = |name, unit, description| Variable { name, causality: Causality::Output, unit, start: None, description };
    vec![
        parameter("start.N", start.shaft_speed_rpm(), "rpm", "shaft speed at the start"),
        parameter("start.P2", start.p2_pa, "Pa", "compressor outlet pressure at the start"),
        parameter("start.Tc", start.tc_k, "K", "compressor housing at the start"),
        parameter("start.Tt", start.tt_k, "K", "turbine housing at the start"),
        parameter("start.T_inner", start.inner_k, "K", "inner wall of the compressor housing at the start, if it has its own temperature"),
        parameter("compressor.internal_area", c.internal_area_m2, "m2", "internal area that exchanges heat with the gas, A_c"),
        parameter("compressor.alpha_area", c.alpha_area_ratio, "1", "share of the internal area before compression, alpha_A"),
        parameter("compressor.inlet_diameter", c.inlet_diameter_m, "m", "inlet pipe, where convection before the wheel follows its own law"),
        parameter("compressor.inlet_h_ratio", c.inlet_h_ratio, "1", "multiplies h before the wheel"),
        parameter("compressor.outlet_diameter", c.outlet_diameter_m, "m", "outlet pipe"),
        parameter("compressor.wheel_diameter", wheel_m, "m", "wheel exit, for the closed-form map alone"),
        parameter("compressor.nusselt_coefficient", c.nusselt_coefficient, "1", "a of Nu = a Re^b Pr^(1/3) (mu/mu_skin)^0.14"),
        parameter("compressor.nusselt_exponent", c.nusselt_exponent, "1", "b of the same"),
        parameter("compressor.housing_mass", c.housing_mass_kg, "kg", "housing"),
        parameter("compressor.external_area", c.external_area_m2, "m2", "external area"),
        parameter("compressor.emissivity", c.emissivity_ratio, "1", "external emissivity"),
        parameter("compressor.hot_metal_h_ratio", c.hot_metal_h_ratio, "1", "multiplies h if the metal is hotter than the gas"),
        parameter("compressor.inlet_conductance", c.inlet_conductance_w_k, "W/K", "from the housing to the gas before the wheel, in addition to alpha_area"),
        parameter("compressor.efficiency_scale", c.efficiency_scale_ratio, "1", "multiplies the map's efficiency"),
        parameter("compressor.flow_scale", c.flow_scale_ratio, "1", "multiplies the map's flow"),
        parameter("compressor.recirculation_ratio", c.recirculation_ratio, "1", "share of the flow that recirculates to the wheel's inlet"),
        parameter("compressor.humidity", c.humidity_kg_kg, "1", "mass of water per mass of dry air"),
        parameter("compressor.efficiency_gamma", gamma, "1", "ratio of heat capacities of the efficiency's definition; 0: see compressor.efficiency_by_enthalpy"),
        parameter("compressor.inner_capacity_ratio", c.inner_capacity_ratio, "1", "share of the housing's heat capacity in the inner wall; 0: one node"),
        parameter("compressor.inner_conductance", c.inner_conductance_w_k, "W/K", "between the inner wall and the rest of the housing"),
        parameter("turbine.internal_area", t.internal_area_m2, "m2", "internal area that exchanges heat with the gas"),
        parameter("turbine.inlet_diameter", t.inlet_diameter_m, "m", "inlet pipe"),
        parameter("turbine.wheel_radius", t.wheel_radius_m, "m", "wheel inlet"),
        parameter("turbine.nusselt_coefficient", t.nusselt_coefficient, "1", "a of the turbine's law"),
        parameter("turbine.nusselt_exponent", t.nusselt_exponent, "1", "b of the turbine's law"),
        parameter("turbine.housing_mass", t.housing_mass_kg, "kg", "housing"),
        parameter("turbine.external_area", t.external_area_m2, "m2", "external area"),
        parameter("turbine.emissivity", t.emissivity_ratio, "1", "external emissivity"),
        parameter("turbine.choked_flow", t.choked_flow_kg_s, "kg/s", "flow at large expansion ratio, corrected to 288.15 K and 101.325 kPa"),
        parameter("turbine.peak_efficiency", t.peak_efficiency, "1", "best efficiency, total to static"),
        parameter("turbine.peak_blade_speed_ratio", t.peak_blade_speed_ratio, "1", "blade speed ratio at the best efficiency"),
        parameter("bearing.conductivity", b.conductivity_w_mk, "W/(m.K)", "bearing housing"),
        parameter("bearing.section_area", b.section_area_m2, "m2", "bearing housing"),
        parameter("bearing.length", b.length_m, "m", "bearing housing"),
        parameter("bearing.oil_conductance", b.oil_conductance_w_k, "W/K", "from the bearing housing to the oil"),
        parameter("bearing.friction_heat", b.friction_heat_w, "W", "heat of friction to the bearing housing at 100 krpm, rising with the square of the speed"),
        parameter("bearing.friction", params.bearing_friction_w_s2, "W.s2/rad2", "friction power over the square of the shaft speed"),
        parameter("shaft.inertia", params.shaft_inertia_kgm2, "kg.m2", "shaft with both wheels"),
        parameter("outlet.volume", params.outlet.volume_m3, "m3", "between compressor and valve"),
        parameter("outlet.valve_area", params.outlet.valve_area_m2, "m2", "area of the valve at opening 1"),
        parameter("outlet.discharge_coefficient", params.outlet.discharge_coefficient, "1", "of the valve"),
        parameter("probe.diameter", params.t2_probe_diameter_m, "m", "tip of the T2 probe; 0: ideal"),
        parameter("probe.stem_ratio", params.t2_probe_stem_ratio, "1", "share of the way from gas to housing that the stem pulls the tip"),
        parameter("probe.recovery_ratio", params.t2_probe_recovery_ratio, "1", "recovery of the T2 probe"),
        parameter("external_convection_ratio", params.external_convection_ratio, "1", "multiplies the convection of both housings to the cell"),
        parameter("radiation_area", params.radiation_area_m2, "m2", "view factor times area from turbine to compressor housing"),
        input("P1", boundary.p1_pa, "Pa", "compressor inlet total pressure"),
        input("T1", boundary.t1_k, "K", "compressor inlet total temperature"),
        input("P3", boundary.p3_pa, "Pa", "turbine inlet total pressure, above P4"),
        input("T3", boundary.t3_k, "K", "turbine inlet total temperature"),
        input("P4", boundary.p4_pa, "Pa", "turbine outlet pressure"),
        input("T_oil", boundary.oil_temperature_k, "K", "oil"),
        input("T_amb", boundary.ambient_temperature_k, "K", "around the housings"),
        input("valve", boundary.valve_opening_ratio, "1", "opening of the back-pressure valve"),
        input("N_set", start.shaft_speed_rpm(), "rpm", "shaft speed if `driven` is true"),
        input("P2_set", start.p2_pa, "Pa", "compressor outlet pressure if `driven` is true"),
        output("N", "rpm", "shaft speed"),
        output("P2", "Pa", "compressor outlet total pressure"),
        output("Tc", "K", "compressor housing"),
        output("Tt", "K", "turbine housing"),
        output("T_inner", "K", "metal that touches the compressor's gas"),
        output("T_bearing", "K", "bearing housing"),
        output("m_c", "kg/s", "compressor mass flow"),
        output("m_corrected", "kg/s", "the same, corrected to the map's reference state"),
        output("m_valve", "kg/s", "flow through the back-pressure valve"),
        output("pressure_ratio", "1", "P2/P1"),
        output("surge_position", "1", "position on the speed line: choked at 0 and below, 1 on the surge line, beyond it above 1"),
        output("eta", "1", "isentropic efficiency of the compression itself, without heat"),
        output("h", "W/(m2.K)", "heat-transfer coefficient of the compressor"),
        output("T1_prime", "K", "gas before the wheel"),
        output("T2_prime", "K", "gas after the wheel"),
        output("T2", "K", "gas at the compressor outlet"),
        output("T2_probe", "K", "reading of the T2 probe"),
        output("q_c", "W", "heat from gas to compressor housing"),
        output("W_c", "W", "power that the compressor takes from the shaft"),
        output("m_t", "kg/s", "turbine mass flow"),
        output("T4", "K", "gas at the turbine outlet"),
        output("q_t", "W", "heat from gas to turbine housing"),
        output("W_t", "W", "power that the turbine gives to the shaft"),
        output("eta_t", "1", "turbine efficiency, total to static"),
    ]
}

pub fn switches(machine: &FmuMachine<'_>) -> [Switch; 3] {
    [
        Switch {
            name: "driven",
            start: false,
            description: "shaft speed and P2 are the inputs N_set and P2_set; shaft, outlet volume and valve are the importer's",
        },
        Switch {
            name: "compressor.own_inlet_convection",
            start: machine.params.compressor.inlet_convection == InletConvection::Own,
            description: "h before the wheel follows the law with the inlet's own diameter and gas",
        },
        Switch {
            name: "compressor.efficiency_by_enthalpy",
            start: machine.params.compressor.efficiency == EfficiencyDefinition::Enthalpy,
            description: "the efficiency is the ratio of enthalpy rises; otherwise that of temperature rises, with cp(T1) or a constant gamma",
        },
    ]
}

/// Minimum efficiency in the map of an FMU. Below it the fit no longer describes a compressor.
const MIN_EFFICIENCY: f64 = 0.05;

/// The speed lines of a fit, including extrapolated ones, without the end on the choke side at which the gas is not compressed.
pub fn table_of_fit(fitted: &FittedMap, reference: ReferenceState) -> Result<TabulatedMap, MapError> {
    let compresses =
        |node: &&FittedNode| node.pressure_ratio > 1.0 && (MIN_EFFICIENCY..=1.0).contains(&node.eta);
    let rows: Vec<MapRow> = fitted
        .lines
        .iter()
        .flat_map(|line| {
            line.nodes.iter().filter(compresses).map(|node| MapRow {
                speed_corrected_rpm: line.speed_corrected_rpm,
                flow_corrected_kg_s: node.flow_corrected_kg_s,
                pressure_ratio: node.pressure_ratio,
                efficiency: node.eta,
            })
        })
        .collect();
    TabulatedMap::new(&rows, reference)
}

/// The compressor map of an FMU.
#[derive(Debug, Clone)]
pub enum FmuMap {
    /// The nominal machine's closed form.
    ClosedForm(ClosedFormMap),
    /// Speed lines.
    Table(TabulatedMap),
}

/// A machine to export.
#[derive(Debug, Clone)]
pub struct FmuMachine<'a> {
    /// Name for users.
    pub name: &'a str,
    /// One sentence on the origin of its numbers.
    pub origin: &'a str,
    /// Parameters.
    pub params: &'a Params,
    /// Compressor map.
    pub map: &'a FmuMap,
    /// Start values of the inputs.
    pub boundary: &'a BoundaryConditions,
    /// Initial state, unless the importer sets another one.
    pub start: &'a State,
}

impl FmuMachine<'_> {
    /// The model identifier of the FMI standard: the name as a C identifier of at most 60 characters.
    pub fn identifier(&self) -> String {
        let mut text: String =
            self.name.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).take(60).collect();
        if !text.starts_with(|c: char| c.is_ascii_alphabetic()) {
            text.insert_str(0, "machine_");
        }
        text
    }
}

/// Reason why an FMU cannot be made.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages describe the variants")]
pub enum FmuError {
    #[error("{name} = {value}: an FMU needs a finite number")]
    NotFinite { name: String, value: f64 },
    #[error("the archive cannot be written: {0}")]
    Archive(#[from] zip::result::ZipError),
    #[error("a file of the archive cannot be written: {0}")]
    File(#[from] std::io::Error),
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn any_name_becomes_a_c_identifier() {
        let params = Params::default();
        let map = FmuMap::ClosedForm(ClosedFormMap { wheel_diameter_m: 0.052 });
        let (boundary, start) = (BoundaryConditions::default(), State::new(1e4, 2e5, 300.0, 400.0, 300.0));
        let identifier = |name: &str| {
            FmuMachine { name, origin: "", params: &params, map: &map, boundary: &boundary, start: &start }
                .identifier()
        };
        assert_eq!(identifier("turbo_a"), "turbo_a");
        assert_eq!(identifier("2 Lader/ä"), "machine_2_Lader__");
        assert_eq!(identifier(""), "machine_");
        assert!(identifier(&"x".repeat(1000)).len() <= 60);
    }
}
