//! Commands on maps, as a user runs them.

use mapper_tests::{
    CampaignFile, Finished, SHORT_GRID, mapper, mapper_command, python, repository, scratch, shared_run,
};
use serde_json::Value;
use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};

fn sample() -> PathBuf {
    repository().join("crates/maps/tests/data/sample_compressor.csv")
}

fn run<const N: usize>(arguments: [&OsStr; N]) -> Finished {
    mapper([OsStr::new("map")].into_iter().chain(arguments))
}

fn convert(from: &Path, to: &Path, reference: &str) {
    let option = OsStr::new("--reference");
    run(["convert".as_ref(), from.as_os_str(), to.as_os_str(), option, reference.as_ref()]).exits(0);
}

#[test]
fn a_map_without_reference_is_refused_and_nothing_is_written() {
    let scratch = scratch();
    let out = scratch.path().join("map.json");
    let finished = run(["convert".as_ref(), sample().as_os_str(), out.as_os_str()]).exits(3);
    for choice in ["SAE (298 K, 100 kPa)", "Garrett", "BorgWarner", "--reference"] {
        assert!(finished.stderr.contains(choice), "{}", finished.stderr);
    }
    assert!(!out.exists());
}

#[test]
fn a_chain_of_conversions_returns_the_original_numbers() {
    let scratch = scratch();
    let file = |name: &str| scratch.path().join(name);
    convert(&sample(), &file("a.json"), "SAE");
    let to_garrett = ["--to-reference".as_ref(), OsStr::new("Garrett")];
    let [option, garrett] = to_garrett;
    run(["convert".as_ref(), file("a.json").as_os_str(), file("b.xlsx").as_os_str(), option, garrett])
        .exits(0);
    run(["convert".as_ref(), file("b.xlsx").as_os_str(), file("c.csv").as_os_str(), option, "SAE".as_ref()])
        .exits(0);
    run(["convert".as_ref(), file("c.csv").as_os_str(), file("d.json").as_os_str()]).exits(0);
    let read = |name: &str| -> Value { serde_json::from_slice(&std::fs::read(file(name)).unwrap()).unwrap() };
    let (first, last) = (read("a.json"), read("d.json"));
    for (a, b) in lines(&first).iter().zip(lines(&last)) {
        for key in ["flow_corrected_kg_s", "pressure_ratio", "eta"] {
            for (p, q) in points(a).iter().zip(points(&b)) {
                let (p, q) = (p[key].as_f64().unwrap(), q[key].as_f64().unwrap());
                // Two changes of the state and back: some roundings.
                assert!((p - q).abs() <= 1e-13 * p.abs(), "{key} {p} {q}");
            }
        }
    }
    // An existing file is never replaced.
    run(["convert".as_ref(), file("a.json").as_os_str(), file("d.json").as_os_str()]).exits(1);
}

fn lines(map: &Value) -> Vec<Value> {
    map["lines"].as_array().unwrap().clone()
}

fn points(line: &Value) -> Vec<Value> {
    line["points"].as_array().unwrap().clone()
}

#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn independent_readers_read_the_tables_for_simulation_programs() {
    let scratch = scratch();
    let file = |name: &str| scratch.path().join(name);
    convert(&sample(), &file("map.json"), "SAE");
    let fitted = run([
        "fit".as_ref(),
        sample().as_os_str(),
        "--reference".as_ref(),
        "SAE".as_ref(),
        "--no-leave-out".as_ref(),
        "--json".as_ref(),
    ])
    .exits(0)
    .json();
    let names = ["m.modelica.txt", "m.npss.map", "m.py", "m.m"];
    for name in names {
        convert(&sample(), &file(name), "SAE");
    }
    // The middle of the table on a measured line, the surge end, and a place between two lines.
    let speed = 84_871.571_4;
    let pairs = [format!("{speed},0.5"), format!("{speed},1"), "95000,0.75".to_owned()];
    let arguments = names.iter().map(|name| file(name).into_os_string());
    let seen = python("read_map_tables.py", arguments.chain(pairs.iter().map(Into::into)));
    let line = lines(&fitted["fitted"]).into_iter().find(|l| l["speed_corrected_rpm"] == speed).unwrap();
    let surge = line["nodes"].as_array().unwrap().last().unwrap().clone();
    for format in ["modelica", "npss", "pycycle", "simscape"] {
        let values = &seen[format]["values"];
        for (index, key) in ["flow_corrected_kg_s", "pressure_ratio", "eta"].iter().enumerate() {
            let (theirs, ours) = (values[1][index].as_f64().unwrap(), surge[key].as_f64().unwrap());
            assert!((theirs - ours).abs() < 1e-9, "{format} {key}: {theirs} {ours}");
            // All four are the same table.
            for pair in 0..3 {
                let (a, b) = (&values[pair][index], &seen["modelica"]["values"][pair][index]);
                assert!((a.as_f64().unwrap() - b.as_f64().unwrap()).abs() < 1e-9, "{format} {key}");
            }
        }
    }
}

