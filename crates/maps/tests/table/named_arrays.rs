//! Maps as arrays with names: JSON and TOML in the shapes of public collections, and variables of MATLAB.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{DesignPoint, ImportError, ImportedMap, MapDescription, ReferenceState};
use mapper_maps::table::{NamedArray, read_json_map, read_named_arrays, read_turbine_arrays};
use proptest::prelude::*;
use serde_json::json;

fn given() -> MapDescription {
    MapDescription { reference: Some(ReferenceState::SAE), ..MapDescription::default() }
}

/// Speed, flow, pressure ratio, efficiency of every point.
fn points(found: &ImportedMap) -> Vec<[f64; 4]> {
    let lines = found.map.lines.iter();
    let of_line = |line: &mapper_core::SpeedLine| -> Vec<[f64; 4]> {
        let point = |point: &mapper_core::MapPoint| {
            [
                line.speed_corrected_rpm,
                point.flow_corrected_kg_s,
                point.pressure_ratio,
                point.eta.unwrap_or(f64::NAN),
            ]
        };
        line.points.iter().map(point).collect()
    };
    lines.flat_map(of_line).collect()
}

const EXPECTED: [[f64; 4]; 4] =
    [[6e4, 0.05, 1.4, 0.7], [6e4, 0.06, 1.3, 0.68], [9e4, 0.06, 1.9, 0.72], [9e4, 0.07, 1.8, 0.71]];

fn assert_expected(found: &ImportedMap, what: &str) {
    let points = points(found);
    assert_eq!(points.len(), EXPECTED.len(), "{what}");
    for (a, b) in points.iter().flatten().zip(EXPECTED.iter().flatten()) {
        // A conversion of units: rounding.
        assert!((a / b - 1.0).abs() < 1e-12, "{what}: {points:?}");
    }
}

