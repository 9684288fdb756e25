//! Round trips of written maps; an invalid map is refused with its line.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{CompressorMap, ImportError, MAP_FILE_SIZE_LIMIT, Method, ReferenceState};
use mapper_formats::FORMATS;
use proptest::prelude::*;
use std::fmt::Write;

fn import(format: &str, text: &str, given: Option<ReferenceState>) -> Result<CompressorMap, ImportError> {
    FORMATS.find(format).unwrap().read(text.as_bytes(), given).map(|read| read.map)
}

fn export(format: &str, map: &CompressorMap) -> Vec<u8> {
    FORMATS.find(format).unwrap().write(map).unwrap()
}

/// The four numbers of every point, lines in order.
fn numbers(map: &CompressorMap) -> Vec<[Option<f64>; 4]> {
    map.lines
        .iter()
        .flat_map(|line| {
            line.points.iter().map(|p| {
                [Some(line.speed_corrected_rpm), Some(p.flow_corrected_kg_s), Some(p.pressure_ratio), p.eta]
            })
        })
        .collect()
}

prop_compose! {
    /// Lines at least 5 % apart with points of any digits, some without efficiency.
    fn any_map()(
        steps in proptest::collection::vec(0.05..0.4f64, 1..5),
        points in proptest::collection::vec((1e-4..2.0f64, 0.9..6.0f64, proptest::option::weighted(0.9, -0.2..1.0f64)), 1..30),
        reference in prop_oneof![
            Just(ReferenceState::SAE), Just(ReferenceState::GARRETT), Just(ReferenceState::BORGWARNER),
            (250.0..350.0f64, 60e3..150e3f64).prop_map(|(t_ref_k, p_ref_pa)| ReferenceState { t_ref_k, p_ref_pa })
        ],
        drift in -0.004..0.004f64,
    ) -> CompressorMap {
        let mut speed = 30_000.123;
        let mut text = String::new();
        for (i, (flow, ratio, eta)) in points.iter().enumerate() {
            if i % 6 == 0 { speed *= 1.0 + steps[(i / 6) % steps.len()]; }
            let own = speed * (1.0 + drift * (i % 3) as f64);
            // Below the maximum flow of an inlet, at all reference states.
            let flow = flow.min(0.4 * mapper_physics::compressor_map::closed_form_map::max_flow_kg_s(own));
            let _ = writeln!(text, "{own},{flow},{ratio},{}", eta.map_or(String::new(), |eta| eta.to_string()));
        }
        let head = "rpm,wc,pr,eta\n".to_owned();
        import("csv", &(head + &text), Some(reference)).unwrap()
    }
}

/// A map that was measured without temperatures keeps its flows and pressure ratios.
#[test]
fn sae_text_without_efficiencies_is_read_back() {
    let text = "rpm,wc,pr\n60000,0.05,1.3\n60000,0.04,1.4\n90000,0.06,1.9\n";
    let map = import("csv", text, Some(ReferenceState::SAE)).unwrap();
    assert_eq!(
        numbers(&import("sae", &String::from_utf8(export("sae", &map)).unwrap(), None).unwrap()),
        numbers(&map)
    );
}

proptest! {
    #[test]
    fn round_trips_lose_nothing(map in any_map()) {
        for format in ["csv", "json"] {
            let bytes = export(format, &map);
            let back = FORMATS.find(format).unwrap().read(&bytes, None).unwrap().map;
            prop_assert_eq!(numbers(&back), numbers(&map));
            prop_assert_eq!(back.reference, map.reference);
            // The values measured before the correction to a line's speed are included.
            let measured = |map: &CompressorMap| -> Vec<f64> {
                map.lines.iter().flat_map(|l| &l.points).map(|p| p.identified.flow_corrected_kg_s).collect()
            };
            prop_assert_eq!(measured(&back), measured(&map));
            if format == "csv" {
                // A second round gives identical bytes.
                prop_assert_eq!(export(format, &back), bytes);
            }
        }
        let has_eta = numbers(&map).iter().any(|row| row[3].is_some());
        let in_sae: Vec<_> = numbers(&map).into_iter().filter(|row| row[3].is_some() || !has_eta).collect();
        let back = FORMATS.find("sae").unwrap().read(&export("sae", &map), None).unwrap().map;
        // Its fields hold nine characters of a number.
        prop_assert_eq!(numbers(&back).len(), in_sae.len());
        for (a, b) in numbers(&back).iter().flatten().zip(in_sae.iter().flatten()) {
            prop_assert!((a.unwrap_or(0.0) - b.unwrap_or(0.0)).abs() <= 1e-6 * b.unwrap_or(0.0).abs().max(1.0));
        }
        prop_assert_eq!(back.reference, map.reference);
    }

    #[test]
    fn a_change_of_reference_and_back_is_none(map in any_map()) {
        let there = map.clone().at_reference(ReferenceState::GARRETT);
        let back = there.at_reference(map.reference);
        for (a, b) in numbers(&back).iter().flatten().flatten().zip(numbers(&map).iter().flatten().flatten()) {
            // A few roundings.
            prop_assert!((a - b).abs() <= 1e-14 * b.abs().max(1.0) * 10.0);
        }
    }

    /// No text and no bytes cause a panic; an accepted file is a valid map.
    #[test]
    fn nonsense_is_refused_or_read(bytes in proptest::collection::vec(any::<u8>(), 0..400), text in "[0-9eE+., ;#\t\n\"a-zKP:-]{0,300}") {
        for entry in FORMATS.iter() {
            for bytes in [bytes.as_slice(), text.as_bytes()] {
                if let Ok(map) = entry.read(bytes, Some(ReferenceState::SAE)).map(|read| read.map) {
                    prop_assert!(numbers(&map).iter().all(|row| row.iter().flatten().all(|v| v.is_finite())));
                }
            }
        }
    }
}

