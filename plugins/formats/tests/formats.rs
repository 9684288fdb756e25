//! Written files can be read back, and agree with the map.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::support;
use mapper_core::{CompressorMap, ExportError, ImportRemark, MapPoint, Method, ReferenceState, Verdict};
use mapper_formats::FORMATS;
use std::collections::BTreeSet;

fn export(name: &str, map: &CompressorMap) -> String {
    String::from_utf8(FORMATS.find(name).unwrap().write(map).unwrap()).unwrap()
}

fn points(map: &CompressorMap) -> Vec<&MapPoint> {
    map.lines.iter().flat_map(|line| &line.points).collect()
}

fn empty() -> CompressorMap {
    CompressorMap {
        machine: String::new(),
        reference: ReferenceState::SAE,
        method: Method::Steady,
        efficiency: None,
        gas: None,
        wheel_diameter_m: None,
        lines: vec![],
        surge: Vec::new(),
        fitted: None,
    }
}

#[test]
fn names_are_unique_and_every_format_takes_any_map_and_repeats_itself() {
    for (i, entry) in FORMATS.iter().enumerate() {
        assert!(FORMATS.iter().skip(i + 1).all(|other| other.name != entry.name));
        assert!(FORMATS.iter().skip(i + 1).all(|other| other.extension != entry.extension));
        if entry.write.is_none() {
            continue;
        }
        for map in [empty(), support::turbo_a(), support::fitted()] {
            match entry.write(&map) {
                Ok(bytes) => assert!(bytes == entry.write(&map).unwrap(), "{}", entry.name),
                Err(error) => {
                    assert!(matches!(error, ExportError::NeedsFit { .. }) && map.fitted.is_none(), "{error}");
                }
            }
        }
    }
    assert!(FORMATS.find("ods").is_none());
    // A file is written under every extension of its format; the longest counts.
    let written = |name: &str| FORMATS.written_to(name).map(|format| format.name);
    let names = ["x.sae", "x.TXT", "x.modelica.txt", "x.map", "x.npss.map", "x.fitted.csv", "x.xlsx", "sae"];
    let formats = ["sae", "sae", "modelica", "sae", "npss", "fitted", "xlsx"].map(Some);
    assert_eq!(names.map(written)[..7], formats);
    assert_eq!(names.map(written)[7..], [None]);
}

#[test]
fn csv_reads_back_to_the_same_numbers() {
    let map = support::turbo_a();
    let text = export("csv", &map);
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_reader(text.as_bytes());
    let names: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
    let rows: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
    assert_eq!(rows.len(), points(&map).len());
    for (row, point) in rows.iter().zip(points(&map)) {
        let field = |name: &str| &row[names.iter().position(|n| n == name).unwrap()];
        let number = |name: &str| field(name).parse::<f64>().ok();
        let p = &point.identified;
        assert_eq!(number("flow_corrected_kg_s"), Some(point.flow_corrected_kg_s));
        assert_eq!(number("pressure_ratio"), Some(point.pressure_ratio));
        assert_eq!(number("speed_corrected_rpm"), Some(p.speed_corrected_rpm));
        assert_eq!(number("eta"), point.eta);
        assert_eq!(number("eta_low"), p.eta_low);
        assert_eq!(number("eta_high"), p.eta_high);
        assert_eq!(number("h_w_m2k"), p.h_w_m2k);
        assert_eq!(number("h_low_w_m2k"), p.h_low_w_m2k);
        assert_eq!(number("h_high_w_m2k"), p.h_high_w_m2k);
        assert_eq!(number("valve"), Some(p.valve_opening_ratio));
        assert_eq!(number("t1_k"), Some(p.t1_k));
        assert_eq!(number("p1_pa"), Some(p.p1_pa));
        assert_eq!(number("residual_rms_k"), p.residual_rms_k);
        assert_eq!(number("dt2_k"), p.dt2_k);
        assert_eq!(field("verdict") == "unusable", p.verdict == Verdict::Unusable);
        assert_eq!(field("warnings"), p.warnings.iter().map(|w| w.code()).collect::<Vec<_>>().join(";"));
    }
    assert!(text.contains("# reference state of corrected flow and speed: 298 K, 100000 Pa\n"));
    assert!(text.contains("# method: dynamic\n"));
    let back = FORMATS.find("csv").unwrap().read(text.as_bytes(), None).unwrap().map;
    for (read, written) in points(&back).iter().zip(points(&map)) {
        assert_eq!(read.identified.common, written.identified.common);
    }
}

