//! Rows of units, columns of compressor and turbine, and points that no compressor has.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_core::{ImportError, ImportRemark, ImportedMap, MapDescription, ReferenceState, Verdict, Warning};
use mapper_maps::table::{read_any_text, read_turbine_text};

fn read(text: &str) -> Result<ImportedMap, ImportError> {
    let given = MapDescription { reference: Some(ReferenceState::SAE), ..MapDescription::default() };
    read_any_text(text, &given)
}

/// Two lines in rpm, lb/s, pressure ratio and %, with `more` after each row.
fn imperial(heading: &str, separator: &str, more: &str) -> String {
    let rows = [
        [45e3, 0.1, 1.26, 69.0],
        [45e3, 0.15, 1.24, 75.0],
        [75e3, 0.16, 1.74, 69.0],
        [75e3, 0.25, 1.67, 75.0],
    ];
    let row = |row: &[f64; 4]| row.map(|value| value.to_string()).join(separator) + more + "\n";
    heading.to_owned() + &rows.iter().map(row).collect::<String>()
}

#[test]
fn a_row_of_units_counts_whatever_its_other_cells_hold() {
    for (heading, separator, more) in [
        ("Speed,Flow,PR,Eff,Torque,Noise,Inj\nrpm,lb/s,T-T,%,Nm,dB(A),mg/str\n", ",", ",40,80,9"),
        ("Speed;Flow;PR;Eff\nrpm;lb/s;-;%;;\n", ";", ""),
        ("Speed,Flow,PR,Eff\nN,m,pi,eta\nrpm,lb/s,-,%\n", ",", ""),
        ("rpm,lb/s,-,%\nSpeed,Flow,PR,Eff\n", ",", ""),
        ("Speed (corr.),Flow (corrected),PR (t-t),Eff (is)\n{rpm},{lb/s},{-},{%}\n", ",", ""),
        ("Speed,Flow,PR,Eff\nin rpm,in lb/s,,in %\n", ",", ""),
        ("speed flow PR eff\n(rpm) (lb/s) (-) (%)\n", " ", ""),
        ("speed flow PR eff T1\n[1/min] [lb / s] [-] [%] [deg C]\n", "  ", " 25"),
        ("# Columns: N [rpm], W [lb/s], PR, Eff [%]\n", " ", ""),
        ("% N (rpm); mdot (lb/s); PR (-); Eff (%)\n", " ", ""),
        ("# speed flow PR eff\n# rpm lb/s - %\n", "\t", ""),
        ("Units: rpm, lb/s, -, %\nspeed flow PR eff\n", " ", ""),
        ("Customer,A/B\nSpeed [rpm],Flow [lb/s],PR,Eff [%]\n", ",", ""),
        ("Speed,Flow,PR,Eff\n(rpm),(lb/s),(tot/tot),(%)\n", ",", ""),
        ("Speed [rpm];Flow [lb/s @ 298 K, 100 kPa];PR (t/s);Eff [%]\n", ";", ""),
        ("Speed_rpm,Flow_lbm_s,PR_tt,Eff_pct\n", ",", ""),
        ("Speed [rpm],Oil flow [foo],Flow [lb/s],PR,Eff [%],Flow 2 [slug/s]\n", ",", ""),
    ] {
        let mut text = imperial(heading, separator, more);
        if heading.contains("Oil flow") {
            text = heading.to_owned()
                + "45e3,1,0.1,1.26,69,3\n45e3,1,0.15,1.24,75,3\n75e3,1,0.16,1.74,69,3\n75e3,1,0.25,1.67,75,3\n";
        }
        let map = read(&text).unwrap_or_else(|error| panic!("{error}\n{text}")).map;
        let points: Vec<_> = map.lines.iter().flat_map(|line| &line.points).collect();
        // 0.1 lb/s; a pound has 0.453 592 37 kg.
        assert!((points[0].flow_corrected_kg_s - 0.045_359_237).abs() < 1e-9, "{text}");
        assert!((points[0].eta.unwrap() - 0.69).abs() < 1e-9, "{text}");
        assert_eq!((map.lines.len(), points.len()), (2, 4), "{text}");
    }
    // Words that may be units are named.
    let found = read("Speed,Flow,PR,Eff\nrot,slug,x,y\n60000,0.05,1.4,0.7\n60000,0.06,1.3,0.68\n").unwrap();
    assert!(found.remarks.contains(&ImportRemark::UnusedBlock { title: "rot slug x y".to_owned(), rows: 1 }));
    // Without any known unit the file is refused, and kg/s is not assumed.
    for heading in ["Speed,Flow,PR,Eff\nrpm,slug/s,-,%\n", "Speed,Flow,PR,Eff\nrot,slug/s,x,y\n"] {
        assert!(
            matches!(read(&imperial(heading, ",", "")), Err(ImportError::Row { line: 2, .. })),
            "{heading}"
        );
    }
}

