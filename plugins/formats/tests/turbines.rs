//! Turbine maps in the layouts of engineers, and back from every format that is written and read.

use mapper_core::{
    ImportError, ImportRemark, ImportedTurbine, MapDescription, ReferenceState, TurbineMap, TurbineMapPoint,
};
use mapper_formats::FORMATS;
use mapper_maps::table::set_key;

fn read(name: &str, text: &str, statements: &[(&str, &str)]) -> Result<ImportedTurbine, ImportError> {
    let mut given = MapDescription::default();
    for (key, value) in statements {
        set_key(&mut given, key, value).unwrap();
    }
    let format = FORMATS.read_from(name.rsplit('.').next().unwrap()).unwrap();
    // What is read as a turbine is refused as a compressor.
    if format.read(text.as_bytes(), &given).is_ok() {
        panic!("{name} passes for a compressor");
    }
    format.read_turbine(text.as_bytes(), &given)
}

fn point(vane: Option<f64>, speed: f64, flow: f64, ratio: f64, efficiency: f64) -> TurbineMapPoint {
    TurbineMapPoint {
        vane_position: vane,
        speed_parameter_rpm_sqrt_k: speed,
        flow_parameter_kg_sqrt_k_s_kpa: flow,
        expansion_ratio: ratio,
        efficiency: Some(efficiency),
    }
}

fn assert_near(found: &[TurbineMapPoint], expected: &[TurbineMapPoint]) {
    assert_eq!(found.len(), expected.len(), "{found:?}");
    let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-9;
    for (a, b) in found.iter().zip(expected) {
        assert_eq!(a.vane_position, b.vane_position);
        assert!(near(a.speed_parameter_rpm_sqrt_k, b.speed_parameter_rpm_sqrt_k), "{a:?} {b:?}");
        assert!(near(a.flow_parameter_kg_sqrt_k_s_kpa, b.flow_parameter_kg_sqrt_k_s_kpa), "{a:?} {b:?}");
        assert!(near(a.expansion_ratio, b.expansion_ratio), "{a:?} {b:?}");
        assert!(near(a.efficiency.unwrap(), b.efficiency.unwrap()), "{a:?} {b:?}");
    }
}

#[test]
fn layouts_and_units() {
    let expected = [
        point(None, 2000.0, 0.012, 1.3, 0.6),
        point(None, 2000.0, 0.015, 1.8, 0.68),
        point(None, 3000.0, 0.014, 1.7, 0.66),
    ];
    for (name, text) in [
        (
            "x.txt",
            "# SP(rpm/sqrt(K)) mfp(kg-sqrt(K)/s-kPa) ER Eff\n2000 0.012 1.3 0.6\n2000 0.015 1.8 0.68\n3000 0.014 1.7 0.66\n",
        ),
        (
            "x.csv",
            "Turbine map\nSpeed parameter;Mass flow parameter [kg/s*K^0.5/MPa];Expansion ratio;Efficiency [%]\n2000;12;1,3;60\n2000;15;1,8;68\n3000;14;1,7;66\n",
        ),
        (
            "x.csv",
            "remark,eta,Expansion ratio (t-s),m*sqrt(T3)/p3 [kg/s*K^0.5/bar],N/sqrt(T3) [rpm/K^0.5]\na,0.6,1.3,1.2,2000\nb,0.68,1.8,1.5,\nc,0.66,1.7,1.4,3000\n",
        ),
        (
            "x.csv",
            "Turbine map\nm*sqrt(T3)/p3 [kg/s*K^0.5/kPa],PR (t-s),Eff\nN/sqrt(T3) = 2000\n0.012,1.3,0.6\n0.015,1.8,0.68\nN/sqrt(T3) = 3000\n0.014,1.7,0.66\n",
        ),
    ] {
        let found = read(name, text, &[]).unwrap_or_else(|error| panic!("{text}: {error}"));
        assert_near(&found.map.points, &expected);
    }
}

/// Corrected speed and flow become reduced by their reference state, which must be stated.
#[test]
fn corrected_quantities_need_a_reference() {
    let text = "NT*,PRT,WT*,EtaT\n30000,1.9,0.21,0.7\n36000,2.2,0.25,0.72\n";
    assert!(matches!(read("x.csv", text, &[]), Err(ImportError::NoReference)));
    let found = read("x.csv", text, &[("reference", "SAE")]).unwrap();
    assert_eq!(found.remarks, [ImportRemark::FlowUnitAssumed]);
    let ReferenceState { t_ref_k, p_ref_pa } = ReferenceState::SAE;
    let (root, kpa) = (t_ref_k.sqrt(), p_ref_pa / 1000.0);
    let expected = [
        point(None, 30e3 / root, 0.21 * root / kpa, 1.9, 0.7),
        point(None, 36e3 / root, 0.25 * root / kpa, 2.2, 0.72),
    ];
    assert_near(&found.map.points, &expected);
    // A factor of a thousand is within what turbines have.
    let no_unit = "N/sqrt(T3),m*sqrt(T3)/p3,Expansion ratio\n2000,12,1.3\n";
    assert!(matches!(read("x.csv", no_unit, &[]), Err(ImportError::NoUnit { key: "reduced_flow", .. })));
    let found = read("x.csv", no_unit, &[("reduced_flow", "kg/s*K^0.5/MPa")]).unwrap();
    assert_eq!(found.map.points[0].flow_parameter_kg_sqrt_k_s_kpa, 0.012);
    let not_expanded = "N/sqrt(T3),mfp,Expansion ratio\n2000,0.012,0.7\n";
    assert!(matches!(read("x.csv", not_expanded, &[]), Err(ImportError::Value { line: 2, .. })));
}

