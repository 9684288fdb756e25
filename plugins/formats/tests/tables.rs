//! Map files as engineers have them. All files but the turbine's hold the same made-up map: four speed lines with eight points each.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{CompressorMap, ImportError, ImportRemark, ImportedMap, ReferenceState};
use mapper_formats::FORMATS;
use std::path::Path;

fn read(file: &str, given: Option<ReferenceState>) -> Result<ImportedMap, ImportError> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/tables").join(file);
    read_bytes(file, &std::fs::read(path).unwrap(), given)
}

fn read_bytes(name: &str, bytes: &[u8], given: Option<ReferenceState>) -> Result<ImportedMap, ImportError> {
    let extension = name.rsplit('.').next().unwrap();
    FORMATS.read_from(extension).unwrap().read(bytes, given)
}

/// Corrected speed, corrected flow, pressure ratio, efficiency.
fn numbers(map: &CompressorMap) -> Vec<[Option<f64>; 4]> {
    let points = map.lines.iter().flat_map(|line| &line.points);
    let identified = points.map(|point| (&point.identified, point.eta));
    identified
        .map(|(p, eta)| {
            [Some(p.speed_corrected_rpm), Some(p.flow_corrected_kg_s), Some(p.pressure_ratio), eta]
        })
        .collect()
}

/// The map as the plainest of the files has it, in the internal units.
fn expected() -> Vec<[Option<f64>; 4]> {
    let found =
        numbers(&read("lines_separated_by_blank_and_minus.txt", Some(ReferenceState::SAE)).unwrap().map);
    // Its first line, copied by hand.
    let line = [
        (0.14, 1.105, 0.4817),
        (0.13724, 1.1484, 0.5032),
        (0.12911, 1.1896, 0.5594),
        (0.116, 1.2266, 0.6274),
    ];
    for (flow, ratio, eta) in line {
        assert!(found.iter().any(|row| row[1..] == [Some(flow), Some(ratio), Some(eta)]));
    }
    assert_eq!(found.len(), 32);
    found
}

/// Compares with the map; `digits` is the relative error of the rounded numbers in the file.
fn assert_is_the_map(file: &str, read: &ImportedMap, digits: f64, with_efficiency: bool) {
    let (found, expected) = (numbers(&read.map), expected());
    assert_eq!((read.map.lines.len(), found.len()), (4, 32), "{file}");
    for row in &found {
        // Within a line the order is by flow; equal flows may stand in either order.
        let near = |a: Option<f64>, b: Option<f64>| match (a, b) {
            (Some(a), Some(b)) => (a / b - 1.0).abs() <= digits,
            (None, _) => true,
            (Some(_), None) => false,
        };
        let place = expected.iter().position(|known| row.iter().zip(known).all(|(a, b)| near(*a, *b)));
        assert!(place.is_some(), "{file}: {row:?}");
    }
    assert_eq!(found.iter().any(|row| row[3].is_some()), with_efficiency, "{file}");
}

#[test]
fn every_layout_gives_the_same_map() {
    for (file, digits, with_efficiency) in [
        ("german.csv", 1e-9, true),
        ("gt_text.txt", 1e-9, true),
        ("sae_csv_header_only.csv", 1e-4, true),
        ("sae_csv_preamble.csv", 1e-4, true),
        ("sae.xlsx", 1e-4, true),
        ("sae_txt_four_numbers_in_title.txt", 1e-9, true),
        // One speed for the line, whose rows differ by 0.4 %.
        ("speed_only_in_first_row.csv", 5e-3, true),
        // Five digits of lb/min.
        ("lbmin_percent.csv", 1e-4, true),
        ("sae_txt_lbmin_header.txt", 1e-4, true),
        // Four and six digits of N/sqrt(T) and m sqrt(T)/p.
        ("reduced_parameters.csv", 1e-4, true),
        ("eta_dash.csv", 1e-9, true),
        ("matlab_arrays.m", 5e-3, true),
        ("no_efficiency_column.csv", 5e-3, false),
    ] {
        let read = read(file, Some(ReferenceState::SAE)).unwrap_or_else(|error| panic!("{file}: {error}"));
        assert_is_the_map(file, &read, digits, with_efficiency);
    }
}