#[test]
fn a_map_without_reference_is_refused_with_the_usual_choices() {
    let rows = "RPM,WC,PRC,ETAC\n50000,0.05,1.3,0.6\n";
    let error = import("csv", rows, None).unwrap_err().to_string();
    for choice in ["SAE (298 K, 100 kPa)", "Garrett (545 degR, 13.95 psia)", "BorgWarner (293 K, 98.1 kPa)"] {
        assert!(error.contains(choice), "{error}");
    }
    let map = import("csv", rows, Some(ReferenceState::GARRETT)).unwrap();
    assert_eq!((map.reference, map.method), (ReferenceState::GARRETT, Method::Imported));
    assert!(matches!(import("sae", "50000 0.05 1.3 0.6", None), Err(ImportError::NoReference)));
    let stated = "# reference: 293 K, 98.1 kPa\n50000 0.05 1.3 0.6\n";
    assert_eq!(import("sae", stated, None).unwrap().reference, ReferenceState::BORGWARNER);
    assert!(matches!(
        import("sae", stated, Some(ReferenceState::SAE)),
        Err(ImportError::ReferenceConflict { .. })
    ));
}

/// Units in the heading count in any column order; without units, values impossible for a compressor are refused.
#[test]
fn units_of_columns_are_read() {
    let reference = Some(ReferenceState::SAE);
    let plain = "rpm,wc,pr,eta\n50000,0.05,1.3,0.6\n50000,0.04,1.4,0.65\n100000,0.09,2.0,0.7\n";
    let named = "eta [%];flow (g/s);N / krpm;PR\n60;50;50;1.3\n65;40;50;1.4\n70;90;100;2.0\n";
    let numbers = |text: &str| -> Vec<[f64; 4]> {
        let map = import("csv", text, reference).unwrap();
        let lines = map.lines.iter();
        lines
            .flat_map(|line| {
                line.points.iter().map(|point| {
                    [
                        line.speed_corrected_rpm,
                        point.flow_corrected_kg_s,
                        point.pressure_ratio,
                        point.eta.unwrap(),
                    ]
                })
            })
            .collect()
    };
    for (a, b) in numbers(plain).iter().flatten().zip(numbers(named).iter().flatten()) {
        // After a conversion of units: rounding error only.
        assert!((a / b - 1.0).abs() < 1e-14, "{a} and {b}");
    }
    let refused = |text: &str| import("csv", text, reference).unwrap_err();
    assert!(matches!(
        refused(&named.replace("krpm", "rpm")),
        ImportError::Flow { .. } | ImportError::Slow { .. }
    ));
    assert!(matches!(refused(&named.replace("(g/s)", "")), ImportError::Flow { line: 2, .. }));
    assert!(refused(&named.replace("g/s", "pints")).to_string().contains("kg/h"));
}

