//! What a file leaves open is stated: design points, units, columns.

use mapper_core::{CompressorMap, ImportError, ImportRemark, ImportedMap, MapDescription};
use mapper_formats::FORMATS;
use mapper_maps::table::{description_from_yaml, description_text, set_key};
use std::path::Path;

fn stated(statements: &[(&str, &str)]) -> MapDescription {
    let mut description = MapDescription::default();
    for (key, value) in statements {
        set_key(&mut description, key, value).unwrap_or_else(|error| panic!("{error}"));
    }
    description
}

fn read(name: &str, text: &str, statements: &[(&str, &str)]) -> Result<ImportedMap, ImportError> {
    let extension = name.rsplit('.').next().unwrap();
    FORMATS.read_from(extension).unwrap().read(text.as_bytes(), stated(statements))
}

/// Speed, flow, pressure ratio and efficiency of every point, as measured.
fn points(map: &CompressorMap) -> Vec<[f64; 4]> {
    let points = map.lines.iter().flat_map(|line| &line.points);
    points
        .map(|point| {
            let own = &point.identified;
            [own.speed_corrected_rpm, own.flow_corrected_kg_s, own.pressure_ratio, point.eta.unwrap_or(0.0)]
        })
        .collect()
}

fn assert_near(found: &[[f64; 4]], expected: &[[f64; 4]]) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    for (a, b) in found.iter().flatten().zip(expected.iter().flatten()) {
        // Conversion of units.
        assert!((a / b - 1.0).abs() < 1e-12, "{found:?} {expected:?}");
    }
}

const EXPECTED: [[f64; 4]; 4] =
    [[56e3, 0.05, 1.5, 0.66], [56e3, 0.06, 1.3, 0.6], [80e3, 0.08, 2.2, 0.72], [80e3, 0.1, 1.8, 0.64]];
const SPEED: (&str, &str) = ("design_speed", "80 krpm");
const SAE: (&str, &str) = ("reference", "SAE");

const NPSS: &str = "Subelement CompressorRlineMap S_map {\n NcMapDes = 1.0; RlineMapDes = 1.5;\n\
    Table TB_Wc(real alphaMap, real NcMap, real RlineMap) {\n alphaMap = 0 {\n\
    NcMap = 0.7 { RlineMap = {1, 2} WcMap = {0.05, 0.06} }\n NcMap = 1.0 { RlineMap = {1, 2} WcMap = {0.08, 0.10} } } }\n\
    Table TB_PR(real alphaMap, real NcMap, real RlineMap) {\n alphaMap = 0 {\n\
    NcMap = 0.7 { RlineMap = {1, 2} PRmap = {1.5, 1.3} }\n NcMap = 1.0 { RlineMap = {1, 2} PRmap = {2.2, 1.8} } } }\n\
    Table TB_eff(real alphaMap, real NcMap, real RlineMap) {\n alphaMap = 0 {\n\
    NcMap = 0.7 { RlineMap = {1, 2} effMap = {0.66, 0.6} }\n NcMap = 1.0 { RlineMap = {1, 2} effMap = {0.72, 0.64} } } }\n}\n";

const PYCYCLE: &str = "m = MapData()\nm.defaults = {'alphaMap': 0.0, 'NcMap': 1.0, 'RlineMap': 1.5}\n\
    m.NcMap = np.array([0.7, 1.0])\nm.RlineMap = np.array([1.0, 2.0])\n\
    m.WcMap = np.array([[[0.05, 0.06], [0.08, 0.10]]])\nm.PRmap = np.array([[[1.5, 1.3], [2.2, 1.8]]])\n\
    m.effMap = np.array([[[0.66, 0.6], [0.72, 0.64]]])\n";