/// A volume counts at the density of the reference state: 1.184 kg/m3 at 25 degC and 101.325 kPa (ideal gas).
#[test]
fn volume_flows_have_the_density_of_the_reference_state() {
    let state = ReferenceState { t_ref_k: 298.15, p_ref_pa: 101_325.0 };
    for (file, digits) in [("volume_flow.csv", 2e-4), ("cfm.csv", 1e-3)] {
        assert_is_the_map(file, &read(file, Some(state)).unwrap(), digits, true);
    }
}

#[test]
fn what_is_assumed_is_remarked() {
    let remarks = |file: &str| read(file, Some(ReferenceState::SAE)).unwrap().remarks;
    assert_eq!(remarks("speed_only_in_first_row.csv"), [ImportRemark::SpeedOfRowAbove]);
    assert_eq!(remarks("no_efficiency_column.csv"), [ImportRemark::NoEfficiency]);
    assert_eq!(remarks("lines_separated_by_blank_and_minus.txt"), [ImportRemark::NoHeading]);
    assert_eq!(remarks("german.csv"), []);
    let percent = "Speed,Flow [kg/s],PR,Eff\n50000,0.05,1.3,61\n50000,0.04,1.4,66\n";
    let found = read_bytes("x.csv", percent.as_bytes(), Some(ReferenceState::SAE)).unwrap();
    assert_eq!(found.remarks, [ImportRemark::EfficiencyInPercent]);
    assert_eq!(numbers(&found.map)[0][3], Some(0.66));
}

/// Reduced quantities are the same map at every reference state.
#[test]
fn reduced_quantities_need_no_reference() {
    let found = read("reduced_parameters.csv", None).unwrap();
    assert_eq!(found.map.reference, ReferenceState::SAE);
    let garrett = read("reduced_parameters.csv", Some(ReferenceState::GARRETT)).unwrap().map;
    let back = garrett.at_reference(ReferenceState::SAE);
    for (a, b) in
        numbers(&found.map).iter().flatten().flatten().zip(numbers(&back).iter().flatten().flatten())
    {
        // Rounding.
        assert!((a / b - 1.0).abs() < 1e-12);
    }
}

/// The state in the preamble of a file counts, and another one is refused.
#[test]
fn a_reference_in_the_preamble_is_noticed() {
    assert_eq!(read("gt_text.txt", None).unwrap().map.reference, ReferenceState::SAE);
    let refused = read("gt_text.txt", Some(ReferenceState::GARRETT)).unwrap_err();
    assert!(matches!(refused, ImportError::ReferenceConflict { .. }));
}

/// Measured points are corrected: 0.135 kg/s at 20.1 degC and 96.40 kPa is 0.1389 kg/s at 298 K and 100 kPa.
#[test]
fn measured_points_become_a_map() {
    let found = read("raw_points_not_corrected.csv", Some(ReferenceState::SAE)).unwrap();
    let unused = ImportRemark::UnusedColumns { headings: vec!["MP".to_owned()] };
    assert_eq!(found.remarks, [unused, ImportRemark::Measured]);
    let first = numbers(&found.map)
        .into_iter()
        .find(|row| row[1].is_some_and(|flow| (flow - 0.1389).abs() < 1e-4))
        .unwrap();
    let [speed, _, ratio, eta] = first.map(Option::unwrap);
    // 59880 sqrt(298/293.25), 106.52/96.40, and T1 (PR^0.2857 - 1)/(T2 - T1) within the definitions' difference.
    assert!((speed - 60_363.0).abs() < 1.0 && (ratio - 1.104_98).abs() < 1e-5);
    let at_constant_gamma = 293.25 * (1.104_98f64.powf(0.4 / 1.4) - 1.0) / 17.6;
    assert!((eta - at_constant_gamma).abs() < 1e-3);
}