/// N, flow, P1, T1, P2, T2 of the compressor and P3, T3, P4, T4 of the turbine, in kPa and K.
const POINTS: [[f64; 10]; 3] = [
    [50e3, 0.06, 97.6, 294.6, 129.8, 330.3, 125.6, 873.0, 101.3, 842.0],
    [80e3, 0.10, 97.1, 294.9, 179.0, 375.4, 163.8, 874.0, 101.5, 807.0],
    [105e3, 0.13, 96.7, 295.2, 237.3, 418.5, 209.3, 875.0, 101.7, 777.0],
];

/// The points below the names of the columns of compressor and turbine, the turbine's first.
fn turbine_first(compressor: [&str; 4], turbine: [&str; 4]) -> String {
    let with_unit = |(at, name): (usize, &&str)| format!(",{name} [{}]", ["kPa", "K"][at % 2]);
    let names = turbine.iter().enumerate().chain(compressor.iter().enumerate()).map(with_unit);
    let mut text = "N [rpm],m [kg/s]".to_owned() + &names.collect::<String>() + "\n";
    for row in POINTS {
        let order = [0, 1, 6, 7, 8, 9, 2, 3, 4, 5];
        text += &(order.map(|at: usize| row[at].to_string()).join(",") + "\n");
    }
    text
}

#[test]
fn columns_of_the_turbine_are_never_those_of_the_compressor() {
    for (compressor, turbine) in [
        (["P1C", "T1C", "P2C", "T2C"], ["P1T", "T1T", "P2T", "T2T"]),
        (["PC1", "TC1", "PC2", "TC2"], ["PT1", "TT1", "PT2", "TT2"]),
        (["P1_C", "T1_C", "P2_C", "T2_C"], ["P1_T", "T1_T", "P2_T", "T2_T"]),
        (["pV1", "TV1", "pV2", "TV2"], ["pT1", "TT1", "pT2", "TT2"]),
        (["P1V", "T1V", "P2V", "T2V"], ["P1T", "T1T", "P2T", "T2T"]),
        (["Pc_in", "Tc_in", "Pc_out", "Tc_out"], ["Pt_in", "Tt_in", "Pt_out", "Tt_out"]),
        (["PT1C", "TT1C", "PT2C", "TT2C"], ["PT1T", "TT1T", "PT2T", "TT2T"]),
        (["P01C", "T01C", "P02C", "T02C"], ["P01T", "T01T", "P02T", "T02T"]),
        // Alone `P1T` may be a total pressure; next to the compressor's `P1` it is the turbine's.
        (["P1", "T1", "P2", "T2"], ["P1T", "T1T", "P2T", "T2T"]),
        (["P1", "T1", "P2", "T2"], ["PT1", "TT1", "PT2", "TT2"]),
    ] {
        let found = read(&turbine_first(compressor, turbine))
            .unwrap_or_else(|error| panic!("{compressor:?} {error}"));
        for (point, row) in found.measured.iter().zip(POINTS) {
            let readings = [point.p1_pa / 1e3, point.t1_k, point.p2_pa / 1e3, point.t2_k.unwrap()];
            for (reading, value) in readings.iter().zip(&row[2..6]) {
                assert!((reading - value).abs() < 1e-6, "{compressor:?} {readings:?}");
            }
            assert!((point.turbine.t3_k.unwrap() - row[7]).abs() < 1e-6, "{turbine:?}");
        }
    }
    // Names that do not tell the machines apart.
    let text = turbine_first(["P1", "T1", "P2", "T2"], ["P1", "T1", "P2", "T2"]);
    assert!(matches!(read(&text), Err(ImportError::NotACompressor { .. })), "{text}");
}