#[test]
fn relative_speeds_need_a_design_speed_and_a_unit_of_flow() {
    for (name, text) in [("x.map", NPSS), ("x.py", PYCYCLE)] {
        assert!(matches!(read(name, text, &[SAE]), Err(ImportError::RelativeSpeed { .. })), "{name}");
        // A factor of 2.2 between lb/s and kg/s must not pass.
        assert!(matches!(read(name, text, &[SAE, SPEED]), Err(ImportError::FlowUnit)), "{name}");
        let found = read(name, text, &[SAE, SPEED, ("flow", "kg/s")]).unwrap();
        assert_near(&points(&found.map), &EXPECTED);
        assert_eq!(found.remarks, [ImportRemark::DesignSpeed { rpm: 80e3 }]);
        let pounds = read(name, text, &[SAE, SPEED, ("flow", "lb/s")]).unwrap();
        assert!((points(&pounds.map)[0][1] / (0.05 * 0.453_592_37) - 1.0).abs() < 1e-12);
    }
    // The unit in the file itself.
    let named = format!("{PYCYCLE}m.units = {{'NcMap': 'rpm', 'WcMap': 'lbm/s'}}\n");
    assert!(
        (points(&read("x.py", &named, &[SAE, SPEED]).unwrap().map)[0][1] - 0.05 * 0.453_592_37).abs() < 1e-12
    );
}

/// At the design point (Nc 1, Rline 1.5) the tables have 0.09, 2.0 and 0.68.
#[test]
fn a_map_is_scaled_to_the_design_point() {
    for (name, text) in [("x.map", NPSS), ("x.py", PYCYCLE)] {
        let all = [
            SAE,
            SPEED,
            ("design_flow", "180 g/s"),
            ("design_pressure_ratio", "3"),
            ("design_efficiency", "34 %"),
        ];
        let found = points(&read(name, text, &all).unwrap().map);
        let expected = EXPECTED
            .map(|[speed, flow, ratio, eta]| [speed, 2.0 * flow, 1.0 + 2.0 * (ratio - 1.0), eta / 2.0]);
        assert_near(&found, &expected);
    }
    let outside = PYCYCLE.replace("'RlineMap': 1.5", "'RlineMap': 3.5");
    let refused = read("x.py", &outside, &[SAE, SPEED, ("design_flow", "0.18 kg/s")]);
    assert!(matches!(refused, Err(ImportError::DesignPoint { .. })));
}

/// The same map with relative speeds in a table, as a share and in %.
#[test]
fn a_table_may_have_relative_speeds() {
    let share =
        "N/Ndes,flow [kg/s],PR,eta\n0.7,0.05,1.5,0.66\n0.7,0.06,1.3,0.6\n1,0.08,2.2,0.72\n1,0.1,1.8,0.64\n";
    let given = [SAE, SPEED, ("speed", "N/Ndes")];
    assert_near(&points(&read("x.csv", share, &given).unwrap().map), &EXPECTED);
    let percent = "N [%];flow [g/s];PR;eta [%]\n70;50;1,5;66\n70;60;1,3;60\n100;80;2,2;72\n100;100;1,8;64\n";
    assert_near(&points(&read("x.csv", percent, &[SAE, SPEED]).unwrap().map), &EXPECTED);
    let absolute = share.replace("0.7,", "56000,").replace("\n1,", "\n80000,");
    let refused = read("x.csv", &absolute, &given);
    assert!(matches!(refused, Err(ImportError::DesignSpeedUnused { .. })), "{refused:?}");
}

#[test]
fn columns_are_named_by_heading_or_number() {
    let expected = [[50e3, 0.04, 1.4, 0.66], [50e3, 0.05, 1.3, 0.61], [80e3, 0.07, 1.9, 0.7]];
    let strange = "point,a,b,c,d\n1,50,300,1.3,61\n2,50,240,1.4,66\n3,80,420,1.9,70\n";
    let names =
        [SAE, ("speed", "a [krpm]"), ("flow", "b [m3/h]"), ("pressure_ratio", "c"), ("efficiency", "d [%]")];
    assert!(matches!(read("x.csv", strange, &names), Err(ImportError::Description { key: "flow", .. })));
    let kilograms: Vec<_> = names
        .iter()
        .map(|&(key, value)| if key == "flow" { (key, "b [kg/h]") } else { (key, value) })
        .collect();
    let found = points(&read("x.csv", strange, &kilograms).unwrap().map);
    let of = |kg_h: f64| kg_h / 3600.0;
    assert_near(
        &found,
        &[[50e3, of(240.0), 1.4, 0.66], [50e3, of(300.0), 1.3, 0.61], [80e3, of(420.0), 1.9, 0.7]],
    );
    let bare = "0.61 1.3 50 50000\n0.66 1.4 40 50000\n0.70 1.9 70 80000\n";
    let numbers =
        [SAE, ("efficiency", "#1"), ("pressure_ratio", "#2"), ("flow", "#3 [g/s]"), ("speed", "#4 [rpm]")];
    assert_near(&points(&read("x.txt", bare, &numbers).unwrap().map), &expected);
    // A digitiser's export: the letters have no units.
    let digitised = "50000,,80000,\nX,Y,X,Y\n6.6138679,1.3,9.2594150,1.9\n5.2910943,1.4,,\n";
    let found = points(&read("x.csv", digitised, &[SAE, ("flow", "lb/min")]).unwrap().map);
    for (a, b) in found.iter().zip(expected) {
        // Digits of the file.
        assert!(
            (a[0] / b[0] - 1.0).abs() < 1e-12 && (a[1] / b[1] - 1.0).abs() < 1e-6 && a[2] == b[2],
            "{found:?}"
        );
    }
}

