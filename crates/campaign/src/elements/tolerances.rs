//! `tolerances:`

use crate::si_values::si;
use crate::units::{Conductance, Duration, Fraction, PressureDifference, Quantity, TemperatureDifference};
use mapper_core::{ModelTolerances, StructureTolerances};
use schemars::JsonSchema;
use serde::{Deserialize, Deserializer};

/// Normal deviations of the nominal model, one standard deviation each. The diagnosis of the gap reports no deviation within them as an effect.
#[derive(Default, Deserialize, JsonSchema)]
#[serde(remote = "ModelTolerances", default, deny_unknown_fields)]
pub(crate) struct TolerancesElement {
    /// Gain of the compressor's flow meter; 0.5 % if none is given.
    #[serde(rename = "flow_meter_gain", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.5 %")]
    flow_meter_gain_ratio: f64,
    /// Flow of the compressor map; 0.5 % if none is given.
    #[serde(rename = "flow_map", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.5 %")]
    flow_map_ratio: f64,
    /// Efficiency of the compressor map, the same everywhere; 0.5 % if none is given.
    #[serde(rename = "compressor_efficiency", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.5 %")]
    compressor_efficiency_ratio: f64,
    /// Error of the efficiency map that varies smoothly over the map; 0.3 % if none is given.
    #[serde(rename = "efficiency_shape", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.3 %")]
    efficiency_shape_ratio: f64,
    /// Efficiency of the turbine; 1 % if none is given.
    #[serde(rename = "turbine_efficiency", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "50 %"), example = &"1 %")]
    turbine_efficiency_ratio: f64,
    /// Area of the back-pressure valve; 0.5 % if none is given.
    #[serde(rename = "valve_area", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "50 %"), example = &"0.5 %")]
    valve_area_ratio: f64,
    /// Convection between gas and compressor housing; 3 % if none is given.
    #[serde(rename = "convection", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "50 %"), example = &"3 %")]
    convection_ratio: f64,
    /// Convection of both housings to the cell; 10 % if none is given.
    #[serde(rename = "external_convection", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "50 %"), example = &"10 %")]
    external_convection_ratio: f64,
    /// Conductance to the oil; 5 % if none is given.
    #[serde(rename = "oil_conductance", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "50 %"), example = &"5 %")]
    oil_conductance_ratio: f64,
    /// Inlet pressure about that of `boundary`; 200 Pa if none is given.
    #[serde(rename = "inlet_pressure", deserialize_with = "si::<PressureDifference, _>")]
    #[schemars(with = "Quantity<PressureDifference>", extend("x-min" = "0 Pa"), example = &"200 Pa")]
    inlet_pressure_pa: f64,
    /// Inlet temperature about that of `boundary`; 2 K if none is given.
    #[serde(rename = "inlet_temperature", deserialize_with = "si::<TemperatureDifference, _>")]
    #[schemars(with = "Quantity<TemperatureDifference>", extend("x-min" = "0 K"), example = &"2 K")]
    inlet_temperature_k: f64,
    /// Turbine inlet temperature about that of `boundary`; 10 K if none is given.
    #[serde(rename = "turbine_inlet_temperature", deserialize_with = "si::<TemperatureDifference, _>")]
    #[schemars(with = "Quantity<TemperatureDifference>", extend("x-min" = "0 K"), example = &"10 K")]
    turbine_inlet_temperature_k: f64,
    /// Oil temperature about that of `boundary`; 5 K if none is given.
    #[serde(rename = "oil_temperature", deserialize_with = "si::<TemperatureDifference, _>")]
    #[schemars(with = "Quantity<TemperatureDifference>", extend("x-min" = "0 K"), example = &"5 K")]
    oil_temperature_k: f64,
    /// Ambient temperature about that of `boundary`; 5 K if none is given.
    #[serde(rename = "ambient_temperature", deserialize_with = "si::<TemperatureDifference, _>")]
    #[schemars(with = "Quantity<TemperatureDifference>", extend("x-min" = "0 K"), example = &"5 K")]
    ambient_temperature_k: f64,
    /// Declared lag of the turbine inlet pressure behind its command; 0.3 s if none is given.
    #[serde(rename = "actuator_lag", deserialize_with = "si::<Duration, _>")]
    #[schemars(with = "Quantity<Duration>", extend("x-min" = "0 s", "x-max" = "60 s"), example = &"0.3 s")]
    actuator_lag_s: f64,
    /// Share of the flow that returns from the wheel's outlet to its inlet; 0.5 % with a plain shroud, 2 % with a ported one; 1 % if none is given.
    #[serde(rename = "recirculation", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "30 %"), example = &"2 %")]
    recirculation_ratio: f64,
    /// Share of the dynamic temperature that the T2 probe may miss; some 30 % without a shield; 5 % if none is given.
    #[serde(rename = "t2_recovery", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "100 %"), example = &"30 %")]
    t2_recovery_ratio: f64,
    /// Conductance from the bearing housing to the gas behind the wheel; 0.04 W/K if none is given.
    #[serde(rename = "heat_behind_wheel", deserialize_with = "si::<Conductance, _>")]
    #[schemars(with = "Quantity<Conductance>", extend("x-min" = "0 W/K"), example = &"0.04 W/K")]
    heat_behind_wheel_w_k: f64,
    /// Share of each output's variation over a recording that the model's equations may miss.
    #[serde(deserialize_with = "StructureElement::deserialize")]
    #[schemars(with = "StructureElement")]
    structure: StructureTolerances,
}

/// Share of each output's variation over a recording that the model's equations may miss; 0 if none is given. With a fault-free recording
/// `mapper gap diagnose --baseline` measures it.
#[derive(Default, Deserialize, JsonSchema)]
#[serde(remote = "StructureTolerances", default, deny_unknown_fields)]
pub(crate) struct StructureElement {
    /// Shaft speed.
    #[serde(rename = "N", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "100 %"))]
    shaft_speed_ratio: f64,
    /// Compressor mass flow.
    #[serde(rename = "m_c", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "100 %"))]
    compressor_flow_ratio: f64,
    /// Compressor outlet pressure.
    #[serde(rename = "P2", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "100 %"))]
    p2_ratio: f64,
    /// Compressor outlet temperature.
    #[serde(rename = "T2", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "100 %"), example = &"12 %")]
    t2_ratio: f64,
    /// Compressor housing temperature.
    #[serde(rename = "Tc", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "100 %"))]
    tc_ratio: f64,
    /// Turbine mass flow.
    #[serde(rename = "m_t", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "100 %"))]
    turbine_flow_ratio: f64,
    /// Turbine outlet temperature.
    #[serde(rename = "T4", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "100 %"))]
    t4_ratio: f64,
    /// Turbine housing temperature.
    #[serde(rename = "Tt", deserialize_with = "si::<Fraction, _>")]
    #[schemars(with = "Quantity<Fraction>", extend("x-min" = "0 %", "x-max" = "100 %"))]
    tt_ratio: f64,
}

impl TolerancesElement {
    /// The declared tolerances; a field of [`CampaignFile`](crate::campaign::CampaignFile) that is present is `Some`.
    pub(crate) fn declared<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Option<ModelTolerances>, D::Error> {
        TolerancesElement::deserialize(deserializer).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::any_with;
    use crate::units::{Kind, parse};

    #[test]
    fn what_is_left_out_keeps_its_default() {
        let read = |text| any_with(text, TolerancesElement::deserialize);
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
