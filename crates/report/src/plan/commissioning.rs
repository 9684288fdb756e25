//! Measured motions of a stand's actuators next to the declared ones, and the lines for the campaign.

use crate::document::{Document, Table};
use crate::formatting::significant_digits;
use mapper_core::with_unit;
use mapper_observe::{Fitted, MeasuredValue};
use serde_json::{Value, json};

/// Significant digits of a value. Bound: intervals of commissionings are wider than a per cent.
const DIGITS: usize = 3;

/// The measured values, and whether the campaign agrees with them.
pub fn commissioning_document(values: &[MeasuredValue]) -> Document {
    let mut table =
        Table::new(["value", "declared", "measured (95 %)", "declaration"]).with_texts([0, 1, 2, 3]);
    for value in values {
        let actuator = match value.actuator {
            "turbine_inlet_pressure" => "P3",
            "turbine_inlet_temperature" => "T3",
            other => other,
        };
        table.row([
            format!("{actuator} {}", value.key),
            text(value, value.declared),
            measured(value),
            if value.agrees() { "agrees" } else { "differs" }.to_owned(),
        ]);
    }
    let mut document = Document::default();
    document.table(table);
    let different = values.iter().filter(|value| !value.agrees()).count();
    document.text(match different {
        0 => "The declaration agrees with the stand: nothing has to be changed.".to_owned(),
        1 => "1 value differs from the declaration.".to_owned(),
        count => format!("{count} values differ from the declaration."),
    });
    document
}

/// The same for a program: in the units of campaigns; a rate that does not limit the motion has no value.
pub fn commissioning_json(values: &[MeasuredValue]) -> Value {
    let entry = |value: &MeasuredValue| {
        let mut entry = json!(value);
        (entry["agrees"], entry["to_declare"]) = (json!(value.agrees()), json!(value.to_declare()));
        entry
    };
    values.iter().map(entry).collect()
}

/// Actuator, key and text of each value to declare.
pub fn values_to_declare(values: &[MeasuredValue]) -> Vec<(&'static str, &'static str, String)> {
    let entry = |value: &MeasuredValue| (value.actuator, value.key, text(value, value.to_declare()));
    values.iter().map(entry).collect()
}

fn text(value: &MeasuredValue, number: f64) -> String {
    with_unit(significant_digits(number, DIGITS), value.unit)
}

fn measured(value: &MeasuredValue) -> String {
    let Fitted { value: found, low, high } = value.measured;
    match high.is_finite() {
        true => format!("{} ({} to {})", text(value, found), text(value, low), text(value, high)),
        false => format!("at least {}", text(value, low)),
    }
}
