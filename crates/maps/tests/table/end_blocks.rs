//! The surge line of a map: a block, a sheet or columns of its own.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::table::wide::{FOUR, points};
use crate::table::workbooks::workbook;
use mapper_core::{ImportRemark, ImportedMap, MapDescription, ReferenceState, SurgeFoundBy};
use mapper_maps::table::{read_any_text, read_workbook};

fn given() -> MapDescription {
    MapDescription { reference: Some(ReferenceState::SAE), ..MapDescription::default() }
}

/// The four points, between the text above and below them.
fn file(above: &str, separator: &str, below: &str) -> String {
    let rows = FOUR.iter().map(|row| row.map(|value| value.to_string()).join(separator) + "\n");
    above.to_owned() + &rows.collect::<String>() + below
}

fn assert_has_surge_line(found: &ImportedMap, what: &str) {
    let marks: Vec<[f64; 3]> = found
        .map
        .surge
        .iter()
        .map(|mark| [mark.speed_corrected_rpm, mark.flow_corrected_kg_s, mark.pressure_ratio])
        .collect();
    assert_eq!(marks, [[6e4, 0.045, 1.42], [9e4, 0.055, 1.95]], "{what}");
    assert!(found.map.surge.iter().all(|mark| mark.found_by == SurgeFoundBy::File));
    assert_eq!(found.map.lines.iter().map(|line| line.points.len()).collect::<Vec<_>>(), [2, 2], "{what}");
}

#[test]
fn a_block_below_its_title_is_the_surge_line() {
    for (above, separator, below) in [
        ("DEMO\n", " ", "Surge Line\n60000 0.045 1.42\n90000 0.055 1.95\n"),
        ("N(rpm) m(kg/s) PR eta\n", " ", "Pumpgrenze\n60000 0.045 1.42\n90000 0.055 1.95\n"),
        ("# N(rpm) m(kg/s) PR eta\n", " ", "# Surge\n90000 0.055 1.95\n60000 0.045 1.42\n"),
        ("N [rpm],m [kg/s],PR,eta\n", ",", "Surge,,,\n60000,0.045,1.42,\n90000,0.055,1.95,\n"),
        (
            "N [rpm];m [kg/s];PR;eta\n",
            ";",
            "Ligne de pompage;;;\nN [rpm];m [kg/s];PR;\n60000;0.045;1.42;\n90000;0.055;1.95;\n",
        ),
        // In another order and other units.
        ("N [rpm],m [kg/s],PR,eta\n", ",", "Surge line,,,\nPR,m [g/s],N [krpm]\n1.42,45,60\n1.95,55,90\n"),
        ("N [rpm],m [kg/s],PR,eta\n", ",", "Surge,,,\nN,m,PR\nkrpm,g/s,-\n60,45,1.42\n90,55,1.95\n"),
        (
            "Surge line\nN [rpm],m [kg/s],PR\n60000,0.045,1.42\n90000,0.055,1.95\nSpeed lines\nN [rpm],m [kg/s],PR,eta\n",
            ",",
            "",
        ),
    ] {
        let text = file(above, separator, below);
        let found = read_any_text(&text, &given()).unwrap_or_else(|error| panic!("{error}\n{text}"));
        assert_has_surge_line(&found, &text);
    }
    let sheets: &[&[&str]] =
        &[&["N [rpm]", "m [kg/s]", "PR"], &["60000", "0.045", "1.42"], &["90000", "0.055", "1.95"]];
    let map: &[&[&str]] = &[
        &["N [rpm]", "m [kg/s]", "PR", "eta"],
        &["60000", "0.05", "1.4", "0.7"],
        &["60000", "0.06", "1.3", "0.68"],
        &["90000", "0.06", "1.9", "0.72"],
        &["90000", "0.07", "1.8", "0.71"],
    ];
    for order in [[("Surge", sheets), ("Map", map)], [("Map", map), ("Pumpgrenze", sheets)]] {
        let bytes = workbook(&order.map(|(name, rows)| (name, "visible", rows)));
        assert_has_surge_line(&read_workbook(&bytes, &given()).unwrap(), "workbook");
    }
}