#[test]
fn a_map_equals_itself() {
    let scratch = scratch();
    let picture = scratch.path().join("difference.svg");
    let (map, option) = (sample(), OsStr::new("--reference"));
    let arguments = [
        "compare".as_ref(),
        map.as_os_str(),
        map.as_os_str(),
        option,
        "SAE".as_ref(),
        "--second-reference".as_ref(),
        "SAE".as_ref(),
        "--json".as_ref(),
        "--picture".as_ref(),
        picture.as_os_str(),
    ];
    let result = run(arguments).exits(0).json();
    assert_eq!([&result["line_differs_ratio"], &result["eta_differs_ratio"]], [0.0, 0.0]);
    assert!(result["eta_difference_rms"].as_f64().unwrap() < 1e-9);
    assert_eq!(result["lines"].as_array().unwrap().len(), 13);
    assert!(std::fs::read_to_string(picture).unwrap().starts_with("<svg"));
}

#[test]
fn a_run_gives_the_turbine_that_the_rig_has_and_its_pictures() {
    let scratch = scratch();
    let recording = shared_run(&CampaignFile::shipped_with(SHORT_GRID)).run;
    let out = scratch.path().join("rig");
    let arguments =
        || ["rig".as_ref(), recording.as_os_str(), "--out".as_ref(), out.as_os_str(), "--json".as_ref()];
    let result = run(arguments()).exits(0).json();
    for name in ["thermal_model.json", "turbine.txt"] {
        assert!(out.join(name).metadata().unwrap().len() > 100, "{name}");
    }
    for name in ["heat_transfer.svg", "error.svg"] {
        assert!(std::fs::read_to_string(out.join(name)).unwrap().starts_with("<svg"), "{name}");
        let png = std::fs::read(out.join(name).with_extension("png")).unwrap();
        assert!(png.starts_with(b"\x89PNG"), "{name}");
    }
    let turbine = result["turbine"].as_array().unwrap();
    assert!(!turbine.is_empty());
    for point in turbine {
        let number = |key: &str| point[key].as_f64().unwrap();
        // The simulated rig's swallowing law (docs/reference/model.md), 0.078 kg/s at 101.325 kPa and 288.15 K; sensors scatter by
        // some permille.
        let law = 0.078 * (1.0 - number("expansion_ratio").powf(-1.1)).sqrt() * 288.15f64.sqrt() / 101.325;
        let flow_parameter = number("flow_parameter_kg_sqrt_k_s_kpa");
        assert!((flow_parameter / law - 1.0).abs() < 0.01, "{flow_parameter} {law}");
        // The law's best efficiency is 0.75; both flow meters are off by up to 1.5 %.
        if let Some(efficiency) = point["efficiency"].as_f64() {
            assert!((0.2..0.765).contains(&efficiency), "{point}");
        }
    }
    // What is there is not replaced.
    run(arguments()).exits(1);
}

