//! Tables of maps in the shapes of public collections, with numbers of our own: read right at once, or refused with a remedy that works.

use mapper_core::{DescribedColumn, DesignPoint, ImportError, MapDescription, ReferenceState};
use mapper_formats::FORMATS;
use mapper_maps::table::text_of_lines;
use std::fmt::Write;

/// Corrected rpm, kg/s, pressure ratio, efficiency; from surge to choke.
const ROWS: [[f64; 4]; 9] = [
    [45e3, 0.0445, 1.267, 0.696],
    [45e3, 0.0693, 1.244, 0.752],
    [45e3, 0.094, 1.134, 0.675],
    [75e3, 0.0715, 1.742, 0.691],
    [75e3, 0.1128, 1.677, 0.747],
    [75e3, 0.154, 1.371, 0.67],
    [105e3, 0.0985, 2.455, 0.686],
    [105e3, 0.1563, 2.326, 0.742],
    [105e3, 0.214, 1.727, 0.665],
];
/// The definition of the pound.
const KG_PER_LB: f64 = 0.453_592_37;

fn given() -> MapDescription {
    MapDescription { reference: Some(ReferenceState::SAE), ..MapDescription::default() }
}

/// The rows, each as `form` prints it.
fn rows(form: impl Fn(&[f64; 4]) -> String) -> String {
    ROWS.iter().map(|row| form(row) + "\n").collect()
}

fn plain(separator: &str, flow: f64, eta: f64) -> String {
    rows(|[n, m, ratio, e]| [*n, m * flow, *ratio, e * eta].map(|value| value.to_string()).join(separator))
}

/// A table over speed and an auxiliary coordinate: numbers of a column of the rows, by `open`, `separator` and `close` of each line.
fn table(column: usize, factor: f64, [open, separator, close]: [&str; 3]) -> String {
    let line = |rows: &[[f64; 4]]| {
        let values: Vec<String> = rows.iter().map(|row| (row[column] * factor).to_string()).collect();
        format!("{open}{}{close}", values.join(separator))
    };
    ROWS.chunks(3).map(line).collect::<Vec<_>>().join(if close == "]" { ", " } else { "" })
}

/// Variables of MATLAB of level 4.
fn mat_4(variables: [(&str, usize); 4]) -> Vec<u8> {
    let mut file = Vec::new();
    for (name, column) in variables {
        for number in [0, ROWS.len(), 1, 0, name.len() + 1] {
            file.extend(u32::try_from(number).unwrap().to_le_bytes());
        }
        file.extend(name.bytes().chain([0]));
        ROWS.iter().for_each(|row| file.extend(row[column].to_le_bytes()));
    }
    file
}

fn gsp() -> String {
    let mut text = "99 demo\nReynolds: RNI=0.100 f=1.000 RNI=1.000 f=1.000\n".to_owned();
    for (name, column) in [("Mass Flow", 1), ("Efficiency", 3), ("Pressure Ratio", 2)] {
        let _ = writeln!(text, "{name}\n  4.004  1.0  2.0  3.0");
        for line in ROWS.chunks(3) {
            let values: Vec<String> = line.iter().map(|row| row[column].to_string()).collect();
            let _ = writeln!(text, "  {}  {}", line[0][0], values.join("  "));
        }
    }
    text
}

fn npss() -> String {
    let mut text = String::new();
    for (name, field, column) in [("TB_Wc", "Wc", 1), ("TB_PR", "PR", 2), ("TB_eff", "eff", 3)] {
        let _ =
            writeln!(text, "Table {name}(real alphaMap, real NcMap, real RlineMap) {{\n alphaMap = 0.0 {{");
        for line in ROWS.chunks(3) {
            let values: Vec<String> = line.iter().map(|row| row[column].to_string()).collect();
            let _ = writeln!(
                text,
                "  NcMap = {} {{\n   RlineMap = {{1.0, 2.0, 3.0}}\n   {field}Map = {{{}}}\n  }}",
                line[0][0],
                values.join(", ")
            );
        }
        text.push_str(" }\n}\n");
    }
    text
}