#[test]
fn vane_positions_are_columns_or_titles() {
    let expected = [
        point(Some(0.2), 2000.0, 0.008, 1.3, 0.55),
        point(Some(0.2), 3000.0, 0.009, 1.7, 0.6),
        point(Some(0.8), 2000.0, 0.016, 1.3, 0.62),
    ];
    for text in [
        "VGT [%],N/sqrt(T3),mfp,ER,eta\n20,2000,0.008,1.3,0.55\n20,3000,0.009,1.7,0.6\n80,2000,0.016,1.3,0.62\n",
        "VGT [%],N/sqrt(T3),m*sqrt(T3)/p3 [kg/s*K^0.5/kPa],ER,eta,flow_low,flow_high\n20,2000,0.008,1.3,0.55,0.007,0.009\n\
         20,3000,0.009,1.7,0.6,0.008,0.01\n80,2000,0.016,1.3,0.62,0.015,0.017\n",
        "Turbine map\nN/sqrt(T3),mfp,ER,eta\nVGT position 20 %\n2000,0.008,1.3,0.55\n3000,0.009,1.7,0.6\n\
         VGT position 80 %\n2000,0.016,1.3,0.62\n",
    ] {
        assert_near(&read("x.csv", text, &[]).unwrap().map.points, &expected);
    }
}

#[test]
fn what_is_written_is_read_to_the_digit() {
    for vane in [None, Some(1.0 / 3.0)] {
        let mut points = vec![
            point(vane, 2000.0 / 3.0, 0.1 / 7.0, 1.3 + 1.0 / 9.0, 0.6 + 1.0 / 11.0),
            point(vane, 3000.1, 0.014, 1.7, 0.66),
        ];
        points.push(TurbineMapPoint { efficiency: None, expansion_ratio: 2.1, ..points[1] });
        let map = TurbineMap { machine: "a & b".to_owned(), points, fitted: None };
        let both =
            FORMATS.iter().filter(|format| format.turbine.write.is_some() && format.turbine.read.is_some());
        let mut count = 0;
        for format in both {
            let name = format.name;
            // Formats of the fit alone refuse a map without one.
            let Ok(bytes) = format.write_turbine(&map) else { continue };
            let back = format.read_turbine(&bytes, None).unwrap_or_else(|error| panic!("{name}: {error}"));
            if name == "sae" {
                // Ten characters begin with a blank: seven digits at the least.
                let near = |a: f64, b: f64| (a - b).abs() <= 1e-7 * a.abs().max(1.0);
                for (found, written) in back.map.points.iter().zip(&map.points) {
                    assert!(near(
                        found.speed_parameter_rpm_sqrt_k / 1e3,
                        written.speed_parameter_rpm_sqrt_k / 1e3
                    ));
                    assert!(near(
                        found.flow_parameter_kg_sqrt_k_s_kpa,
                        written.flow_parameter_kg_sqrt_k_s_kpa
                    ));
                    assert!(near(found.expansion_ratio, written.expansion_ratio));
                    assert!(near(found.efficiency.unwrap_or(0.0), written.efficiency.unwrap_or(0.0)));
                    assert!(near(found.vane_position.unwrap_or(0.0), written.vane_position.unwrap_or(0.0)));
                }
                assert_eq!(back.map.points.len(), map.points.len());
                let text = String::from_utf8(bytes.clone()).unwrap();
                let rows = text.lines().skip(3);
                let width = if vane.is_some() { 50 } else { 40 };
                assert!(rows.clone().count() == 3 && rows.clone().all(|row| row.len() == width), "{text}");
                assert!(rows.clone().all(|row| (0..width).step_by(10).all(|at| row.as_bytes()[at] == b' ')));
            } else {
                assert_eq!(back.map, map, "{name}");
            }
            assert!(matches!(format.read(&bytes, None), Err(ImportError::Turbine { .. })), "{name}");
            count += 1;
        }
        assert!(count >= 3);
        assert!(FORMATS.find("modelica").unwrap().write_turbine(&map).is_err(), "it needs a fit");
    }
}

/// Steady points of a stand: N/sqrt(T3), m sqrt(T3)/p3 and P3/P4 by hand; the vanes' position is in the titles.
#[test]
fn measured_points_are_reduced() {
    let text = "vane position 40 %\nDrehzahl [1/min];Abgasmassenstrom [kg/h];p3 [bar];T3 [°C];p4 [bar]\n\
                100000;360;2,0;626,85;1,0\nvane position 80 %\n100000;540;1,5;626,85;1,0\n";
    let found = read("x.csv", text, &[]).unwrap();
    assert!(found.remarks.contains(&ImportRemark::Measured) && found.measured.len() == 2);
    let expected = [(0.4, 0.1 * 30.0 / 200.0, 2.0), (0.8, 0.15 * 30.0 / 150.0, 1.5)];
    for (point, (vane, flow, ratio)) in found.map.points.iter().zip(expected) {
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
        assert_eq!((point.vane_position, point.efficiency), (Some(vane), None));
        assert!(near(point.speed_parameter_rpm_sqrt_k, 1e5 / 30.0) && near(point.expansion_ratio, ratio));
        assert!(near(point.flow_parameter_kg_sqrt_k_s_kpa, flow), "{point:?}");
    }
}