#[test]
fn a_machine_name_cannot_break_out_of_the_comment() {
    let map = CompressorMap { machine: "a\nb,c\r\nd".to_owned(), ..empty() };
    let text = export("csv", &map);
    assert_eq!(text.lines().filter(|line| !line.starts_with('#')).count(), 1, "{text}");
}

#[test]
fn json_reads_back_to_the_same_map() {
    let map = support::turbo_a();
    let text = export("json", &map);
    let back: CompressorMap = serde_json::from_str(&text).unwrap();
    assert_eq!((&back.machine, back.reference, back.method), (&map.machine, map.reference, map.method));
    assert_eq!(back.lines.len(), map.lines.len());
    for (a, b) in points(&back).iter().zip(points(&map)) {
        // The writer is exact; serde_json's fast reader may differ by one unit in the last place.
        let same = |a: f64, b: f64| assert!((a - b).abs() <= 2.0 * f64::EPSILON * b.abs());
        same(a.flow_corrected_kg_s, b.flow_corrected_kg_s);
        same(a.pressure_ratio, b.pressure_ratio);
        assert_eq!(a.eta.is_some(), b.eta.is_some());
        same(a.eta.unwrap_or(0.0), b.eta.unwrap_or(0.0));
        assert_eq!(a.identified.warnings, b.identified.warnings);
        assert_eq!(a.identified.verdict, b.identified.verdict);
    }
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert!(value["lines"][0]["points"][0]["eta"].is_null(), "undefined is null");
}

/// Files of version 0.1.0 count steps from 0 without a note.
#[test]
fn maps_of_older_versions_keep_their_steps() {
    let map = support::turbo_a();
    let written: Vec<usize> = points(&map).iter().map(|point| point.identified.step).collect();
    let read = |format: &str, text: &str| -> Vec<usize> {
        let back = FORMATS.find(format).unwrap().read(text.as_bytes(), None).unwrap().map;
        points(&back).iter().map(|point| point.identified.step).collect()
    };
    let text = export("json", &map);
    assert_eq!(read("json", &text), written);
    let mut old: serde_json::Value = serde_json::from_str(&text).unwrap();
    old.as_object_mut().unwrap().remove("format");
    for line in old["lines"].as_array_mut().unwrap() {
        for point in line["points"].as_array_mut().unwrap() {
            let step = &mut point["identified"]["step"];
            *step = (step.as_u64().unwrap() - 1).into();
        }
    }
    assert_eq!(read("json", &old.to_string()), written);

    let text = export("csv", &map);
    let marked = |line: &&str| line.starts_with("# step: ");
    assert_eq!(text.lines().filter(marked).count(), 1);
    let old: String = text.lines().filter(|line| !marked(line)).map(|line| format!("{line}\n")).collect();
    let (mut now, mut before) = (read("csv", &text), read("csv", &old));
    now.sort_unstable();
    before.sort_unstable();
    assert_eq!(now, written);
    // Its step numbers are read as counted from 0.
    assert_eq!(before, written.iter().map(|step| step + 1).collect::<Vec<_>>());
}

#[test]
fn json_refuses_what_it_could_not_read_back() {
    let mut map = support::turbo_a();
    map.lines[0].points[1].pressure_ratio = f64::NAN;
    let refused = FORMATS.find("json").unwrap().write(&map);
    assert!(matches!(refused, Err(ExportError::NotFinite { step: 1, quantity: "pressure_ratio", .. })));
}

#[test]
fn the_picture_shows_every_point_and_says_what_it_shows() {
    let map = support::turbo_a();
    let text = export("svg", &map);
    let document = roxmltree::Document::parse(&text).unwrap();
    let texts: Vec<&str> =
        document.descendants().filter(|n| n.has_tag_name("text")).filter_map(|n| n.text()).collect();
    let all = texts.join(" ");
    for needed in
        ["turbo_a", "298 K, 100 kPa", "dynamic", "corrected mass flow, kg/s", "adiabatic efficiency, %"]
    {
        assert!(all.contains(needed), "{needed} is missing");
    }
    for line in &map.lines {
        assert!(texts.contains(&format!("{}", line.speed_corrected_rpm / 1000.0).as_str()));
    }
    let panel = document.descendants().find(|n| n.attribute("class") == Some("panel")).unwrap();
    let hollow =
        panel.descendants().filter(|n| n.has_tag_name("circle") && n.attribute("fill") == Some("#ffffff"));
    // Two points without efficiency, and their legend entry.
    assert_eq!(hollow.count(), 3);
}