/// Blocks of digitised lines side by side, their speeds above.
fn side_by_side() -> String {
    let mut text =
        "45000 rpm,,75000 rpm,,105000 rpm,\nflow [kg/s],PR,flow [kg/s],PR,flow [kg/s],PR\n".to_owned();
    for at in 0..3 {
        let cells: Vec<String> = [0, 3, 6]
            .iter()
            .flat_map(|line| [ROWS[line + at][1], ROWS[line + at][2]])
            .map(|v| v.to_string())
            .collect();
        let _ = writeln!(text, "{}", cells.join(","));
    }
    text
}

/// Points of a rig with T1 of 298 K, P1 of 100 kPa and T2 of the efficiency with gamma 1.4: their corrected values are the rows.
fn rig() -> String {
    let head = "Sample,Inlet Temperature T1 [K],Compressor Exit Temperature T2 [K],Turbine Inlet Temperature T3 [K],Inlet Pressure P1 [kPa],\
                Compressor Exit Pressure P2 [kPa],Turbine Inlet Pressure P3 [kPa],Speed n [rpm],Air Mass Flow Rate [kg/s]\n";
    head.to_owned()
        + &rows(|[n, m, ratio, eta]| {
            let t2_k = 298.0 * (1.0 + (ratio.powf(0.4 / 1.4) - 1.0) / eta);
            format!("{m},298,{t2_k},873,100,{},150,{n},{m}", 100.0 * ratio)
        })
}

fn digitised() -> String {
    let files: Vec<(String, Vec<u8>)> = ROWS
        .chunks(3)
        .map(|line| {
            let text: String =
                line.iter().map(|row| format!("{}, {}\n", row[1] / KG_PER_LB * 60.0, row[2])).collect();
            (line[0][0].to_string(), text.into_bytes())
        })
        .collect();
    text_of_lines(&files).unwrap()
}

fn abb(title: &str, surge: &str) -> String {
    let row = |[n, m, ratio, eta]: &[f64; 4]| format!("{n:10.1}{m:10.5}{ratio:10.5}{eta:10.5}{:40}", "");
    format!("{title}        \n0.141      0.12        \n{:80}\n{}{surge}", "", rows(row))
}