#[test]
fn a_table_that_is_not_a_compressor_map_is_refused_by_name() {
    let refused = |file: &str| read(file, Some(ReferenceState::SAE)).unwrap_err();
    assert!(matches!(refused("turbine.txt"), ImportError::Turbine { line: 1, .. }));
    assert!(matches!(refused("npss.map"), ImportError::RelativeSpeed { fastest: 1.25 }));
    assert!(matches!(refused("pycycle.py"), ImportError::RelativeSpeed { fastest: 1.25 }));
    // X and Y have no units: 18.5 lb/min as kg/s is impossible.
    assert!(matches!(refused("digitiser_side_by_side.csv"), ImportError::Flow { line: 3, .. }));
    let text = |text: &str| read_bytes("x.csv", text.as_bytes(), Some(ReferenceState::SAE)).unwrap_err();
    assert!(matches!(text("Speed [rpm],Flow [kg/s]\n50000,0.05\n"), ImportError::NoColumn { line: 1, .. }));
    assert!(matches!(
        text("N/sqrt(T3);Expansion ratio;Flow [kg/s];Eff\n1800;1.2;0.012;0.55\n"),
        ImportError::Turbine { line: 1, .. }
    ));
}

/// Further shapes: a digitiser's lines with units, a block per speed with its title, French and Spanish headings, a percent sign in the
/// cells, a heading that is repeated, UTF-16.
#[test]
fn further_shapes() {
    let four =
        |text: &str| numbers(&read_bytes("x.csv", text.as_bytes(), Some(ReferenceState::SAE)).unwrap().map);
    let row = |speed: f64, flow: f64, ratio: f64, eta: f64| [Some(speed), Some(flow), Some(ratio), Some(eta)];
    let expected = [row(50e3, 0.04, 1.4, 0.66), row(50e3, 0.05, 1.3, 0.61), row(80e3, 0.07, 1.9, 0.7)];
    for text in [
        "Régime [tr/min];Débit [kg/s];Taux de compression;Rendement\n50000;0,05;1,3;0,61\n50000;0,04;1,4;0,66\n80000;0,07;1,9;0,7\n",
        "Velocidad (rpm)\tCaudal (kg/s)\tRelación de presiones\tRendimiento (%)\n50000\t0.05\t1.3\t61\n50000\t0.04\t1.4\t66\n80000\t0.07\t1.9\t70\n",
        "Flow kg/s,PR,Eff\nN = 50000 rpm\n0.05,1.3,61 %\n0.04,1.4,66 %\nN = 80000 rpm\n0.07,1.9,70 %\n",
        "Speed,Flow,PR,Eta\nkrpm,g/s,-,%\n50,50,1.3,61\n50,40,1.4,66\nSpeed,Flow,PR,Eta\n80,70,1.9,70\n",
        "# corrected\n! Speed(RPM) MassFlow(kg/s) PressureRatio Efficiency(fraction)\n50000 0,05 1,3 0,61\n50000 0,04 1,4 0,66\n80000 0,07 1,9 0,7\n",
    ] {
        let found = four(text);
        assert_eq!(found.len(), expected.len(), "{text}");
        for (a, b) in found.iter().flatten().zip(expected.iter().flatten()) {
            // Conversion of units.
            assert!((a.unwrap() / b.unwrap() - 1.0).abs() < 1e-12, "{text}: {a:?} {b:?}");
        }
    }
    let digitised =
        "50 krpm,,80 krpm,\nFlow [lb/min],PR,Flow [lb/min],PR\n6.6139,1.3,9.2594,1.9\n5.2911,1.4,,\n";
    let found = four(digitised);
    assert_eq!(found.len(), 3);
    assert!((found[0][1].unwrap() - 0.04).abs() < 1e-6 && found[2][0] == Some(80e3));
    let utf16: Vec<u8> = [0xfeff]
        .into_iter()
        .chain("N;m;PR;eta\n50000;0,05;1,3;0,61\n".encode_utf16())
        .flat_map(u16::to_le_bytes)
        .collect();
    let found = read_bytes("x.csv", &utf16, Some(ReferenceState::SAE)).unwrap();
    assert_eq!(numbers(&found.map), [row(50e3, 0.05, 1.3, 0.61)]);
}