#[test]
fn mistakes_are_named_with_their_line() {
    let reference = Some(ReferenceState::SAE);
    let line = |format: &str, text: &str| match import(format, text, reference).unwrap_err() {
        ImportError::NotANumber { line, .. }
        | ImportError::Row { line, .. }
        | ImportError::RowForm { line, .. }
        | ImportError::NoColumn { line, .. }
        | ImportError::Value { line, .. }
        | ImportError::NotText { line } => line,
        other => panic!("{other}"),
    };
    assert_eq!(line("csv", "rpm,wc,pr,eta\n50000,0.1,1.3,0.6\n50000,much,1.3,0.6\n"), 3);
    assert_eq!(line("csv", "# a\nrpm,wc,pr,eta\n50000,0.1,1.3,600.0\n"), 3);
    assert_eq!(line("csv", "rpm,flow\n1,2\n"), 1);
    assert_eq!(line("sae", "N m PR Eff\n50000 0.1 1.3 0.6\n50000 0.1 1.3\n"), 3);
    assert_eq!(line("sae", "title\n50000 0.1 1.3\n"), 2);
    assert_eq!(line("sae", "50000 0.1 1.3 0.6\n0.6 0.4\n"), 2);
    assert_eq!(line("sae", "50000 -0.1 1.3 0.6\n"), 1);
    assert_eq!(line("sae", "50000 0.1 inf 0.6\n"), 1);
    let bytes = FORMATS.find("sae").unwrap().read(b"50000 0.1 1.3 0.6\n\x01\xfe", reference);
    assert!(matches!(bytes, Err(ImportError::NotText { line: 2 })));
    assert!(matches!(import("json", "{\"machine\": 3", reference), Err(ImportError::Json(_))));
    assert!(matches!(import("csv", "", reference), Err(ImportError::Empty)));
    let large = vec![b' '; MAP_FILE_SIZE_LIMIT + 1];
    assert!(matches!(
        FORMATS.find("csv").unwrap().read(&large, reference),
        Err(ImportError::TooLarge { .. })
    ));
    let deep = "[".repeat(1_000_000);
    assert!(import("json", &deep, reference).is_err());
}

#[test]
fn tables_of_others_are_read_by_their_column_names() {
    let cpgui = "NcCorr;WcCorr;PiC;etaC\n50000;0.05;1.3;0.6\n50000;0.04;1.32;0.61\n60000;0.05;1.4;0.6\n";
    let map = import("csv", cpgui, Some(ReferenceState::SAE)).unwrap();
    assert_eq!(map.lines.len(), 2);
    assert_eq!(map.lines[0].points[0].flow_corrected_kg_s, 0.04);
    let bare = "\u{feff}50000,0.05,1.3,0.6\n";
    assert_eq!(import("csv", bare, Some(ReferenceState::SAE)).unwrap().lines.len(), 1);
    // Title and wheel diameters at the start, as in manufacturers' files, and points from surge to choke.
    let heading = "ABC   T12\n0.638     0.435\n\n 6000.5 8.2 1.48 0.78\n 6000.5 9.4 1.46 0.80\n";
    let map = import("sae", heading, Some(ReferenceState::SAE)).unwrap();
    assert_eq!((map.lines.len(), map.lines[0].points.len()), (1, 2));
    // Units in the heading count, and a unit that does not fit its column is refused.
    for (heading, speed_rpm, flow_kg_s) in [
        ("N(1/min) mdot(lb/s) PR Eff\n60000 0.2", 6e4, 0.2 * 0.453_592_37),
        ("N(krpm) mdot(g/s)\n60 90", 6e4, 0.09),
        ("# N [krpm] mdot [g/s] PR Eff\n60 90", 6e4, 0.09),
        ("# of N [krpm]\n60000 0.09", 6e4, 0.09),
    ] {
        let text = format!("{heading} 1.48 0.78\n");
        match import("sae", &text, Some(ReferenceState::SAE)) {
            Ok(map) => {
                let (line, point) = (&map.lines[0], &map.lines[0].points[0]);
                assert!((line.speed_corrected_rpm / speed_rpm - 1.0).abs() < 1e-14, "{heading}");
                assert!((point.flow_corrected_kg_s / flow_kg_s - 1.0).abs() < 1e-14, "{heading}");
            }
            Err(error) => panic!("{heading}: {error}"),
        }
    }
    let error = import("sae", "N(furlongs) mdot(kg/s)\n6000.5 8.2 1.48 0.78\n", Some(ReferenceState::SAE));
    assert!(error.unwrap_err().to_string().contains("furlongs"));
    assert!(FORMATS.read_from("CSV").is_some() && FORMATS.read_from("ods").is_none());
}

/// The points of MATLAB data are read back, with their reference state; a structure is not, and the message names the way.
#[test]
fn matlab_data_are_read_back() {
    let map = crate::support::fitted();
    let format = FORMATS.find("mat").unwrap();
    let back = format.read(&format.write(&map).unwrap(), None).unwrap().map;
    assert_eq!(back.reference, map.reference);
    let count = |map: &CompressorMap| map.lines.iter().map(|line| line.points.len()).sum::<usize>();
    assert_eq!((back.lines.len(), count(&back)), (map.lines.len(), count(&map)));
    for (read, written) in
        numbers(&back).iter().flatten().flatten().zip(numbers(&map).iter().flatten().flatten())
    {
        assert!((read / written - 1.0).abs() < 1e-9, "{read} {written}");
    }
    for other in [b"MATLAB 5.0 MAT-file, Platform: GLNXA64".as_slice(), b"", &[0; 40], &[0xff; 60]] {
        assert!(format.read(other, None).is_err());
    }
}