#[test]
fn tables_in_public_shapes_are_right_at_once() {
    let maptools = |unit: &str, factor: f64| {
        let row =
            |[n, m, ratio, eta]: &[f64; 4]| format!("{n:13.1}{:16.9}{ratio:16.6}{eta:16.6}", m * factor);
        format!(
            " # Map of a demonstration stage\n # FILE PATH c:\\maps\\demo.fae\n # Date (ccyymmdd) : 20260106  Time (hhmmss:ss) :102646.839\n \
             # Data : N (rpm), mdot ({unit}), PR (none), Eff (none) \n{}",
            rows(row)
        )
    };
    let json_lines: Vec<String> = ROWS
        .chunks(3)
        .map(|line| {
            let of =
                |column: usize| line.iter().map(|row| row[column].to_string()).collect::<Vec<_>>().join(",");
            format!(
                "{{\"speed_rpm\":{},\"flow_kg_s\":[{}],\"pr\":[{}],\"eta\":[{}]}}",
                line[0][0],
                of(1),
                of(2),
                of(3)
            )
        })
        .collect();
    let array = ["[", ", ", "]"];
    let relative = DesignPoint {
        speed_corrected_rpm: Some(75e3),
        flow_corrected_kg_s: Some(0.1128),
        ..DesignPoint::default()
    };
    let tasopt = format!(
        "[design]\ndes_Nc = 1.0\ndes_Rline = 2.0\n[grid]\ngrid_Nc = [0.6, 1.0, 1.4]\ngrid_Rline = [1.0, 2.0, 3.0]\n[characteristic]\n\
         massflow = [{}]\npressure_ratio = [{}]\nisen_efficiency = [{}]\n",
        table(1, 700.0, array),
        table(2, 1.0, array),
        table(3, 1.0, array)
    );
    let matlab = [" ", " ", ";\n"];
    let t_mats = format!(
        "NcVec = [45000 75000 105000];\nRlineVec = [1 2 3];\nWcArray = [{}];\nPRArray = [{}];\nEffArray = [{}];\n",
        table(1, 1.0, matlab),
        table(2, 1.0, matlab),
        table(3, 1.0, matlab)
    );
    let pycycle = format!(
        "import numpy as np\nm = MapData()\nm.NcMap = np.array([0.6, 1.0, 1.4])\nm.RlineMap = np.array([1.0, 2.0, 3.0])\nm.defaults['NcMap'] = 1.0\n\
         m.defaults['RlineMap'] = 2.0\nm.WcMap = np.array([[{}]])\nm.PRmap = np.array([[{}]])\nm.effMap = np.array([[{}]])\n",
        table(1, 700.0, array),
        table(2, 1.0, array),
        table(3, 1.0, array)
    );
    let blocks: String = ROWS
        .chunks(3)
        .map(|line| {
            let points: String =
                line.iter().map(|row| format!("{};{};{}\n", row[1] * 1e3, row[2], row[3])).collect();
            format!("N = {} rpm;;\n{points}", line[0][0])
        })
        .collect();
    let surge = "\n\n\nSurge Line\n   45000.0   0.04300   1.27000\n  105000.0   0.09500   2.47000\n";
    let bytes = str::as_bytes;
    for (shape, extension, content, design) in [
        ("Maptools in kg/s", "SAE", bytes(&maptools("kg/s", 1.0)), None),
        ("Maptools in lb/s", "sae", bytes(&maptools("lb/s", 1.0 / KG_PER_LB)), None),
        ("ABB with a surge line", "sae", bytes(&abb("ABB                          TPL", surge)), None),
        ("ABB", "sae", bytes(&abb("ABB TPS", "")), None),
        ("teaching rig", "csv", bytes(&rig()), None),
        ("CPgui", "csv", bytes(&format!("NcCorr;WcCorr;PiC;etaC\n{}", plain(";", 1.0, 1.0))), None),
        (
            "GT-POWER text",
            "txt",
            bytes(&format!(
                "! Speed(RPM)  MassFlow(kg/s)  PressureRatio  Efficiency(fraction)\n{}",
                plain("  ", 1.0, 1.0)
            )),
            None,
        ),
        ("TASOPT", "toml", bytes(&tasopt), Some(relative)),
        ("T-MATS", "m", bytes(&t_mats), None),
        ("pyCycle", "py", bytes(&pycycle), Some(relative)),
        ("NPSS", "map", bytes(&npss()), None),
        ("GSP", "map", bytes(&gsp()), None),
        ("JSON of lines", "json", bytes(&format!("{{\"lines\":[{}]}}", json_lines.join(","))), None),
        ("MATLAB variables", "mat", &mat_4([("RPM", 0), ("m_dot", 1), ("PR", 2), ("eff", 3)]), None),
        ("digitised side by side", "csv", bytes(&side_by_side()), None),
        (
            "supplier in lb/min and %",
            "csv",
            bytes(&format!(
                "Corrected Speed (RPM),Corrected Air Flow (lb/min),Pressure Ratio (T-T),Efficiency (%)\n{}",
                plain(",", 60.0 / KG_PER_LB, 100.0)
            )),
            None,
        ),
        (
            "German with a row of units",
            "csv",
            bytes(
                &format!(
                    "Drehzahl;Massenstrom;Druckverhältnis;Wirkungsgrad\n1/min;kg/h;-;%\n{}",
                    plain(";", 3600.0, 100.0)
                )
                .replace('.', ","),
            ),
            None,
        ),
        (
            "units among other cells",
            "csv",
            bytes(&format!(
                "Speed,Flow,PR,Efficiency\nrpm,lb/s,T-T,%\n{}",
                plain(",", 1.0 / KG_PER_LB, 100.0)
            )),
            None,
        ),
        (
            "units in parentheses",
            "txt",
            bytes(&format!("speed flow PR eff\n(rpm) (lb/s) (-) (-)\n{}", plain(" ", 1.0 / KG_PER_LB, 1.0))),
            None,
        ),
        ("blocks with titles", "csv", bytes(&format!("m [g/s];PR;eta\n{blocks}")), None),
    ] {
        let design = design.unwrap_or_default();
        let given = MapDescription { design, ..given() };
        let read = FORMATS.read_from(&extension.to_lowercase()).unwrap().read(content, given);
        let found = read.unwrap_or_else(|error| panic!("{shape}: {error}"));
        let mut points: Vec<[f64; 4]> = Vec::new();
        for line in &found.map.lines {
            for point in &line.points {
                let eta = point.eta.unwrap_or(f64::NAN);
                points.push([line.speed_corrected_rpm, point.flow_corrected_kg_s, point.pressure_ratio, eta]);
            }
        }
        assert_eq!(points.len(), ROWS.len(), "{shape}");
        for (a, b) in points.iter().zip(&ROWS) {
            // Five decimals of a flow; the efficiency of the rig is that of real air.
            let is_equal = |at: usize, digits: f64| a[at].is_nan() || (a[at] / b[at] - 1.0).abs() < digits;
            assert!((0..3).all(|at| is_equal(at, 3e-4)) && is_equal(3, 1e-2), "{shape}: {a:?} {b:?}");
        }
        assert_eq!(points.iter().any(|point| point[3].is_nan()), shape.starts_with("digitised"), "{shape}");
        assert_eq!(found.map.surge.len(), if shape == "ABB with a surge line" { 2 } else { 0 }, "{shape}");
    }
}