/// The same picture in other units: nothing moves, the numbers at the flow axes are a thousand times as large.
#[test]
fn the_picture_is_written_in_the_units_that_are_wanted() {
    let map = support::turbo_a();
    let units = mapper_core::MapUnits {
        flow: "g/s".to_owned(),
        flow_of_one_kg_s: 1000.0,
        speed: "rpm".to_owned(),
        speed_of_one_rpm: 1.0,
    };
    let svg = FORMATS.find("svg").unwrap();
    let [usual, wanted] = [svg.write(&map).unwrap(), svg.write_in(&map, &units).unwrap()]
        .map(|bytes| String::from_utf8(bytes).unwrap());
    let texts = |svg: &str| -> Vec<String> {
        let document = roxmltree::Document::parse(svg).unwrap();
        let all = document.descendants().filter(|n| n.has_tag_name("text"));
        all.filter_map(|n| n.text()).map(str::to_owned).collect()
    };
    let (usual_texts, wanted_texts) = (texts(&usual), texts(&wanted));
    assert!(wanted_texts.iter().any(|text| text == "corrected mass flow, g/s"));
    assert!(!wanted_texts.iter().any(|text| text.contains("kg/s") || text.contains("krpm")));
    for line in &map.lines {
        assert!(wanted_texts.contains(&format!("{}", line.speed_corrected_rpm)), "{wanted_texts:?}");
    }
    let tick = |texts: &[String], value: f64| {
        texts.iter().any(|text| text.parse::<f64>().is_ok_and(|x| (x - value).abs() < 1e-9))
    };
    assert!(tick(&usual_texts, 0.05) && tick(&wanted_texts, 50.0), "{usual_texts:?} {wanted_texts:?}");
    let circles = |svg: &str| svg.matches("<circle").count();
    assert_eq!(circles(&usual), circles(&wanted));
    // A table of numbers remains in SI.
    let csv = FORMATS.find("csv").unwrap();
    assert_eq!(csv.write(&map).unwrap(), csv.write_in(&map, &units).unwrap());
}

#[test]
fn odd_maps_give_a_picture() {
    let mut one = support::turbo_a();
    one.lines.truncate(1);
    one.lines[0].points.truncate(1);
    let mut unusable = support::turbo_a();
    unusable.lines.iter_mut().flat_map(|l| &mut l.points).for_each(|p| p.eta = None);
    let mut same = support::turbo_a();
    same.lines
        .iter_mut()
        .flat_map(|l| &mut l.points)
        .for_each(|p| (p.flow_corrected_kg_s, p.pressure_ratio) = (0.1, 2.0));
    let mut holes = support::turbo_a();
    holes.lines.iter_mut().for_each(|l| l.points[1].flow_corrected_kg_s = f64::NAN);
    let mut broad = support::turbo_a();
    broad.lines[0].points[1].identified.eta_low = Some(-50.0);
    broad.lines[0].points[1].identified.eta_high = Some(f64::INFINITY);
    for map in [one, unusable, same, holes, broad, empty()] {
        let text = export("svg", &map);
        assert!(roxmltree::Document::parse(&text).is_ok());
        assert!(!text.contains("NaN"));
    }
}

#[test]
fn every_text_says_its_reference_state() {
    let map = support::fitted();
    for entry in
        FORMATS.written().filter(|entry| !["json", "svg", "png", "mat", "xlsx"].contains(&entry.name))
    {
        let text = export(entry.name, &map);
        assert!(text.contains("298 K, 100000 Pa"), "{}", entry.name);
    }
}