/// Machine, place and quantity in three rows of merged cells, as stands export them.
#[test]
fn headings_of_three_rows_keep_machine_place_and_quantity() {
    for head in [
        ",,Compressor,,,,Turbine,,,\n,,Inlet,,Outlet,,Inlet,,Outlet,\nN,m,p,T,p,T,p,T,p,T\nrpm,kg/s,kPa,K,kPa,K,kPa,K,kPa,K\n",
        ",,Verdichter,,,,Turbine,,,\n,,Eintritt,,Austritt,,Eintritt,,Austritt,\nN [rpm],m [kg/s],p [kPa],T [K],p [kPa],T [K],p [kPa],T [K],p [kPa],T [K]\n",
        ",,vor Verdichter,,nach Verdichter,,vor Turbine,,nach Turbine,\nN [rpm],m [kg/s],p [kPa],T [K],p [kPa],T [K],p [kPa],T [K],p [kPa],T [K]\n",
    ] {
        let mut text = head.to_owned();
        for row in POINTS {
            text += &(row.map(|value| value.to_string()).join(",") + "\n");
        }
        let found = read(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        for (point, row) in found.measured.iter().zip(POINTS) {
            let turbine = point.turbine;
            let readings = [point.p1_pa, point.p2_pa, turbine.p3_pa.unwrap(), turbine.p4_pa.unwrap()];
            let expected = [row[2], row[4], row[6], row[8]];
            assert!(readings.iter().zip(expected).all(|(pa, kpa)| (pa / 1e3 - kpa).abs() < 1e-9), "{text}");
            assert_eq!(
                [point.t1_k, point.t2_k.unwrap(), turbine.t3_k.unwrap()],
                [row[3], row[5], row[7]],
                "{text}"
            );
        }
        assert_eq!(found.measured.len(), 3, "{text}");
    }
}

/// The unit of a state counts wherever the heading has it.
#[test]
fn units_of_states_stand_anywhere_in_the_heading() {
    for form in ["{} / {}", "{} [{}]", "{}, {}", "{} in {}", "{}_{}", "{} ({})", "{}-{}"] {
        let heading = |name: &str, unit: &str| form.replacen("{}", name, 1).replacen("{}", unit, 1);
        let names =
            [("N", "rpm"), ("m", "g/s"), ("P1", "mbar"), ("T1", "degC"), ("P2", "psia"), ("T2", "degF")];
        let head: Vec<String> = names.iter().map(|(name, unit)| heading(name, unit)).collect();
        let text = head.join(";") + "\n50000;60;976;21,45;18,83;134,87\n80000;100;971;21,75;25,96;216,05\n";
        let found = read(&text).unwrap_or_else(|error| panic!("{error}\n{text}"));
        let point = &found.measured[0];
        // Definitions of the units; NIST SP 811 for psi.
        let readings = [point.flow_kg_s, point.p1_pa, point.t1_k, point.p2_pa, point.t2_k.unwrap()];
        let expected = [0.06, 97_600.0, 294.6, 18.83 * 6_894.757, (134.87 + 459.67) / 1.8];
        for (a, b) in readings.iter().zip(expected) {
            assert!((a / b - 1.0).abs() < 1e-6, "{readings:?}\n{text}");
        }
    }
    let gauge = "N [rpm];m [kg/s];p_amb / mbar;P1 / mbar(g);T1 / K;P2 / kPa(g)\n50000;0,06;990;-14;294,6;30\n80000;0,1;990;-19;295;80\n";
    let point = &read(gauge).unwrap().measured[0];
    assert!((point.p1_pa - 97_600.0).abs() < 1e-6 && (point.p2_pa - 129_000.0).abs() < 1e-6, "{point:?}");
}

/// A set or computed value next to the reading is not used, and a flow that the stand corrected is not corrected again.
#[test]
fn set_and_computed_columns_are_no_readings() {
    let table = |names: &str| {
        format!(
            "N [rpm],{names}\n50000,0.06,97.6,294.6,129.8,320,330.3\n80000,0.10,97.1,294.9,179.0,360,375.4\n"
        )
    };
    for state in ["T2 calc [K]", "T2 soll [K]", "T2 ideal [K]"] {
        let found = read(&table(&format!("m [kg/s],P1 [kPa],T1 [K],P2 [kPa],{state},T2 [K]"))).unwrap();
        assert_eq!(
            found.measured.iter().map(|point| point.t2_k).collect::<Vec<_>>(),
            [Some(330.3), Some(375.4)]
        );
    }
    let corrected = table("m corr [kg/s],P1 [kPa],T1 [K],P2 [kPa],T3 [K],T2 [K]");
    assert!(matches!(read(&corrected), Err(ImportError::NoColumn { missing: "flow", .. })));
}

/// T2 from P2/P1 and an efficiency, by gamma of 1.4.
fn outlet_k(pressure_ratio: f64, eta: f64) -> f64 {
    300.0 * (1.0 + (pressure_ratio.powf(0.4 / 1.4) - 1.0) / eta)
}

#[test]
fn points_that_no_compressor_has_are_unusable() {
    let mut text =
        "N [rpm],flow [kg/s],P1 [kPa],T1 [K],P2 [kPa],T2 [K]\n0,0,100,300,100,300\n12,0,100,300,100,300\n"
            .to_owned();
    let etas = [1.3, 0.7, -0.5];
    for (flow, eta) in [(0.1, etas[0]), (0.12, etas[1]), (0.14, etas[2])] {
        text += &format!("80000,{flow},100,300,200,{}\n", outlet_k(2.0, eta));
    }
    let found = read(&text).unwrap();
    let points = &found.map.lines[0].points;
    let verdicts: Vec<Verdict> = points.iter().map(|point| point.identified.verdict).collect();
    assert_eq!(verdicts, [Verdict::Unusable, Verdict::Good, Verdict::Unusable]);
    assert!(matches!(points[0].identified.warnings[..], [Warning::PoorFit(_)]));
    assert!(matches!(points[2].identified.warnings[..], [Warning::NoCompression(_)]));
    assert_eq!(points.iter().map(|point| point.eta.is_some()).collect::<Vec<_>>(), [false, true, false]);
    assert!(found.remarks.contains(&ImportRemark::Standstill { rows: vec![2, 3] }), "{:?}", found.remarks);
    assert_eq!((found.map.lines.len(), found.measured.len()), (1, 3));
    // A map of corrected points.
    let map = read("N [rpm],flow [kg/s],PR,eta\n0,0,1,\n80e3,0.1,2,1.3\n80e3,0.12,1.9,0.7\n").unwrap();
    let verdicts = map.map.lines[0].points.iter().map(|point| point.identified.verdict);
    assert_eq!(verdicts.collect::<Vec<_>>(), [Verdict::Unusable, Verdict::Good]);
    // The turbine of a stand at rest.
    let text =
        "N [rpm],m [kg/s],P3 [kPa],T3 [K],P4 [kPa],T4 [K]\n0,0,100,300,100,300\n80000,0.1,180,873,101,790\n";
    let found = read_turbine_text(text, &MapDescription::default()).unwrap();
    assert_eq!(
        (found.map.points.len(), found.remarks.contains(&ImportRemark::Standstill { rows: vec![2] })),
        (1, true)
    );
}

#[test]
fn points_of_a_line_at_other_speeds_are_said_to_be_moved() {
    let text = "N [rpm],flow [kg/s],PR,eta\n79200,0.1,2,0.7\n80000,0.12,1.9,0.7\n80800,0.14,1.8,0.7\n";
    let found = read(text).unwrap();
    assert_eq!(found.map.lines.len(), 1);
    let moved = found.remarks.iter().find_map(|remark| match remark {
        ImportRemark::MovedToLineSpeed { points, max_ratio } => Some((*points, *max_ratio)),
        _ => None,
    });
    let (points, max_ratio) = moved.unwrap();
    assert_eq!(points, 2);
    assert!((max_ratio - 0.01).abs() < 1e-6, "{max_ratio}");
}

#[test]
fn parameters_are_reduced_and_open_units_are_asked_for() {
    let rows = "1450,0.0087,1.25,0.75\n1450,0.0161,1.65,0.77\n";
    for heading in
        ["speedpar.,massflowpar.,PiT,eta_sT", "Speed Parameter,Mass Flow Parameter,expansion ratio,eta"]
    {
        let text = format!("{heading}\n{rows}");
        assert!(matches!(read(&text), Err(ImportError::Turbine { .. })), "{heading}");
        let asked = read_turbine_text(&text, &MapDescription::default());
        assert!(matches!(asked, Err(ImportError::NoUnit { key: "reduced_flow", .. })), "{heading}");
        let text = text.replace("massflowpar.", "massflowpar. [kg/s*K^0.5/kPa]");
        let text = text.replace("Flow Parameter", "Flow Parameter [kg/s*K^0.5/kPa]");
        let map = read_turbine_text(&text, &MapDescription::default()).unwrap().map;
        let point = map.points[0];
        assert_eq!(
            (point.speed_parameter_rpm_sqrt_k, point.flow_parameter_kg_sqrt_k_s_kpa),
            (1450.0, 0.0087)
        );
    }
    // A mass or a volume flow.
    for (heading, key) in [("Q", "flow"), ("Volume flow", "volume_flow")] {
        let text = format!("N [rpm],{heading},PR,eta\n45000,0.05,1.26,0.7\n45000,0.06,1.2,0.7\n");
        assert!(
            matches!(read(&text), Err(ImportError::NoUnit { key: asked, .. }) if asked == key),
            "{heading}"
        );
    }
    let text = "Nozzle,RPM,PRT,Q,EtaT\n0.2,25085,1.25,0.00124,0.751\n0.2,25085,1.65,0.00223,0.777\n";
    assert!(matches!(
        read_turbine_text(text, &MapDescription::default()),
        Err(ImportError::NoUnit { key: "flow", .. })
    ));
}

#[test]
fn a_comment_with_a_reference_state_is_no_list_of_columns() {
    for text in [
        "# reference: 288 K, 101325 Pa\nN [rpm];m [kg/s];PR;eta\n45000;0.05;1.26;0.7\n",
        "# reference: 288 K, 101325 Pa, dry\nN [rpm],m [kg/s],PR,eta\n45000,0.05,1.26,0.7\n",
    ] {
        let found = read_any_text(text, &MapDescription::default());
        let is_as_stated = |found: &ImportedMap| {
            found.map.reference == ReferenceState { t_ref_k: 288.0, p_ref_pa: 101_325.0 }
        };
        // A comma between blanks may be lost, the state may not become another one.
        assert!(found.is_err() || found.as_ref().is_ok_and(is_as_stated), "{text}");
        assert!(text.contains("dry") || found.is_ok(), "{text}");
    }
}

#[test]
fn no_unit_is_dropped_in_silence() {
    for (heading, separator) in [
        ("Speed rpm,Flow slug/s,PR,Eff %\n", ","),
        ("Speed, rpm;Flow, slugs;PR;Eff, %\n", ";"),
        ("Speed_rpm,Flow_stones,PR,Eff_pct\n", ","),
        ("Speed (rpm),Flow (kip/h),PR,Eff (%)\n", ","),
        ("# N [rpm], W [slug/s], PR, Eff [%]\n", " "),
    ] {
        let refused = read(&imperial(heading, separator, ""));
        assert!(matches!(refused, Err(ImportError::Row { line: 1, .. })), "{heading}: {refused:?}");
    }
    // No air is as cold as 22 K.
    let cold = read("N [rpm],m [kg/s],P1 [kPa],T1,P2 [kPa],T2\n80000,0.1,98,22,196,110\n");
    assert!(matches!(cold, Err(ImportError::Value { line: 2, quantity: "T1 in K", .. })), "{cold:?}");
    // A pressure and a temperature have the unit of the others.
    let shared = read("N [rpm],m [kg/s],P1 [kPa],T1 [degC],P2,T2\n80000,0.1,98,22,196,110\n").unwrap();
    assert_eq!((shared.measured[0].p2_pa, shared.measured[0].t2_k), (196e3, Some(383.15)));
    for unit in ["g/s*K^0.5/kPa", "(g/s)*sqrt(K)/kPa"] {
        let text = format!("N/sqrt(T3) [rpm/K^0.5],MFP [{unit}],ER,Eff\n2000,12,1.3,0.6\n");
        let found = read_turbine_text(&text, &MapDescription::default()).unwrap();
        assert_eq!(found.map.points[0].flow_parameter_kg_sqrt_k_s_kpa, 0.012, "{unit}");
    }
}

/// Between tabs, as between other separators, a row may begin with an empty cell: the speed of the row above.
#[test]
fn a_row_between_tabs_may_begin_with_an_empty_cell() {
    for separator in ["\t", ";"] {
        let text =
            "Speed [rpm];Flow [kg/s];PR;Eff\n60000;0.05;1.4;0.7\n;0.06;1.3;0.68\n".replace(';', separator);
        let map = read(&text).unwrap().map;
        let flows: Vec<f64> = map.lines[0].points.iter().map(|point| point.flow_corrected_kg_s).collect();
        assert_eq!((map.lines.len(), flows), (1, vec![0.05, 0.06]));
    }
}