/// The same table with units in a row of their own and decimal commas.
#[test]
fn a_table_with_a_row_of_units_and_decimal_commas_is_the_same_map() {
    let scratch = scratch();
    let file = |name: &str| scratch.path().join(name);
    convert(&sample(), &file("a.json"), "SAE");
    let text = std::fs::read_to_string(sample()).unwrap();
    let rows: String = text
        .lines()
        .skip(1)
        .map(|line| {
            let row: Vec<f64> = line.split(',').map(|field| field.trim().parse().unwrap()).collect();
            format!("{};{};{};{}\n", row[0] / 1e3, 1e3 * row[1], row[2], 100.0 * row[3]).replace('.', ",")
        })
        .collect();
    std::fs::write(file("german.csv"), format!("n_red;m_red;pi;eta_is\nkrpm;g/s;-;%\n{rows}")).unwrap();
    convert(&file("german.csv"), &file("b.json"), "SAE");
    let read = |name: &str| -> Value { serde_json::from_slice(&std::fs::read(file(name)).unwrap()).unwrap() };
    let (first, second) = (read("a.json"), read("b.json"));
    let (first, second): (Vec<_>, Vec<_>) =
        (lines(&first).iter().flat_map(points).collect(), lines(&second).iter().flat_map(points).collect());
    assert_eq!((first.len(), second.len()), (93, 93));
    for (a, b) in first.iter().zip(&second) {
        for key in ["flow_corrected_kg_s", "pressure_ratio", "eta"] {
            let (a, b) = (a[key].as_f64().unwrap(), b[key].as_f64().unwrap());
            // Conversion to another unit and back, with rounding errors.
            assert!((a / b - 1.0).abs() < 1e-12, "{key} {a} {b}");
        }
    }
}

/// Lines as a digitiser writes them: a file each in lb/min, named after its speed.
#[test]
fn a_directory_of_speed_lines_is_one_map() {
    for (separator, names) in [
        (", ", ["45000.csv", "75000.csv", "surge.csv"]),
        (" ", ["45krpm.txt", "N_75000.dat", "Pumpgrenze.txt"]),
    ] {
        let scratch = scratch();
        for (name, rows) in names.iter().zip([
            [(6.0, 1.26), (9.0, 1.24)],
            [(9.5, 1.74), (15.0, 1.67)],
            [(6.0, 1.26), (9.5, 1.74)],
        ]) {
            let text: String =
                rows.iter().map(|(flow, ratio)| format!("{flow}{separator}{ratio}\n")).collect();
            std::fs::write(scratch.path().join(name), text).unwrap();
        }
        let inspect =
            ["inspect".as_ref(), scratch.path().as_os_str(), "--reference".as_ref(), OsStr::new("SAE")];
        // The unit of a figure is not in its points.
        let asked = run(inspect).exits(3);
        assert!(asked.stderr.contains("flow=kg/s"), "{}", asked.stderr);
        let [command, path, option, sae] = inspect;
        let with_unit =
            [command, path, option, sae, "--with".as_ref(), "flow=lb/min".as_ref(), "--json".as_ref()];
        let found: Value = serde_json::from_str(&run(with_unit).exits(0).stdout).unwrap();
        let speeds: Vec<(f64, u64)> = lines(&found)
            .iter()
            .map(|line| (line["speed_corrected_rpm"].as_f64().unwrap(), line["points"].as_u64().unwrap()))
            .collect();
        assert_eq!(speeds, [(45e3, 2), (75e3, 2)]);
        // 6 lb/min; a pound has 0.453 592 37 kg.
        let columns = found["columns"].as_array().unwrap();
        let flow = columns.iter().find(|column| column["key"] == "flow").unwrap();
        assert!((flow["low"].as_f64().unwrap() - 0.045_359_237).abs() < 1e-9, "{flow}");
    }
}