/// A flow whose unit no file states is asked for by its heading, and the remedy is right.
#[test]
fn what_public_tables_leave_open_is_asked_for() {
    let with = |quantity: &'static str, text: &str| MapDescription {
        columns: vec![DescribedColumn { quantity, text: text.to_owned() }],
        ..given()
    };
    let turbine = |heading: &str, rows: &str| format!("{heading}\n{rows}");
    let parameters = turbine(
        "DEMO  T\n    300.00                      0.006690\nspeedpar.  massflowpar.  PiT     eta_sT",
        "    1450.0   0.00897   1.25000   0.75082\n    1450.0   0.01613   1.65000   0.77669\n    1900.0   0.00883   1.25000   0.75082\n",
    );
    let vanes = turbine(
        "Nozzle,RPM,PRT,Q,EtaT",
        "0.2,25085,1.25,0.00124,0.751\n0.2,25085,1.65,0.00223,0.777\n0.2,32870,1.25,0.00122,0.751\n",
    );
    for (text, extension, heading, (key, unit), flow) in [
        (parameters, "sae", "massflowpar.", ("reduced_flow", "kg/s*K^0.5/kPa"), 0.00897),
        // 0.001 24 kg/s at 298 K and 100 kPa.
        (vanes, "csv", "Q", ("flow", "kg/s"), 0.00124 * 298f64.sqrt() / 100.0),
    ] {
        let format = FORMATS.read_from(extension).unwrap();
        let asked = format.read_turbine(text.as_bytes(), given()).unwrap_err();
        let ImportError::NoUnit { heading: asked, key: asked_key, .. } = &asked else { panic!("{asked}") };
        assert_eq!((asked.as_str(), *asked_key), (heading, key));
        let found = format.read_turbine(text.as_bytes(), with(key, unit)).unwrap();
        assert_eq!(found.map.points.len(), 3);
        assert!((found.map.points[0].flow_parameter_kg_sqrt_k_s_kpa / flow - 1.0).abs() < 1e-9);
    }
    let asked = FORMATS.read_from("csv").unwrap().read(digitised().as_bytes(), given()).unwrap_err();
    assert!(matches!(asked, ImportError::NoUnit { key: "flow", .. }), "{asked}");
    let found =
        FORMATS.read_from("csv").unwrap().read(digitised().as_bytes(), with("flow", "lb/min")).unwrap();
    let flow = found.map.lines[0].points[0].flow_corrected_kg_s;
    assert!((flow / ROWS[0][1] - 1.0).abs() < 1e-9, "{flow}");
}