/// A map with two vane angles has its tables twice; the first counts.
#[test]
fn the_first_vane_angle_counts() {
    let text = "m.NcMap = np.array([50000, 80000])\nm.RlineMap = np.array([1, 2, 3])\n\
        m.WcMap = np.array([[[0.03, 0.04, 0.05], [0.05, 0.07, 0.08]], [[0.02, 0.03, 0.04], [0.04, 0.06, 0.07]]])\n\
        m.PRmap = np.array([[[1.4, 1.35, 1.2], [2.1, 1.9, 1.5]], [[1.4, 1.35, 1.2], [2.1, 1.9, 1.5]]])\n\
        m.effMap = np.array([[[0.6, 0.7, 0.6], [0.6, 0.72, 0.6]], [[0.5, 0.6, 0.5], [0.5, 0.6, 0.5]]])\n";
    let found = read_bytes("x.py", text.as_bytes(), Some(ReferenceState::SAE)).unwrap();
    let row = |speed: f64, flow: f64, ratio: f64, eta: f64| [Some(speed), Some(flow), Some(ratio), Some(eta)];
    let expected = [
        row(50e3, 0.03, 1.4, 0.6),
        row(50e3, 0.04, 1.35, 0.7),
        row(50e3, 0.05, 1.2, 0.6),
        row(80e3, 0.05, 2.1, 0.6),
        row(80e3, 0.07, 1.9, 0.72),
        row(80e3, 0.08, 1.5, 0.6),
    ];
    assert_eq!(numbers(&found.map), expected);
    // A table that is cut short is named, and so is a word in one, with its line.
    let cut = text.replace(", [[1.4, 1.35, 1.2], [2.1, 1.9, 1.5]]])", "])").replace("0.06, 0.07", "0.06");
    assert!(matches!(
        read_bytes("x.py", cut.as_bytes(), Some(ReferenceState::SAE)),
        Err(ImportError::TableSize { flows: 11, .. })
    ));
    let word = text.replace("0.72", "much");
    assert!(matches!(
        read_bytes("x.py", word.as_bytes(), Some(ReferenceState::SAE)),
        Err(ImportError::NotANumber { line: 5, .. })
    ));
}

/// Reduced flows in every spelling of their unit: 1 bar is 100 kPa.
#[test]
fn units_of_reduced_flow() {
    let flow = |unit: &str, value: f64| {
        let text = format!(
            "N/sqrt(T) [rpm/K^0.5],m*sqrt(T)/p [{unit}],PR,eta\n3000,{value},1.3,0.6\n4000,{value},1.5,0.6\n"
        );
        numbers(&read_bytes("x.csv", text.as_bytes(), None).unwrap().map)[0][1].unwrap()
    };
    let expected = 0.02 * 100e3 / 1e3 / 298f64.sqrt();
    for (unit, value) in [
        ("kg/s*K^0.5/kPa", 0.02),
        ("kg/s*K^0.5/MPa", 20.0),
        ("kg/s*K^0.5/bar", 2.0),
        ("kg/s*K^0.5/mbar", 0.002),
        ("kg-sqrt(K)/s-kPa", 0.02),
        ("kg*sqrt(K)/(s*kPa)", 0.02),
    ] {
        assert!((flow(unit, value) / expected - 1.0).abs() < 1e-12, "{unit}");
    }
}

/// SAE text without headings may have more columns behind the efficiency: temperatures, a vane position.
#[test]
fn columns_behind_the_efficiency_are_left_out() {
    let plain = "Compressor\n50000 0.05 1.3 0.61\n50000 0.04 1.4 0.66\n80000 0.07 1.9 0.7\n";
    let expected = numbers(&read_bytes("x.sae", plain.as_bytes(), Some(ReferenceState::SAE)).unwrap().map);
    for (further, columns) in [(" 298.1\n", 1), (" 298.1 0.4\n", 2)] {
        let text = plain.replace("Compressor\n", "Compressor;").replace('\n', further).replace(';', "\n");
        let found = read_bytes("x.sae", text.as_bytes(), Some(ReferenceState::SAE)).unwrap();
        assert_eq!(numbers(&found.map), expected);
        assert!(found.remarks.contains(&ImportRemark::FurtherColumns { count: columns }));
    }
    // A row that is cut short, and measured points without headings.
    let cut = "50000 0.05 1.3 0.61 298\n50000 0.04 1.4 0.66\n";
    assert!(read_bytes("x.sae", cut.as_bytes(), Some(ReferenceState::SAE)).is_err());
    let measured = "60000 96.4 293.2 110.7 316.8 0.1323\n60000 96.4 293.2 118.2 321.4 0.1118\n";
    assert!(read_bytes("x.txt", measured.as_bytes(), Some(ReferenceState::SAE)).is_err());
}