/// What is written is read by the rules of two public readers and by openpyxl, and a structure of MATLAB is the map of its columns.
#[test]
#[cfg_attr(not(with_python), ignore = "needs Python packages: run `cargo xtask test`")]
fn other_programs_read_the_maps_and_theirs_are_read() {
    let scratch = scratch();
    let file = |name: &str| scratch.path().join(name);
    let text = "Stage 7, test of May\n\nN [rpm];m [kg/s];PR;eta\n60000.5;0.04999;1.4;0.681234567\n60000.5;0.06;1.38;0.72\n\
                60000.5;0.07;1.3;\n90000;0.07;1.9;0.7\n90000;0.09;1.7;0.68\nSurge line;;;\n60000.5;0.045;1.41;\n90000;0.06;1.92;\n";
    std::fs::write(file("map.csv"), text).unwrap();
    for name in ["a.sae", "a.xlsx"] {
        let format = if name == "a.sae" { "sae" } else { "xlsx" };
        let (from, to) = (file("map.csv"), file(name));
        let arguments = ["convert".as_ref(), from.as_os_str(), to.as_os_str(), "--reference".as_ref()];
        let [a, b, c, d] = arguments;
        run([a, b, c, d, "SAE".as_ref(), "--to".as_ref(), format.as_ref()]).exits(0);
    }
    let seen = python("map_files.py", ["a.sae", "a.xlsx", "structure.mat"].map(&file));
    let rows = |value: &Value| -> Vec<Vec<Option<f64>>> {
        let row = |row: &Value| row.as_array().unwrap().iter().map(Value::as_f64).collect();
        value.as_array().unwrap().iter().map(row).collect()
    };
    let expected = |row: &[f64; 4]| row.map(Some).to_vec();
    let points = [
        [60000.5, 0.04999, 1.4, 0.681_234_6],
        [60000.5, 0.06, 1.38, 0.72],
        [90e3, 0.07, 1.9, 0.7],
        [90e3, 0.09, 1.7, 0.68],
    ];
    let points: Vec<Vec<Option<f64>>> = points.iter().map(expected).collect();
    assert_eq!(rows(&seen["engine_tool_box"]["points"]), points);
    let surge = rows(&seen["engine_tool_box"]["surge"]);
    let surge: Vec<&[Option<f64>]> = surge.iter().map(|row| &row[..3]).collect();
    let marks = [[60000.5, 0.045, 1.41], [90e3, 0.06, 1.92]].map(|mark| mark.map(Some));
    assert_eq!(surge, marks.each_ref().map(|mark| &mark[..]));
    let by_line: Vec<Vec<Vec<Option<f64>>>> = seen["open_wam"].as_array().unwrap().iter().map(rows).collect();
    assert_eq!(by_line, [points[..2].to_vec(), points[2..].to_vec()]);
    // The point without an efficiency, and every digit, are in the companion and in the workbook.
    let companion = std::fs::read_to_string(file("a.points.csv")).unwrap();
    assert!(companion.contains("0.681234567") && companion.contains(",0.07,1.3,,"), "{companion}");
    let sheets = seen["workbook"].as_object().unwrap();
    assert!(["Map", "Points", "Conditions", "Surge line"].iter().all(|name| sheets.contains_key(*name)));
    let map = rows(&sheets["Map"]);
    let numbers: Vec<_> = map.iter().filter(|row| row[0].is_some()).cloned().collect();
    assert_eq!((numbers.len(), numbers[0][3], numbers[2][3]), (5, Some(0.681_234_567), None));
    // The title survives both.
    for name in ["a.sae", "a.xlsx"] {
        let back = file(&format!("{name}.json"));
        run(["convert".as_ref(), file(name).as_os_str(), back.as_os_str()]).exits(0);
        let back: Value = serde_json::from_slice(&std::fs::read(back).unwrap()).unwrap();
        assert_eq!(back["machine"], "Stage 7, test of May", "{name}");
        assert_eq!(back["surge"].as_array().unwrap().len(), 2, "{name}");
    }
    let mat = file("structure.mat");
    let inspected =
        run(["inspect".as_ref(), mat.as_os_str(), "--reference".as_ref(), "SAE".as_ref(), "--json".as_ref()]);
    let inspected: Value = serde_json::from_str(&inspected.exits(0).stdout).unwrap();
    let of_lines: Vec<(f64, u64)> = lines(&inspected)
        .iter()
        .map(|line| (line["speed_corrected_rpm"].as_f64().unwrap(), line["points"].as_u64().unwrap()))
        .collect();
    assert_eq!(of_lines, [(60e3, 3), (90e3, 3)]);
    let flow = inspected["columns"]
        .as_array()
        .unwrap()
        .iter()
        .find(|column| column["key"] == "flow")
        .unwrap()
        .clone();
    assert_eq!((flow["low"].as_f64(), flow["high"].as_f64()), (Some(0.05), Some(0.09)));
}