/// Its points have the speeds of the lines that end at their pressure ratios: 1.4 at 60 krpm and 1.9 at 90 krpm.
#[test]
fn a_surge_line_without_speeds_gets_those_of_the_lines() {
    for (above, separator, below) in [
        ("N [rpm],m [kg/s],PR,eta\n", ",", "Surge line,,,\nm [kg/s],PR\n0.045,1.45\n0.055,1.90\n0.1,2.6\n"),
        ("N [rpm];m [kg/s];PR;eta\n", ";", "Pumpgrenze;;;\n;0.045;1.45;\n;0.055;1.90;\n;0.1;2.6;\n"),
        ("DEMO\n", " ", "Surge Line\n0.045 1.45\n0.055 1.90\n0.1 2.6\n"),
    ] {
        let text = file(above, separator, below);
        let found = read_any_text(&text, &given()).unwrap_or_else(|error| panic!("{error}\n{text}"));
        let speeds: Vec<f64> = found.map.surge.iter().map(|mark| mark.speed_corrected_rpm).collect();
        assert!(
            speeds.len() == 2 && (speeds[0] - 63e3).abs() < 1e-6 && (speeds[1] - 90e3).abs() < 1e-6,
            "{speeds:?} {text}"
        );
        assert!(found.remarks.contains(&ImportRemark::SurgeSpeeds { points: 3, left_out: 1 }), "{text}");
    }
}

#[test]
fn what_cannot_be_the_surge_line_is_named_and_never_merged() {
    let expected: Vec<[Option<f64>; 4]> = FOUR.iter().map(|row| row.map(Some)).collect();
    for (above, separator, below) in [
        // Unknown units, another end, a word in place of the speed.
        (
            "N [rpm],m [kg/s],PR,eta\n",
            ",",
            "Surge line,,,\nN [rpm],m [slug/s],PR\n60000,45,1.42\n90000,55,1.95\n",
        ),
        ("N [rpm],m [kg/s],PR,eta\n", ",", "Surge margin 10 %,,,\n60000,0.05,1.38,\n90000,0.06,1.9,\n"),
        ("N(rpm) m(kg/s) PR eta\n", " ", "Surge control line\n60000 0.05 1.38\n90000 0.06 1.9\n"),
        ("N(rpm) m(kg/s) PR eta\n", " ", "Choke line\n60000 0.07 1.1\n90000 0.08 1.2\n"),
        ("N [rpm],m [kg/s],PR,eta\n", ",", "Surge,0.045,1.42,\nSurge,0.055,1.95,\n"),
    ] {
        let text = file(above, separator, below);
        assert_eq!(points(&text), expected, "{text}");
        let found = read_any_text(&text, &given()).unwrap();
        let is_named = |remark: &ImportRemark| matches!(remark, ImportRemark::UnusedBlock { .. });
        assert!(found.map.surge.is_empty() && found.remarks.iter().any(is_named), "{text}");
    }
    // Columns of the surge line before those of the map.
    let text = "Surge flow [kg/s],Surge PR,N [rpm],m [kg/s],PR,eta\n0.04,1.4,60000,0.05,1.4,0.7\n0.04,1.4,60000,0.06,1.3,0.68\n\
                0.04,1.4,90000,0.06,1.9,0.72\n0.04,1.4,90000,0.07,1.8,0.71\n";
    assert_eq!(points(text), expected);
    let remarks = read_any_text(text, &given()).unwrap().remarks;
    let is_named = |remark: &ImportRemark| matches!(remark, ImportRemark::UnusedColumns { headings } if headings.len() == 2);
    assert!(remarks.iter().any(is_named), "{remarks:?}");
    // A word below the last point of each line is its end, and no title.
    let marked = "N [rpm],m [kg/s],PR,eta\n60000,0.06,1.3,0.68\n60000,0.05,1.4,0.7\nsurge,,,\n90000,0.07,1.8,0.71\n90000,0.06,1.9,0.72\nsurge,,,\n";
    assert_eq!(points(marked).len(), 4);
}