/// Fields of ten characters with a decimal point, from surge to choke, after three lines of heading.
#[test]
fn sae_text_has_fixed_columns_and_holds_every_efficiency() {
    let map = support::turbo_a();
    let text = export("sae", &map);
    let is_row = |line: &&str| !line.is_empty() && line.is_ascii();
    let rows: Vec<[f64; 4]> = text
        .lines()
        .skip(3)
        .filter(is_row)
        .map(|line| {
            assert_eq!(line.len(), 40, "{line}");
            std::array::from_fn(|at| {
                let field = &line[10 * at..10 * (at + 1)];
                assert!(field.starts_with(' ') && field.contains('.'), "{line}");
                field.trim().parse().unwrap()
            })
        })
        .collect();
    assert_eq!(rows.len(), points(&map).iter().filter(|p| p.eta.is_some()).count());
    assert!(rows.windows(2).all(|w| w[1][0] > w[0][0] || w[1][1] >= w[0][1]));
}

#[test]
fn the_fitted_table_marks_what_is_extrapolated() {
    let map = support::fitted();
    let text = export("fitted", &map);
    let marks = text.matches(",extrapolated\n").count() + text.matches(",unusable\n").count();
    let fitted = map.fitted.unwrap();
    let nodes = || fitted.lines.iter().flat_map(|line| &line.nodes);
    assert_eq!(marks, nodes().filter(|n| n.extrapolated).count());
    assert_eq!(text.matches(",measured\n").count(), nodes().filter(|n| !n.extrapolated).count());
}

/// Every format that is written and read gives back its points to the digit, SAE text to those of its columns: the measured ones, or the nodes of the fit. The formats with
/// nodes are written in different orders and give the same.
#[test]
fn every_format_reads_back_what_it_writes() {
    let map = support::fitted();
    let rows = |map: &CompressorMap| {
        let rows = points(map).into_iter().map(|point| {
            let p = &point.identified;
            let eta = p.eta.unwrap_or(f64::NAN);
            [p.speed_corrected_rpm, p.flow_corrected_kg_s, p.pressure_ratio, eta].map(f64::to_bits)
        });
        rows.collect::<BTreeSet<[u64; 4]>>()
    };
    let (measured, mut nodes) = (rows(&map), None);
    let usable = |point: &&[u64; 4]| !f64::from_bits(point[3]).is_nan();
    let usable: BTreeSet<[u64; 4]> = measured.iter().filter(usable).copied().collect();
    let both = FORMATS.iter().filter(|format| format.write.is_some() && format.read.is_some());
    for format in both {
        let back = format.read(&format.write(&map).unwrap(), None);
        let back = back.unwrap_or_else(|error| panic!("{}: {error}", format.name)).map;
        assert_eq!((back.reference, back.efficiency), (map.reference, map.efficiency), "{}", format.name);
        let found = rows(&back);
        // A field has nine digits and signs.
        let is_rounded = |(a, b): (&[u64; 4], &[u64; 4])| {
            let pairs = a.iter().zip(b).map(|(a, b)| (f64::from_bits(*a), f64::from_bits(*b)));
            pairs.into_iter().all(|(a, b)| (a - b).abs() <= 1e-6 * b.abs().max(1.0))
        };
        if format.name == "sae" {
            assert_eq!(found.len(), usable.len());
            assert!(found.iter().zip(&usable).all(is_rounded));
        } else if found != measured && found != usable {
            assert!(found.len() >= 100, "{}", format.name);
            assert_eq!(found, *nodes.get_or_insert_with(|| found.clone()), "{}", format.name);
        }
    }
    assert!(nodes.is_some());
}

/// Nodes that the fit extrapolated are not measured points.
#[test]
fn extrapolated_nodes_are_not_read_as_points() {
    let map = support::fitted();
    let format = FORMATS.find("fitted").unwrap();
    let read = FORMATS.find("csv").unwrap().read(&format.write(&map).unwrap(), None).unwrap();
    let nodes = || map.fitted.as_ref().unwrap().lines.iter().flat_map(|line| &line.nodes);
    let extrapolated = nodes().filter(|node| node.extrapolated).count();
    assert!(
        extrapolated > 0 && read.remarks.contains(&ImportRemark::ExtrapolatedNodes { count: extrapolated })
    );
    assert_eq!(points(&read.map).len(), nodes().count() - extrapolated);
}

/// The diameters stand below the title in fields of ten; that of the inlet is not known.
#[test]
fn sae_text_has_the_diameter_of_the_wheel() {
    let map = CompressorMap { wheel_diameter_m: Some(0.052), ..support::turbo_a() };
    let text = FORMATS.find("sae").unwrap().write(&map).unwrap();
    let text = String::from_utf8(text).unwrap();
    assert_eq!(text.lines().nth(1), Some("     0.052       0.0"));
}