#[test]
fn documents_of_other_programs_are_maps() {
    let tables = json!({"flow": [[0.05, 0.06], [0.06, 0.07]], "pr": [[1.4, 1.3], [1.9, 1.8]], "eta": [[0.7, 0.68], [0.72, 0.71]]});
    for document in [
        // Columns, with units next to them or in a list.
        json!({"speed": [6e4, 6e4, 9e4, 9e4], "flow": [0.05, 0.06, 0.06, 0.07], "PR": [1.4, 1.3, 1.9, 1.8], "eff": [0.7, 0.68, 0.72, 0.71]}),
        json!({"map": {"N": {"unit": "krpm", "values": [60, 60, 90, 90]}, "flow": {"unit": "g/s", "values": [50, 60, 60, 70]},
            "PR": {"values": [1.4, 1.3, 1.9, 1.8]}, "eta": {"unit": "%", "values": [70, 68, 72, 71]}}}),
        json!({"units": {"N": "krpm", "mdot": "kg/h"}, "N": [60, 60, 90, 90], "mdot": [180, 216, 216, 252], "PR": [1.4, 1.3, 1.9, 1.8], "eta": [70, 68, 72, 71]}),
        // Records, and lines with one speed each.
        json!([
            {"rpm": 6e4, "flow": 0.05, "pr": 1.4, "eta": 0.7}, {"rpm": 6e4, "flow": 0.06, "pr": 1.3, "eta": 0.68},
            {"rpm": 9e4, "flow": 0.06, "pr": 1.9, "eta": 0.72}, {"rpm": 9e4, "flow": 0.07, "pr": 1.8, "eta": 0.71},
        ]),
        json!({"lines": [
            {"speed": 6e4, "flow": [0.05, 0.06], "pr": [1.4, 1.3], "eta": [0.7, 0.68]},
            {"speed": 9e4, "flow": [0.06, 0.07], "pr": [1.9, 1.8], "eta": [0.72, 0.71]},
        ]}),
        json!({"speed_lines": [
            {"rpm": 6e4, "points": [{"flow": 0.05, "pr": 1.4, "eff": 0.7}, {"flow": 0.06, "pr": 1.3, "eff": 0.68}]},
            {"rpm": 9e4, "points": [{"flow": 0.06, "pr": 1.9, "eff": 0.72}, {"flow": 0.07, "pr": 1.8, "eff": 0.71}]},
        ]}),
        json!({
            "60000": {"flow": [0.05, 0.06], "pratio": [1.4, 1.3], "eta": [0.7, 0.68]},
            "90000": {"flow": [0.06, 0.07], "pratio": [1.9, 1.8], "eta": [0.72, 0.71]},
        }),
        // Tables over speed and beta, and over beta and speed.
        json!({"grid": {"grid_Nc": [6e4, 9e4], "grid_Rline": [1.0, 2.0]}, "characteristic": tables}),
        json!({"Nc": [6e4, 9e4], "beta": [0.0, 0.5, 1.0], "Wc": [[0.05, 0.06], [0.06, 0.07], [0.06, 0.07]],
            "PR": [[1.4, 1.9], [1.3, 1.8], [1.3, 1.8]], "eta": [[70, 72], [68, 71], [68, 71]]}),
        // Tables over speed and flow, and grids of all.
        json!({"speed_rpm": [6e4, 9e4], "flow": [[0.05, 0.06], [0.06, 0.07]], "pressure_ratio": [[1.4, 1.3], [1.9, 1.8]], "efficiency": [[0.7, 0.68], [0.72, 0.71]]}),
        json!({"N": [[6e4, 6e4], [9e4, 9e4]], "m": [[0.05, 0.06], [0.06, 0.07]], "pi": [[1.4, 1.3], [1.9, 1.8]], "eta": [[0.7, 0.68], [0.72, 0.71]]}),
    ] {
        let found = read_json_map(&document, &given()).unwrap_or_else(|error| panic!("{error}\n{document}"));
        let mut found = found;
        // The third column repeats the second.
        for line in &mut found.map.lines {
            line.points.dedup_by(|a, b| a.flow_corrected_kg_s == b.flow_corrected_kg_s);
        }
        assert_expected(&found, &document.to_string());
    }
    // Relative speeds and a design point, as TASOPT has them: speed 1 is 90 krpm, and its flow there 0.06 kg/s is 30 lb/s.
    let document = json!({"design": {"des_Nc": 1.0, "des_Rline": 1.0}, "grid": {"grid_Nc": [0.5, 1.0], "grid_Rline": [1.0, 2.0]},
        "characteristic": {"massflow": [[20.0, 25.0], [30.0, 35.0]], "pressure_ratio": [[1.4, 1.3], [1.9, 1.8]], "isen_efficiency": [[0.7, 0.68], [0.72, 0.71]]}});
    let design = DesignPoint {
        speed_corrected_rpm: Some(9e4),
        flow_corrected_kg_s: Some(0.06),
        ..DesignPoint::default()
    };
    let points = points(&read_json_map(&document, &MapDescription { design, ..given() }).unwrap());
    assert_eq!((points[0][0], points[2][0]), (45e3, 9e4));
    assert!((points[0][1] - 0.04).abs() < 1e-12 && (points[2][1] - 0.06).abs() < 1e-12, "{points:?}");
    // Anything but a map is refused with a reason.
    let unknown = json!({"units": {"m": "slug/s"}, "N": [6e4, 9e4], "m": [0.05, 0.06], "PR": [1.4, 1.9]});
    assert!(read_json_map(&unknown, &given()).unwrap_err().to_string().contains("slug/s"));
    for document in [
        json!({}),
        json!([1, 2, 3]),
        json!({"a": [[1, 2], [3, 4]]}),
        json!({"flow": [0.1, 0.2]}),
        json!("map"),
    ] {
        assert!(read_json_map(&document, &given()).is_err(), "{document}");
    }
}

