//! `display:`

use crate::units::{Kind, Unit};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::json;

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
}