/// A description of a map that was read says all that the reader assumed: with it alone the map is the same.
#[test]
fn a_written_description_reads_the_same_map() {
    let percent = "Speed,Flow,PR,Eff\n50000,0.05,1.3,61\n50000,0.04,1.4,66\n";
    let bare = "50000 0.05 1.3 0.61\n50000 0.04 1.4 0.66\n";
    let reduced =
        "N/sqrt(T) [rpm/K^0.5];m*sqrt(T)/p [kg/s*K^0.5/MPa];PR;eta\n3000;9,5;1,3;0,6\n4000;12;1,5;0,61\n";
    let digitised = "50000,,80000,\nX,Y,X,Y\n6.6,1.3,9.3,1.9\n5.3,1.4,,\n";
    for (name, text, given) in [
        ("x.csv", percent, vec![SAE]),
        ("x.txt", bare, vec![SAE]),
        ("x.csv", reduced, vec![]),
        ("x.csv", digitised, vec![SAE, ("flow", "lb/min")]),
        ("x.py", PYCYCLE, vec![SAE, SPEED, ("flow", "lb/s"), ("design_pressure_ratio", "2.5")]),
    ] {
        let found = read(name, text, &given).unwrap();
        let written = description_text(name, &found, &stated(&given));
        let kept =
            description_from_yaml(&written, Path::new("x.yaml")).unwrap_or_else(|error| panic!("{error}"));
        let extension = name.rsplit('.').next().unwrap();
        let again = FORMATS.read_from(extension).unwrap().read(text.as_bytes(), &kept);
        let again = again.unwrap_or_else(|error| panic!("{written}\n{error}"));
        assert_eq!(points(&again.map), points(&found.map), "{written}");
        assert_eq!(again.map.reference, found.map.reference);
    }
}

/// Static taps: air at Mach 0.5 in a pipe of 30 mm. NACA report 1135: at Mach 0.5 the static pressure is 0.8430 of the total one, so that
/// the flow is `p A M sqrt(gamma / (R T))`.
#[test]
fn static_pressures_become_total_ones() {
    let (temperature_k, static_pa, area_m2) = (300.0 / 1.05, 84.30e3, std::f64::consts::PI * 2.25e-4);
    let flow = static_pa * area_m2 * 0.5 * (1.4f64 / (287.05 * temperature_k)).sqrt();
    let text = format!("N [rpm],m [kg/s],P1 [kPa],P2 [kPa],T1 [K],T2 [K]\n90000,{flow},84.30,200,300,390\n");
    let totals = points(&read("x.csv", &text, &[SAE]).unwrap().map)[0];
    let taps = points(&read("x.csv", &text, &[SAE, ("inlet_pipe", "30 mm")]).unwrap().map)[0];
    assert!((totals[2] - 200.0 / 84.3).abs() < 1e-12);
    // Four digits of the table, and gamma of air at 300 K.
    assert!((taps[2] / 2.0 - 1.0).abs() < 1e-3 && taps[1] < totals[1], "{taps:?}");
    // The outlet's temperature is needed for its density.
    let without = text.replace(",T2 [K]", "").replace(",390", "");
    let given = [SAE, ("outlet_pipe", "30 mm")];
    assert!(matches!(read("x.csv", &without, &given), Err(ImportError::NotANumber { .. })));
    let corrected = "N,m,PR,eta\n90000,0.1,2,0.7\n";
    assert!(matches!(read("x.csv", corrected, &given), Err(ImportError::Description { .. })));
}
