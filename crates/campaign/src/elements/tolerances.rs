//! `tolerances:`

use crate::si_values::element;
use crate::units::{Conductance, Duration, Fraction, PressureDifference, Quantity, TemperatureDifference};
use mapper_core::{ModelTolerances, StructureTolerances};
use schemars::JsonSchema;
use serde::Deserialize;

element! {
    /// Normal deviations of the nominal model, one standard deviation each. The diagnosis of the gap reports no deviation within them as an effect.
    pub(crate) TolerancesElement for ModelTolerances {
        /// Gain of the compressor's flow meter; 0.5 % if none is given.
        flow_meter_gain => flow_meter_gain_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.5 %"];
        /// Flow of the compressor map; 0.5 % if none is given.
        flow_map => flow_map_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.5 %"];
        /// Efficiency of the compressor map, the same everywhere; 0.5 % if none is given.
        compressor_efficiency => compressor_efficiency_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.5 %"];
        /// Error of the efficiency map that varies smoothly over the map; 0.3 % if none is given.
        efficiency_shape => efficiency_shape_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.3 %"];
        /// Efficiency of the turbine; 1 % if none is given.
        turbine_efficiency => turbine_efficiency_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "50 %"), example = &"1 %"];
        /// Area of the back-pressure valve; 0.5 % if none is given.
        valve_area => valve_area_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.5 %"];
        /// Convection between gas and compressor housing; 3 % if none is given.
        convection => convection_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "50 %"), example = &"3 %"];
        /// Convection of both housings to the cell; 10 % if none is given.
        external_convection => external_convection_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "50 %"), example = &"10 %"];
        /// Conductance to the oil; 5 % if none is given.
        oil_conductance => oil_conductance_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "50 %"), example = &"5 %"];
        /// Inlet pressure about that of `boundary`; 200 Pa if none is given.
        inlet_pressure => inlet_pressure_pa: Quantity<PressureDifference> [extend("x-min" = "0 Pa"), example = &"200 Pa"];
        /// Inlet temperature about that of `boundary`; 2 K if none is given.
        inlet_temperature => inlet_temperature_k: Quantity<TemperatureDifference> [extend("x-min" = "0 K"), example = &"2 K"];
        /// Turbine inlet temperature about that of `boundary`; 10 K if none is given.
        turbine_inlet_temperature => turbine_inlet_temperature_k: Quantity<TemperatureDifference> [extend("x-min" = "0 K"), example = &"10 K"];
        /// Oil temperature about that of `boundary`; 5 K if none is given.
        oil_temperature => oil_temperature_k: Quantity<TemperatureDifference> [extend("x-min" = "0 K"), example = &"5 K"];
        /// Ambient temperature about that of `boundary`; 5 K if none is given.
        ambient_temperature => ambient_temperature_k: Quantity<TemperatureDifference> [extend("x-min" = "0 K"), example = &"5 K"];
        /// Declared lag of the turbine inlet pressure behind its command; 0.3 s if none is given.
        actuator_lag => actuator_lag_s: Quantity<Duration> [extend("x-min" = "0 s", "x-max" = "60 s"), example = &"0.3 s"];
        /// Share of the flow that returns from the wheel's outlet to its inlet; 0.5 % with a plain shroud, 2 % with a ported one; 1 % if none is given.
        recirculation => recirculation_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "30 %"), example = &"2 %"];
        /// Share of the dynamic temperature that the T2 probe may miss; some 30 % without a shield; 5 % if none is given.
        t2_recovery => t2_recovery_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "100 %"), example = &"30 %"];
        /// Conductance from the bearing housing to the gas behind the wheel; 0.04 W/K if none is given.
        heat_behind_wheel => heat_behind_wheel_w_k: Quantity<Conductance> [extend("x-min" = "0 W/K"), example = &"0.04 W/K"];
        /// Share of each output's variation over a recording that the model's equations may miss.
        structure: StructureElement [];
    }
}

element! {
    /// Share of each output's variation over a recording that the model's equations may miss; 0 if none is given. With a fault-free recording
    /// `mapper gap diagnose --baseline` measures it.
    #[allow(non_snake_case, reason = "the keys are the symbols of channels")]
    pub(crate) StructureElement for StructureTolerances {
        /// Shaft speed.
        N => shaft_speed_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "100 %")];
        /// Compressor mass flow.
        m_c => compressor_flow_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "100 %")];
        /// Compressor outlet pressure.
        P2 => p2_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "100 %")];
        /// Compressor outlet temperature.
        T2 => t2_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "100 %"), example = &"12 %"];
        /// Compressor housing temperature.
        Tc => tc_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "100 %")];
        /// Turbine mass flow.
        m_t => turbine_flow_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "100 %")];
        /// Turbine outlet temperature.
        T4 => t4_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "100 %")];
        /// Turbine housing temperature.
        Tt => tt_ratio: Quantity<Fraction> [extend("x-min" = "0 %", "x-max" = "100 %")];
    }
}

impl TolerancesElement {
    /// The tolerances; the defaults where none are given.
    pub(crate) fn tolerances(self) -> ModelTolerances {
        let mut tolerances = ModelTolerances::default();
        self.structure.unwrap_or_default().apply(&mut tolerances.structure);
        self.apply(&mut tolerances);
        tolerances
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::any;
    use crate::units::{Kind, parse};

    #[test]
    fn what_is_left_out_keeps_its_default() {
        let read = |text| any(text).map(TolerancesElement::tolerances);
        let default = ModelTolerances::default();
        assert_eq!(read("{}").unwrap(), default);
        let convection = ModelTolerances { convection_ratio: 0.05, ..default };
        assert_eq!(read("{convection: 5 %}").unwrap(), convection);
        let structure = StructureTolerances { t2_ratio: 0.12, ..StructureTolerances::default() };
        assert_eq!(read("{structure: {T2: 12 %}}").unwrap(), ModelTolerances { structure, ..default });
        assert!(read("{convection: 0.05}").is_err() && read("{actuator_lag: 3 %}").is_err());
    }

    /// Each description names its default, which is defined elsewhere in the program.
    #[test]
    fn descriptions_name_the_defaults_that_hold() {
        let schema = schemars::schema_for!(TolerancesElement);
        let default = serde_json::to_value(ModelTolerances::default()).unwrap();
        let properties = schema.get("properties").unwrap().as_object().unwrap();
        assert_eq!(properties.len(), default.as_object().unwrap().len());
        for (key, property) in properties.iter().filter(|(key, _)| *key != "structure") {
            let description = property["description"].as_str().unwrap();
            let (_, named) = description.rsplit_once("; ").unwrap();
            let text = named.strip_suffix(" if none is given.").unwrap();
            let kind = Kind::from_key(property["x-quantity"].as_str().unwrap()).unwrap();
            let value = parse(kind, text).unwrap();
            let fields = ["ratio", "s", "pa", "k", "w_k"].map(|unit| format!("{key}_{unit}"));
            let held = fields.iter().find_map(|field| default[field].as_f64()).unwrap();
            assert!((held - value).abs() < 1e-12, "{key}: {held} is not {text}");
        }
    }
}