/// Tables of GSP and GasTurb: rows.columns, the coordinate, then each speed with its values, over several lines.
#[test]
fn tables_of_gsp() {
    let table = |name: &str, values: [[f64; 3]; 2]| {
        let row = |speed: f64, row: [f64; 3]| {
            format!("  {speed:.5} {:.5} {:.5}\n  {:.5}\n", row[0], row[1], row[2])
        };
        format!(
            "{name}\n  3.00400 0.00000 0.50000\n  1.00000\n{}{}\n",
            row(0.7, values[0]),
            row(1.0, values[1])
        )
    };
    let text = [
        "99 Radial compressor\nReynolds: RNI=0.1 f=0.95 RNI=1 f=1\n".to_owned(),
        table("Mass Flow", [[0.06, 0.05, 0.04], [0.1, 0.09, 0.07]]),
        table("Efficiency", [[0.6, 0.7, 0.65], [0.62, 0.74, 0.7]]),
        table("Pressure Ratio", [[1.2, 1.4, 1.5], [1.6, 2.0, 2.2]]),
        "Surge Line\n  2.00300 0.04 0.07\n  1.00000 1.5 2.2\n".to_owned(),
    ]
    .concat();
    let read = |text: &str, keys: &[(&str, &str)]| {
        let mut given = mapper_core::MapDescription::from(Some(ReferenceState::SAE));
        keys.iter().for_each(|(key, value)| mapper_maps::table::set_key(&mut given, key, value).unwrap());
        FORMATS.read_from("map").unwrap().read(text.as_bytes(), given)
    };
    let found = read(&text, &[("design_speed", "150000 rpm"), ("flow", "kg/s")]).unwrap();
    let row = |speed: f64, flow: f64, ratio: f64, eta: f64| [Some(speed), Some(flow), Some(ratio), Some(eta)];
    let expected = [
        row(105e3, 0.04, 1.5, 0.65),
        row(105e3, 0.05, 1.4, 0.7),
        row(105e3, 0.06, 1.2, 0.6),
        row(150e3, 0.07, 2.2, 0.7),
        row(150e3, 0.09, 2.0, 0.74),
        row(150e3, 0.1, 1.6, 0.62),
    ];
    for (a, b) in numbers(&found.map).iter().flatten().zip(expected.iter().flatten()) {
        assert!((a.unwrap() / b.unwrap() - 1.0).abs() < 1e-12, "{a:?} {b:?}");
    }
    // The speeds are relative, and the file names no unit.
    assert!(matches!(read(&text, &[]), Err(ImportError::RelativeSpeed { .. })));
    assert!(matches!(read(&text, &[("design_speed", "150000 rpm")]), Err(ImportError::FlowUnit)));
    let cut = text.replacen("  0.04000\n", "", 1);
    assert!(matches!(read(&cut, &[]), Err(ImportError::RowForm { line: 3, .. })));
}

/// A measured table with a housing temperature, humidity and ends of lines; the plain map needs none of them.
#[test]
fn a_measured_table_keeps_what_was_measured() {
    let text = "N [rpm];m [kg/s];P1 [kPa];T1 [degC];P2 [kPa];T2 [degC];T_housing [degC];RH [%];note\n\
        60000;0.0449;96.4;20;125.5;55;48;50;surge\n60000;0.1323;96.4;20;110.7;43.6;45;50;\n";
    let found = read_bytes("x.csv", text.as_bytes(), Some(ReferenceState::SAE)).unwrap();
    let [first, second] = found.measured.as_slice() else { panic!("{:?}", found.measured) };
    assert_eq!((first.tc_k, first.end), (Some(48.0 + 273.15), Some(mapper_core::LineEnd::Surge)));
    assert_eq!((second.line, second.end), (3, None));
    // 50 % at 20 degC: 7.3 g/kg at sea level (psychrometric chart), at 96.4 kPa 5 % more.
    assert!((first.humidity_kg_kg.unwrap() - 0.0077).abs() < 2e-4);
    let wrong = text.replace("RH [%]", "humidity [kg/kg]");
    assert!(read_bytes("x.csv", wrong.as_bytes(), Some(ReferenceState::SAE)).is_err());
}

