//! Matrices over speed and flow, one of each quantity.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use super::wide::{FOUR, points};
use super::workbooks::workbook;
use mapper_core::{MapDescription, ReferenceState};
use mapper_maps::table::{file_text, read_any_text, read_workbook};

fn expected() -> Vec<[Option<f64>; 4]> {
    FOUR.iter().map(|row| row.map(Some)).collect()
}

/// The four points as matrices: below each other, side by side, with speeds down and a unit of their own, and with decimal commas.
#[test]
fn a_matrix_of_each_quantity_makes_one_map() {
    for text in [
        "Pressure ratio\nflow [kg/s],60000,90000\n0.05,1.4,\n0.06,1.3,1.9\n0.07,,1.8\n\n\
         Efficiency\nflow [kg/s],60000,90000\n0.05,0.7,\n0.06,0.68,0.72\n0.07,,0.71\n",
        "PR,,,,eta [%]\nm [g/s] \\ n [krpm],60,90,,m [g/s] \\ n [krpm],60,90\n50,1.4,,,50,70,\n60,1.3,1.9,,60,68,72\n70,,1.8,,70,,71\n",
        "压比\n转速 [rpm] \\ 流量 [kg/s];0,05;0,06;0,07\n60000;1,4;1,3;\n90000;;1,9;1,8\n效率\n转速 [rpm] \\ 流量 [kg/s];0,05;0,06;0,07\n60000;0,7;0,68;\n90000;;0,72;0,71\n",
        // Flows that differ between the lines have a matrix of their own.
        "Flow [kg/s]\nbeta,60 krpm,90 krpm\n0,0.05,0.06\n1,0.06,0.07\nPR\nbeta,60 krpm,90 krpm\n0,1.4,1.9\n1,1.3,1.8\n\
         Isentropic efficiency\nbeta,60 krpm,90 krpm\n0,0.7,0.72\n1,0.68,0.71\n",
    ] {
        let rounded = |row: [Option<f64>; 4]| row.map(|value| value.map(|value| (1e9 * value).round() / 1e9));
        assert_eq!(points(text).into_iter().map(rounded).collect::<Vec<_>>(), expected(), "{text}");
    }
}

/// Sheets named after their quantity, and a sheet of notes.
#[test]
fn a_sheet_of_each_quantity_makes_one_map() {
    let notes: &[&[&str]] = &[&["Reference 298 K 100 kPa"]];
    let ratios: &[&[&str]] = &[
        &["flow [kg/s]", "60000", "90000"],
        &["0.05", "1.4", ""],
        &["0.06", "1.3", "1.9"],
        &["0.07", "", "1.8"],
    ];
    let etas: &[&[&str]] = &[
        &["flow [kg/s]", "60000", "90000"],
        &["0.05", "0.7", ""],
        &["0.06", "0.68", "0.72"],
        &["0.07", "", "0.71"],
    ];
    let given = MapDescription { reference: Some(ReferenceState::SAE), ..MapDescription::default() };
    for (ratio, eta) in [("PR", "eta"), ("Druckverhältnis", "Wirkungsgrad")] {
        let book =
            workbook(&[("Notes", "visible", notes), (eta, "visible", etas), (ratio, "visible", ratios)]);
        let numbers = |map: mapper_core::CompressorMap| {
            let points = map.lines.into_iter().flat_map(|line| line.points);
            points.map(|p| (p.flow_corrected_kg_s, p.pressure_ratio, p.eta)).collect::<Vec<_>>()
        };
        let found = numbers(read_workbook(&book, &given).unwrap().map);
        assert_eq!(found, FOUR.map(|[_, flow, ratio, eta]| (flow, ratio, Some(eta))));
        let text = file_text(&book).unwrap();
        assert_eq!(numbers(read_any_text(&text, &given).unwrap().map), found, "{text}");
    }
}

/// Without a title a matrix may hold any quantity, and axes without speeds are none of a map.
#[test]
fn a_matrix_without_a_title_or_a_speed_is_refused() {
    let given = MapDescription { reference: Some(ReferenceState::SAE), ..MapDescription::default() };
    for text in [
        "flow [kg/s],60000,90000\n0.05,1.4,\n0.06,1.3,1.9\n0.07,,1.8\n",
        "PR\nflow,1,2\n0.05,1.4,\n0.06,1.3,1.9\n0.07,,1.8\n",
    ] {
        assert!(read_any_text(text, &given).is_err(), "{text}");
    }
}
