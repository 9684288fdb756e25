//! JSON: the unchanged map. Keys carry units, efficiencies are fractions, undefined values are null. JSON and TOML of other programs: tables over
//! speed and an auxiliary coordinate (TASOPT), columns, records or lines.

use mapper_core::{
    CompressorMap, ExportError, ImportError, ImportedMap, MapDescription, MapFormat, ReferenceState,
};
use mapper_maps::table::{MAX_POINTS, read_json_map, resolve_reference, text_of};
use serde::Serialize;
use serde_json::{Value, json};

pub(crate) const FORMAT: MapFormat = MapFormat {
    name: "json",
    extension: "json",
    further_extensions: &["toml"],
    description: "the whole map with every point's uncertainty, warnings and window",
    write: Some(write),
    read: Some(read),
    turbine: crate::turbine::JSON,
    ..MapFormat::NONE
};

/// Layout 2 numbers steps from 1. Files of version 0.1.0 have no `format`, and their steps count from 0.
const LAYOUT: u32 = 2;

#[derive(Serialize)]
struct MapDocument<'a> {
    format: u32,
    #[serde(flatten)]
    map: &'a CompressorMap,
}

fn write(map: &CompressorMap) -> Result<Vec<u8>, ExportError> {
    for point in map.lines.iter().flat_map(|line| &line.points) {
        let p = &point.identified;
        for (quantity, value) in [
            ("flow_corrected_kg_s", point.flow_corrected_kg_s),
            ("pressure_ratio", point.pressure_ratio),
            ("speed_corrected_rpm", p.speed_corrected_rpm),
            ("speed_rpm", p.speed_rpm),
            ("flow_kg_s", p.flow_kg_s),
            ("t1_k", p.t1_k),
            ("p1_pa", p.p1_pa),
        ] {
            if !value.is_finite() {
                return Err(ExportError::NotFinite { step: p.step, quantity, value });
            }
        }
    }
    let mut bytes = serde_json::to_vec_pretty(&MapDocument { format: LAYOUT, map })
        .map_err(ExportError::failed(FORMAT.name))?;
    bytes.push(b'\n');
    Ok(bytes)
}

fn read(bytes: &[u8], given: &MapDescription) -> Result<ImportedMap, ImportError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut value: Value = match serde_json::from_slice(bytes) {
        Ok(value) => value,
        Err(error) if bytes.trim_ascii_start().starts_with(b"{") => return Err(error.into()),
        // `[` begins a list in JSON and a table in TOML.
        Err(_) => toml::from_str(&text_of(bytes)?)
            .map_err(|error: toml::de::Error| ImportError::Packed { problem: error.to_string() })?,
    };
    if value.get("kind").and_then(Value::as_str) == Some(crate::turbine::KIND) {
        return Err(ImportError::Turbine { line: 1, text: format!("kind: {}", crate::turbine::KIND) });
    }
    if !is_own(&value) {
        return read_json_map(&value, given);
    }
    let found: Option<ReferenceState> = match value.get("reference") {
        None | Some(Value::Null) => None,
        Some(state) => Some(serde_json::from_value(state.clone())?),
    };
    let settled = resolve_reference(found, given.reference)?;
    if !settled.is_plausible() {
        return Err(ImportError::Reference { text: settled.to_string() });
    }
    if let Some(object) = value.as_object_mut() {
        object.insert("reference".to_owned(), serde_json::to_value(settled)?);
    }
    if value.get("format").is_none() {
        number_steps_from_one(&mut value);
    }
    let map: CompressorMap = serde_json::from_value(value)?;
    check(&map)?;
    Ok(map.into())
}

/// Whether this program wrote the document: its lines have points with the identified ones.
fn is_own(document: &Value) -> bool {
    document.get("lines").is_some_and(|lines| {
        lines
            .as_array()
            .is_some_and(|lines| lines.iter().all(|line| line.get("points").is_some_and(Value::is_array)))
    })
}

fn number_steps_from_one(map: &mut Value) {
    fn each(value: Option<&mut Value>) -> impl Iterator<Item = &mut Value> {
        value.and_then(Value::as_array_mut).into_iter().flatten()
    }
    for point in each(map.get_mut("lines")).flat_map(|line| each(line.get_mut("points"))) {
        if let Some(step) = point.pointer_mut("/identified/step") {
            *step = step.as_u64().map_or(Value::Null, |index| json!(index.saturating_add(1)));
        }
    }
}

fn check(map: &CompressorMap) -> Result<(), ImportError> {
    let count: usize = map.lines.iter().map(|line| line.points.len()).sum();
    if count == 0 {
        return Err(ImportError::Empty);
    }
    if count > MAX_POINTS {
        return Err(ImportError::TooMany { line: 1, limit: MAX_POINTS });
    }
    for (l, line) in map.lines.iter().enumerate() {
        for (p, point) in line.points.iter().enumerate() {
            let place = || format!("line {} point {} of the map", l + 1, p + 1);
            let needed = "a number above 0";
            for (quantity, value) in [
                ("line's corrected speed", line.speed_corrected_rpm),
                ("corrected flow", point.flow_corrected_kg_s),
                ("pressure ratio", point.pressure_ratio),
                ("measured corrected flow", point.identified.flow_corrected_kg_s),
                ("measured pressure ratio", point.identified.pressure_ratio),
                ("measured corrected speed", point.identified.speed_corrected_rpm),
            ] {
                if !(value.is_finite() && value > 0.0) {
                    return Err(ImportError::Field { place: place(), quantity, value, needed });
                }
            }
            if let Some(eta) = point.eta.filter(|eta| !(-5.0..=1.5).contains(eta)) {
                let needed = "a fraction (0.72), not a percentage";
                return Err(ImportError::Field {
                    place: place(),
                    quantity: "efficiency",
                    value: eta,
                    needed,
                });
            }
        }
    }
    if let Some(fitted) = &map.fitted {
        let columns = fitted.beta_ratio.len();
        let whole = fitted.lines.iter().all(|line| line.nodes.len() == columns);
        if !whole {
            let place = "fitted table".to_owned();
            let needed = "the number of nodes of every line";
            return Err(ImportError::Field { place, quantity: "beta_ratio", value: columns as f64, needed });
        }
    }
    Ok(())
}