/// Line ends, a byte order mark, another encoding, compression and standard input change nothing, for maps, steady points and logs.
#[test]
fn content_is_the_same_however_it_is_packed() {
    let scratch = scratch();
    let log: String =
        (0..200).map(|row| format!("{row},{},{}\n", 100.0 + f64::from(row / 20), 20 + row / 10)).collect();
    for (name, command, content) in [
        ("map.csv", "map", "Speed,Flow,PR,Efficiency\nrpm,lb/s,T-T,%\n45000,0.1,1.26,69\n45000,0.15,1.24,75\n75000,0.2,1.74,69\n".to_owned()),
        ("points.csv", "map", "N [rpm];m [g/s];P1 [kPa];T1 [°C];P2 [kPa];T2 [°C]\n50000;60;97,5;21,4;129,7;57,1\n80000;96;97;21,7;179;102\n".to_owned()),
        ("log.csv", "log", format!("Time [s],Compressor outlet pressure [kPa],Compressor outlet temperature [degC]\n{log}")),
    ] {
        let inspect = |input: Option<&Path>, path: &Path| {
            let reference: &[&str] = if command == "map" { &["--reference", "SAE"] } else { &[] };
            let mut arguments = vec![command.as_ref(), "inspect".as_ref(), path.as_os_str(), "--json".as_ref()];
            arguments.extend(reference.iter().map(OsStr::new));
            let mut command = mapper_command(arguments);
            if let Some(input) = input {
                command.stdin(std::fs::File::open(input).unwrap());
            }
            let finished: Finished = command.output().unwrap().into();
            let mut found = finished.exits(0).json();
            for key in ["map", "log", "file", "path", "channel_map"] {
                found.as_object_mut().unwrap().remove(key);
            }
            found
        };
        let write = |name: &str, bytes: &[u8]| {
            let path = scratch.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            path
        };
        let plain = write(name, content.as_bytes());
        let expected = inspect(None, &plain);
        let windows = content.replace('\n', "\r\n");
        let wide: Vec<u8> = format!("\u{feff}{windows}").encode_utf16().flat_map(u16::to_le_bytes).collect();
        let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        packer.write_all(content.as_bytes()).unwrap();
        let packed = write(&format!("{name}.gz"), &packer.finish().unwrap());
        for path in [
            write(&format!("windows_{name}"), windows.as_bytes()),
            write(&format!("mark_{name}"), format!("\u{feff}{content}").as_bytes()),
            packed.clone(),
        ] {
            assert_eq!(inspect(None, &path), expected, "{}", path.display());
        }
        assert_eq!(inspect(Some(&plain), Path::new("-")), expected, "{name}");
        assert_eq!(inspect(Some(&packed), Path::new("-")), expected, "{name}");
        let wide = inspect(None, &write(&format!("wide_{name}"), &wide));
        assert_eq!(wide["columns"], expected["columns"], "{name}");
    }
}

/// The lines of a digitiser: their folder, and the files themselves, are the same map of both lines.
#[test]
fn several_files_are_one_map_as_their_folder_is() {
    let folder = scratch();
    let files = ["45000.csv", "75000.csv"].map(|name| folder.path().join(name));
    std::fs::write(&files[0], "flow [lb/min],PR\n5.9,1.267\n9.2,1.244\n12.4,1.134\n").unwrap();
    std::fs::write(&files[1], "flow [lb/min],PR\n9.5,1.742\n14.9,1.677\n20.4,1.371\n").unwrap();
    let option = ["--reference", "SAE", "--json"].map(OsStr::new);
    let inspect = |files: &[&Path]| {
        let files = files.iter().map(|file| file.as_os_str());
        let all = ["map", "inspect"].map(OsStr::new).into_iter().chain(files).chain(option);
        mapper(all).exits(0).json()
    };
    let of_files = inspect(&[&files[1], &files[0]]);
    assert_eq!(of_files, inspect(&[folder.path()]));
    let speeds: Vec<f64> =
        lines(&of_files).iter().map(|line| line["speed_corrected_rpm"].as_f64().unwrap()).collect();
    assert_eq!(speeds, [45e3, 75e3]);
    let out = folder.path().join("map.json");
    let [first, second] = files.each_ref().map(|file| file.as_os_str());
    run(["convert".as_ref(), first, second, out.as_os_str(), option[0], option[1]]).exits(0);
    let map: Value = serde_json::from_slice(&std::fs::read(out).unwrap()).unwrap();
    assert_eq!(lines(&map).iter().map(|line| line["points"].as_array().unwrap().len()).sum::<usize>(), 6);
    run(["inspect".as_ref(), first, folder.path().join("none.csv").as_os_str(), option[0], option[1]])
        .exits(1);
}