/// Units below the names, of every quantity that a table may have: humidity, volumes and reduced parameters too.
/// Merged cells name the machines of points; two columns of one quantity, and one of none, are named.
#[test]
fn merged_cells_name_machines_and_unused_columns_are_named() {
    let text = "Nr;Welle;Verdichter;;;;;Turbine;;Öl;\n\
                ;Drehzahl;Massenstrom;p ein;T ein;p aus;T aus;p ein;T ein;T ein;T ein\n\
                ;1/min;kg/h;mbar;°C;mbar;°C;mbar;°C;°C;K\n\
                1;59880;504,0;985,0;21,3;1088,4;38,99;1800,0;600,0;90,0;363,15\n\
                2;59880;404,0;985,0;21,3;1188,4;48,99;1900,0;610,0;91,0;364,15\n";
    let found = read_bytes("points.csv", text.as_bytes(), Some(ReferenceState::SAE)).unwrap();
    let turbine = &found.measured[0].turbine;
    let near = |value: Option<f64>, expected: f64| (value.unwrap() - expected).abs() < 1e-6;
    assert!(near(turbine.p3_pa, 180e3) && near(turbine.t3_k, 873.15) && near(turbine.oil_k, 363.15));
    assert!((found.measured[0].t1_k - 294.45).abs() < 1e-9);
    let headings = vec!["T ein Öl [K]".to_owned()];
    assert!(found.remarks.contains(&ImportRemark::UnusedColumns { headings }), "{:?}", found.remarks);
}

/// Fractions below a heading in % would be efficiencies of half a percent.
#[test]
fn fractions_in_percent_are_refused() {
    let text = "n [rpm],m [kg/s],PR,eta [%]\n60000,0.05,1.3,0.62\n60000,0.04,1.4,0.7\n";
    let error = read_bytes("map.csv", text.as_bytes(), Some(ReferenceState::SAE)).unwrap_err();
    assert!(matches!(error, ImportError::Value { quantity: "efficiency", .. }), "{error}");
}

#[test]
fn units_below_the_names_of_any_quantity() {
    let text = "Shaft Speed,Air Mass Flow,P1,T1,P2,T2,Casing temp,Abs. humidity\nkrpm,lb/min,inHg,degF,psia,degF,degF,g/kg\n\
        60,5.9525,28.940,71.33,18.336,131.1,122.1,8\n60,17.196,28.940,71.33,15.919,106.4,97.4,8\n";
    let found = read_bytes("x.csv", text.as_bytes(), Some(ReferenceState::SAE)).unwrap();
    let first = found.measured[0];
    // 5.9525 lb/min is 45 g/s, 28.94 inHg 98.0 kPa, 71.33 degF 294.99 K.
    assert!((first.flow_kg_s - 0.045).abs() < 1e-5 && (first.p1_pa - 98.0e3).abs() < 10.0);
    assert!((first.t1_k - 294.999).abs() < 1e-2 && first.humidity_kg_kg == Some(0.008));
    let reduced =
        "N/sqrt(T),m*sqrt(T)/p,PR,eta\nrpm/K^0.5,kg/s*K^0.5/kPa,-,-\n3000,0.02,1.3,0.6\n4000,0.02,1.5,0.6\n";
    let flow = numbers(&read_bytes("x.csv", reduced.as_bytes(), None).unwrap().map)[0][1].unwrap();
    assert!((flow / (0.02 * 100.0 / 298f64.sqrt()) - 1.0).abs() < 1e-12);
    let volume = "n;V;pi;eta\n1/min;m3/h;-;%\n60000;400;1,3;60\n60000;300;1,4;65\n";
    let flow = numbers(&read_bytes("x.csv", volume.as_bytes(), Some(ReferenceState::SAE)).unwrap().map)[1][1]
        .unwrap();
    // 400 m3/h at 298 K and 100 kPa.
    assert!((flow / (400.0 / 3600.0 * 1e5 / 287.05 / 298.0) - 1.0).abs() < 1e-9);
}

