//! Campaign keys for the results: output files, report, and display units.

use crate::checking::Check;
use crate::elements::rig::calibration::{Date, check_date};
use crate::elements::rig::sensors::CALIBRATED;
use crate::si_values::optional_si;
use crate::units::{Fraction, Kind, Pressure, Quantity, Temperature, Unit};
use mapper_core::Channel;
use mapper_physics::gas::air;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_yaml::steps;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::collections::BTreeMap;

/// Display units, by their symbols; convert with [`crate::units::Kind::unit`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DisplayUnits {
    /// Unit of temperatures; degC if none is given.
    #[schemars(extend("enum" = symbols(Kind::Temperature)), example = &"degC")]
    pub temperature: String,
    /// Unit of pressures; kPa if none is given.
    #[schemars(extend("enum" = symbols(Kind::Pressure)), example = &"kPa")]
    pub pressure: String,
    /// Unit of shaft speeds; krpm if none is given.
    #[schemars(extend("enum" = symbols(Kind::Speed)), example = &"krpm")]
    pub speed: String,
    /// Unit of mass flows; g/s if none is given.
    #[schemars(extend("enum" = symbols(Kind::MassFlow)), example = &"g/s")]
    pub flow: String,
}

impl Default for DisplayUnits {
    fn default() -> Self {
        DisplayUnits {
            temperature: "degC".into(),
            pressure: "kPa".into(),
            speed: "krpm".into(),
            flow: "g/s".into(),
        }
    }
}

fn symbols(kind: Kind) -> serde_json::Value {
    json!(kind.units().iter().map(Unit::symbol).collect::<Vec<_>>())
}

const DEFAULT_DIRECTORY: &str = "runs";
const DEFAULT_FORMATS: [&str; 4] = ["csv", "json", "svg", "fitted"];

/// Formats and directory of the results.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Outputs {
    /// Parent directory of the run directories; `runs` if none is given. `~/` is the home directory; variables such as `${HOME}` are not replaced.
    #[schemars(regex(pattern = r"^(~/|[^~$%])[^$%]*$"), example = &"runs")]
    pub directory: String,
    /// Formats of the map, each once; csv, json, svg and fitted if none is given. docs/reference/maps.md lists all supported formats.
    #[schemars(extend("uniqueItems" = true, "examples" = [["csv", "json", "svg"]]))]
    pub formats: Vec<FormatName>,
}

/// Name of a map format, e.g. `csv`. The caller knows the valid names; [`crate::format_mistake`] reports any other one.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
#[schemars(inline)]
pub struct FormatName(#[schemars(length(min = 1), example = &"csv")] pub String);

impl FormatName {
    /// The name.
    pub fn name(&self) -> &str {
        &self.0
    }
}

impl std::fmt::Display for FormatName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl Default for Outputs {
    fn default() -> Self {
        Outputs {
            directory: DEFAULT_DIRECTORY.to_owned(),
            formats: DEFAULT_FORMATS.map(|name| FormatName(name.to_owned())).to_vec(),
        }
    }
}

/// Information for the test report that no sensor measures.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Report {
    /// Customer of the test, for the header of the report.
    pub customer: Option<String>,
    /// Number of the report.
    pub number: Option<String>,
    /// Who checked the report.
    pub checked_by: Option<String>,
    /// Who approved the report, with the date if it has one.
    pub approved_by: Option<String>,
    /// Operator of the test.
    pub operator: Option<String>,
    /// Test cell.
    pub test_cell: Option<String>,
    /// What a report states about the stand (SAE J1826), by name: oil grade, pressure and flow, cooling water, insulation, positions of the taps.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    #[schemars(extend("maxProperties" = 24), example = serde_json::json!({"oil": "SAE 5W-30, 3 bar, 2 L/min", "cooling water": "none", "insulation": "none"}))]
    pub stand: BTreeMap<String, String>,
    /// Day of the last calibration of each sensor, by its symbol, e.g. `T2: 2026-09-01`: the short form of `calibration` at the sensor.
    #[serde(default)]
    #[schemars(with = "BTreeMap<SensorSymbol, Date>")]
    pub calibration: BTreeMap<Channel, Date>,
    /// Barometric pressure in the cell.
    #[serde(rename(deserialize = "barometer"), default, deserialize_with = "optional_si::<Pressure, _>")]
    #[schemars(with = "Option<Quantity<Pressure>>", extend("x-min" = "50 kPa", "x-max" = "120 kPa"))]
    pub barometer_pa: Option<f64>,
    /// Relative humidity in the cell, whose air the compressor takes in. The air is dry if none is given.
    #[serde(rename(deserialize = "humidity"), default, deserialize_with = "optional_si::<Fraction, _>")]
    #[schemars(with = "Option<Quantity<Fraction>>", extend("x-min" = "0 %", "x-max" = "100 %"), example = &"50 %")]
    pub humidity_ratio: Option<f64>,
    /// Temperature in the cell, if it differs from `boundary.ambient_temperature`.
    #[serde(
        rename(deserialize = "cell_temperature"),
        default,
        deserialize_with = "optional_si::<Temperature, _>"
    )]
    #[schemars(with = "Option<Quantity<Temperature>>", extend("x-min" = "200 K", "x-max" = "400 K"))]
    pub cell_temperature_k: Option<f64>,
}