/// The vectors of a surge line have names of their own and another length; a matrix alone has the usual columns.
#[test]
fn variables_of_matlab_are_a_map() {
    let vector = |name: &str, values: &[f64]| NamedArray {
        name: name.to_owned(),
        rows: values.len(),
        columns: 1,
        values: values.to_vec(),
    };
    for [speed, flow, ratio, eta, ends] in [
        ["SAE_map_comp.RPM", "SAE_map_comp.m_dot", "SAE_map_comp.PR", "SAE_map_comp.eff", "_surge"],
        ["comp.NcCorr", "comp.WcCorr", "comp.PiC", "comp.etaC", "_surge"],
        ["n_rpm", "mflow_kg_s", "pressureRatio", "etaIsentropic", "_surge"],
    ] {
        let arrays = [
            vector("notes.year", &[2026.0]),
            vector(speed, &EXPECTED.map(|row| row[0])),
            vector(flow, &EXPECTED.map(|row| row[1])),
            vector(ratio, &EXPECTED.map(|row| row[2])),
            vector(eta, &EXPECTED.map(|row| row[3])),
            vector(&format!("{speed}{ends}"), &[6e4, 9e4]),
            vector(&format!("{flow}{ends}"), &[0.045, 0.055]),
            vector(&format!("{ratio}{ends}"), &[1.42, 1.95]),
        ];
        let found =
            read_named_arrays(&arrays, "", &given()).unwrap_or_else(|error| panic!("{speed}: {error}"));
        assert_expected(&found, speed);
        let marks: Vec<f64> = found.map.surge.iter().map(|mark| mark.flow_corrected_kg_s).collect();
        assert_eq!(marks, [0.045, 0.055], "{speed}");
    }
    // The map of the compressor together with that of the turbine, and that of the turbine alone.
    let turbine = [
        vector("turb.RPM", &[1500.0, 1500.0, 1900.0, 1900.0, 1900.0]),
        vector("turb.PR", &[1.3, 2.0, 1.3, 2.0, 2.5]),
        vector("turb.mfp [kg/s*K^0.5/kPa]", &[0.009, 0.016, 0.009, 0.016, 0.019]),
        vector("turb.eff", &[0.7, 0.72, 0.7, 0.73, 0.72]),
    ];
    let compressor = ["comp.RPM", "comp.m_dot", "comp.PR", "comp.eff"];
    let compressor = (0..4).map(|at| vector(compressor[at], &EXPECTED.map(|row| row[at])));
    let both: Vec<NamedArray> = turbine.iter().cloned().chain(compressor).collect();
    assert_expected(&read_named_arrays(&both, "", &given()).unwrap(), "both");
    let alone = read_named_arrays(&turbine, "", &given());
    assert!(matches!(alone, Err(ImportError::Turbine { .. })));
    let found = read_turbine_arrays(&turbine, "", &given()).unwrap();
    assert_eq!((found.map.points.len(), found.map.points[0].expansion_ratio), (5, 1.3));
    let stored: Vec<f64> = (0..4).flat_map(|column| EXPECTED.map(|row| row[column])).collect();
    let matrix = NamedArray::of_columns("compmap".to_owned(), 4, 4, &stored);
    assert_expected(&read_named_arrays(&[matrix], "", &given()).unwrap(), "matrix");
}

/// Numbers, texts and lists in each other, under names that headings have.
fn any_document() -> impl Strategy<Value = serde_json::Value> {
    let leaf = prop_oneof![
        (-1e6..1e6f64).prop_map(|number| json!(number)),
        proptest::collection::vec(0.0..1e5f64, 0..5).prop_map(|list| json!(list)),
        "[a-z/]{0,6}".prop_map(|text| json!(text)),
        Just(json!(null)),
    ];
    leaf.prop_recursive(4, 40, 6, |inner| {
        let name = prop_oneof![
            Just("speed"),
            Just("flow"),
            Just("pr"),
            Just("eta"),
            Just("units"),
            Just("pr_surge"),
            Just("x(1)"),
            Just("")
        ];
        prop_oneof![
            proptest::collection::vec(inner.clone(), 0..5).prop_map(|list| json!(list)),
            proptest::collection::btree_map(name.prop_map(str::to_owned), inner, 0..6)
                .prop_map(|map| json!(map)),
        ]
    })
}

proptest! {
    #[test]
    fn no_document_panics(document in any_document()) {
        let _ = read_json_map(&document, &given());
    }
}

/// Many names, many elements, and a speed for each of them in an outer structure end soon.
#[test]
fn large_documents_end() {
    let many: serde_json::Map<String, serde_json::Value> =
        (0..100_000).map(|at| (format!("flow{at}"), json!([0.1, 0.2]))).collect();
    let inner: Vec<serde_json::Value> = (0..2000).map(|at| json!({"flow": at})).collect();
    let outer: serde_json::Map<String, serde_json::Value> = (0..2000)
        .map(|at| (format!("speed{at}"), json!(at)))
        .chain([("points".to_owned(), json!(inner))])
        .collect();
    for document in [json!(many), json!([outer.clone(), outer])] {
        assert!(matches!(read_json_map(&document, &given()), Err(ImportError::TooMany { .. })));
    }
}