/// The same points in shapes of people: columns as rows, thousands with their marks, a title for each line.
#[test]
fn one_map_in_further_shapes() {
    let plain = "speed [rpm],flow [kg/s],PR,eta\n60000,0.06,1.28,0.67\n60000,0.04,1.3,0.64\n120000,0.15,2.45,0.73\n120000,0.12,2.5,0.7\n";
    let of = |name: &str, text: &str| {
        let found = read_bytes(name, text.as_bytes(), Some(ReferenceState::SAE));
        let mut rows = numbers(&found.unwrap_or_else(|why| panic!("{why}\n{text}")).map);
        rows.sort_by(|a, b| a.partial_cmp(b).unwrap());
        rows
    };
    let expected = of("x.csv", plain);
    assert_eq!(expected.len(), 4);
    let turned = "speed [rpm],60000,60000,120000,120000\nflow [kg/s],0.06,0.04,0.15,0.12\nPR,1.28,1.3,2.45,2.5\neta,0.67,0.64,0.73,0.7\n";
    let german = "Drehzahl [1/min];Massenstrom [kg/s];Druckverhältnis;Wirkungsgrad\n60.000;0,06;1,28;0,67\n60.000;0,04;1,3;0,64\n120.000;0,15;2,45;0,73\n120.000;0,12;2,5;0,7\n";
    let american = "speed [rpm];flow [kg/s];PR;eta\n60,000;0.06;1.28;0.67\n60,000;0.04;1.3;0.64\n120,000;0.15;2.45;0.73\n120,000;0.12;2.5;0.7\n";
    let titled = "Speed line 60000 rpm\nflow [kg/s]  PR  eta\n0.06 1.28 0.67\n0.04 1.3 0.64\nSpeed line 120 krpm\nflow [kg/s]  PR  eta\n0.15 2.45 0.73\n0.12 2.5 0.7\n";
    for (name, text) in [("x.csv", turned), ("x.csv", german), ("x.csv", american), ("x.txt", titled)] {
        assert_eq!(of(name, text), expected, "{text}");
    }
}

/// Gauge pressures need the ambient one: of a column, or given once.
#[test]
fn gauge_pressures_are_over_the_ambient_one() {
    let text = "N [rpm],mV [kg/h],P1 (mbarG),T1 [degC],P2 (psig),T2 [degC]\n60000,161.6,-20,20,4.0,55\n60000,476.3,-20,20,1.8,43.6\n";
    let read = |text: &str, keys: &[(&str, &str)]| {
        let mut given = mapper_core::MapDescription::from(Some(ReferenceState::SAE));
        keys.iter().for_each(|(key, value)| mapper_maps::table::set_key(&mut given, key, value).unwrap());
        FORMATS.read_from("csv").unwrap().read(text.as_bytes(), given)
    };
    assert!(read(text, &[]).unwrap_err().to_string().contains("barometer"));
    let first = read(text, &[("barometer", "98.4 kPa")]).unwrap().measured[0];
    // 4 psi are 27.579 kPa.
    assert!((first.p1_pa - 96.4e3).abs() < 1e-6 && (first.p2_pa - 125_979.0).abs() < 1.0);
    let with_column = text
        .replace("T2 [degC]", "T2 [degC],p_amb [hPa]")
        .replace(",55\n", ",55,984\n")
        .replace(",43.6\n", ",43.6,984\n");
    let found = read(&with_column, &[]).unwrap();
    assert!((found.measured[0].p2_pa - first.p2_pa).abs() < 1e-6);
}

/// Written by xlwt, with a cell in the last corner of the sheet.
#[test]
fn an_old_workbook_is_read() {
    let found = read("old_excel.xls", Some(ReferenceState::SAE)).unwrap();
    let rows = numbers(&found.map);
    assert_eq!((rows.len(), rows[0]), (8, [Some(60e3), Some(0.03), Some(1.29), Some(0.6)]));
}