impl Report {
    /// Mass of water per mass of dry air in the cell at a relative humidity, kg/kg.
    fn water_kg_kg(&self, relative_ratio: f64, boundary: &BoundaryConditions) -> f64 {
        let temperature_k = self.cell_temperature_k.unwrap_or(boundary.ambient_temperature_k);
        let pressure_pa = self.barometer_pa.unwrap_or(boundary.p1_pa);
        air::humidity_kg_kg(relative_ratio, temperature_k, pressure_pa)
    }

    /// Mass of water per mass of dry air at the inlet, kg/kg; 0 if no humidity is given.
    pub(crate) fn humidity_kg_kg(&self, boundary: &BoundaryConditions) -> f64 {
        self.humidity_ratio.map_or(0.0, |ratio| self.water_kg_kg(ratio, boundary))
    }

    /// One standard deviation of the humidity, kg/kg; without a humidity, that of a uniform distribution from dry to saturated.
    pub fn humidity_sigma_kg_kg(&self, boundary: &BoundaryConditions) -> f64 {
        let saturated_kg_kg = self.water_kg_kg(1.0, boundary);
        saturated_kg_kg
            * if self.humidity_ratio.is_some() { HYGROMETER_SIGMA_RATIO } else { UNIFORM_RMS_RATIO }
    }
}

/// Standard uncertainty of a hygrometer's relative humidity. Judgement: capacitive sensors are specified with 2 to 3 %.
const HYGROMETER_SIGMA_RATIO: f64 = 0.03;
/// Root mean square of a humidity that is uniform between 0 and saturation, over saturation: 1/sqrt(3).
const UNIFORM_RMS_RATIO: f64 = 0.577_350_269_189_625_8;

/// A channel that has a sensor, by its symbol.
pub(crate) struct SensorSymbol;

impl JsonSchema for SensorSymbol {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        "SensorSymbol".into()
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        schemars::json_schema!({"type": "string", "enum": CALIBRATED})
    }
}

/// Checks that days of calibration exist in the calendar.
pub(crate) fn check(check: &mut Check<'_>) {
    let tree = check.tree;
    for channel in tree.keys(&steps!["report", "calibration"]) {
        check_date(check, &steps!["report", "calibration", channel]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_usual_units_are_units() {
        let usual = DisplayUnits::default();
        for (kind, symbol) in [
            (Kind::Temperature, &usual.temperature),
            (Kind::Pressure, &usual.pressure),
            (Kind::Speed, &usual.speed),
            (Kind::MassFlow, &usual.flow),
        ] {
            assert!(kind.units().iter().any(|unit| unit.symbol() == symbol), "{symbol}");
        }
        let read = crate::testing::any::<DisplayUnits>("{pressure: bar}").unwrap();
        assert_eq!(read, DisplayUnits { pressure: "bar".into(), ..usual });
    }

    #[test]
    fn what_is_left_out_has_its_default() {
        let read = |text| crate::testing::any::<Outputs>(text).unwrap();
        assert_eq!(read("{}"), Outputs::default());
        let one = Outputs { formats: vec![FormatName("npss".to_owned())], ..Outputs::default() };
        assert_eq!(read("{formats: [npss]}"), one);
        assert_eq!(read("{directory: elsewhere}").formats, Outputs::default().formats);
    }

    #[test]
    fn written_with_units_kept_in_si() {
        let report: Report =
            crate::testing::any("{barometer: 990 mbar, humidity: 45 %, calibration: {T2: 2026-09-01}}")
                .unwrap();
        assert!((report.barometer_pa.unwrap() - 99e3).abs() < 1e-6);
        assert_eq!((report.humidity_ratio, report.cell_temperature_k), (Some(0.45), None));
        assert_eq!(report.calibration[&Channel::T2].to_string(), "2026-09-01");
        assert!(serde_json::to_value(&report).unwrap().get("barometer_pa").is_some(), "SI names in SI files");
    }
}
