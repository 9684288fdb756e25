//! Layouts and clocks of loggers and programs: each file holds the same measurement, one row a second.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_log_formats::LOG_FORMATS;
use mapper_recording::logs::{Layout, LogFile, LogOptions};
use std::io::Write;
use std::path::Path;

const ROWS: usize = 150;

/// Layout and rows of a text.
fn read(text: &str) -> (Layout, Vec<(f64, Vec<f64>)>) {
    let file = LogFile::from_bytes(Path::new("log"), text.as_bytes());
    let (_, mut log) =
        LOG_FORMATS.open(&file, &LogOptions::default()).unwrap_or_else(|why| panic!("{why}\n{text}"));
    let layout = log.layout().clone();
    let wanted: Vec<usize> = (0..layout.columns.len()).collect();
    let mut rows = Vec::new();
    log.rows(&wanted, &mut |row| {
        rows.push((row.t_s, row.values.to_owned()));
        Ok(())
    })
    .unwrap();
    (layout, rows)
}

fn p2_kpa(row: usize) -> f64 {
    100.0 + 0.25 * row as f64
}

fn t2_degc(row: usize) -> f64 {
    20.0 + 0.5 * row as f64
}

/// A text with these lines before the data, and a line for each row.
fn text(head: &str, line: impl Fn(usize) -> String) -> String {
    (0..ROWS).fold(head.to_owned(), |text, row| text + &line(row) + "\n")
}

/// The columns with these names have the measurement, with its units if they are given.
fn assert_measured(text: &str, p2: &str, t2: &str, units: bool) {
    let (layout, rows) = read(text);
    let start: String = text.chars().take(300).collect();
    let find = |name: &str| {
        layout
            .columns
            .iter()
            .position(|column| column.name == name)
            .unwrap_or_else(|| panic!("{name}: {layout:?}\n{start}"))
    };
    let (p2, t2) = (find(p2), find(t2));
    if units {
        let of = |column: usize| layout.columns[column].unit.as_deref();
        assert_eq!((of(p2), of(t2)), (Some("kPa"), Some("degC")), "{start}");
    }
    assert_eq!(rows.len(), ROWS, "{start}");
    for (row, (t_s, values)) in rows.iter().enumerate() {
        // A clock in days has the resolution of its digits.
        assert!((t_s - row as f64).abs() < 0.02, "{t_s} {row}\n{start}");
        assert!(
            (values[p2] - p2_kpa(row)).abs() < 1e-9 && (values[t2] - t2_degc(row)).abs() < 1e-9,
            "{start}"
        );
    }
}

/// Hours, minutes and seconds of a row of a log that begins at 10:58:50.
fn clock(row: usize) -> (usize, usize, usize) {
    let second = 39_530 + row;
    (second / 3600, second / 60 % 60, second % 60)
}

/// What it is, and the clock's text in a row.
type Notation = (&'static str, fn(usize) -> String);

#[test]
fn clocks_in_the_notations_of_programs() {
    let notations: [Notation; 12] = [
        ("month by name", |row| {
            let (h, m, s) = clock(row);
            format!("18-Nov-2025 {h:02}:{m:02}:{s:02}")
        }),
        ("month before day", |row| {
            let (h, m, s) = clock(row);
            format!("\"Nov 18, 2025 {h:02}:{m:02}:{s:02}\"")
        }),
        ("French month", |row| {
            let (h, m, s) = clock(row);
            format!("18 févr. 2025 {h:02}:{m:02}:{s:02}")
        }),
        ("minutes and seconds, over the hour", |row| {
            let (_, m, s) = clock(row);
            format!("{m:02}:{s:02}.0")
        }),
        ("day of the year", |row| {
            let (h, m, s) = clock(row);
            format!("322:{h:02}:{m:02}:{s:02}.000")
        }),
        ("year and day", |row| {
            let (h, m, s) = clock(row);
            format!("2025-322T{h:02}:{m:02}:{s:02}")
        }),
        ("duration of Python", |row| format!("0 days 00:{:02}:{:02}", row / 60, row % 60)),
        ("days of a spreadsheet", |row| format!("{:.9}", 45_979.431 + row as f64 / 86_400.0)),
        ("days of MATLAB", |row| format!("{:.8}", 739_938.431 + row as f64 / 86_400.0)),
        ("Fortran", |row| format!("{:.2}D+01", row as f64 / 10.0)),
        ("unit behind the number", |row| format!("{row} s")),
        ("end of daylight saving", |row| {
            // 02:59:30 is followed by 02:00:00 of standard time after half a minute.
            let second = 10_770 + row;
            let second = if second < 10_800 { second } else { second - 3600 };
            format!("26.10.2025 {:02}:{:02}:{:02}", second / 3600, second / 60 % 60, second % 60)
        }),
    ];
    for (_, notation) in notations {
        let text = text("Time;p2 [kPa];T2 [degC]\n", |row| {
            format!("{};{};{}", notation(row), p2_kpa(row), t2_degc(row))
        });
        assert_measured(&text, "p2", "T2", true);
    }
}

#[test]
fn minutes_that_rows_share_are_spread_from_the_first_one() {
    // The log begins 22 s into a minute.
    let text = text("Time,p2 [kPa],T2 [degC]\n", |row| {
        let minute = (22 + row) / 60;
        format!("2025-11-18 10:{:02},{},{}", 20 + minute, p2_kpa(row), t2_degc(row))
    });
    assert_measured(&text, "p2", "T2", true);
}

#[test]
fn rows_out_of_order_are_sorted() {
    // Packets of ten rows, of which every fourth arrives backwards.
    let at = |row: usize| if row / 10 % 4 == 1 { row / 10 * 10 + 9 - row % 10 } else { row };
    let text = text("Time [s],p2 [kPa],T2 [degC]\n", |row| {
        let row = at(row);
        format!("{row},{},{}", p2_kpa(row), t2_degc(row))
    });
    assert_measured(&text, "p2", "T2", true);
}

#[test]
fn layouts_of_loggers() {
    let comma = |value: f64| value.to_string().replace('.', ",");
    // LabVIEW: two headers, units in the second, the comma as decimal sign.
    assert_measured(
        &text(
            "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\n***End_of_Header***\t\n\t\nChannels\t2\t\t\n\
             Samples\t1\t1\t\nY_Unit_Label\tkPa\tdegC\t\nX_Dimension\tTime\tTime\t\nX0\t0,0E+0\t0,0E+0\t\n\
             Delta_X\t1,0\t1,0\t\n***End_of_Header***\t\t\t\nX_Value\tp2\tT2\tComment\n",
            |row| format!("{},0\t{}\t{}\t", row, comma(p2_kpa(row)), comma(t2_degc(row))),
        ),
        "p2",
        "T2",
        true,
    );
    // Sections in brackets; a value that did not change is left out.
    let (layout, rows) = read(&text(
        "Log file\nVersion: 1\n\n[Channel Information]\n0,17,18\nOffset,p2,T2\ns,kPa,degC\n\n[Channel Data]\n",
        |row| {
            format!(
                "{row},{},{}",
                p2_kpa(row),
                if row % 4 == 0 { t2_degc(row).to_string() } else { String::new() }
            )
        },
    ));
    let names: Vec<&str> = layout.columns.iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["p2", "T2"]);
    assert!(rows[3].1[1].is_nan() && rows[4].1[1] == t2_degc(4) && rows[149].1[0] == p2_kpa(149));
    // A header behind a comment sign, with and without a blank.
    for head in ["# time p2 T2\n# s kPa degC\n", "%time p2 T2\n%s kPa degC\n"] {
        assert_measured(
            &text(head, |row| format!("{row} {} {}", p2_kpa(row), t2_degc(row))),
            "p2",
            "T2",
            true,
        );
    }
    // The header again in the middle.
    let again = text("time [s],p2 [kPa],T2 [degC]\n", |row| {
        let header = if row == 70 { "time [s],p2 [kPa],T2 [degC]\n" } else { "" };
        format!("{header}{row},{},{}", p2_kpa(row), t2_degc(row))
    });
    assert_measured(&again, "p2", "T2", true);
    // Units behind the numbers, a blank behind the sign.
    assert_measured(
        &text("Time;p2;T2\n", |row| format!("{row} s;{} kPa;{} degC", p2_kpa(row), t2_degc(row))),
        "p2",
        "T2",
        true,
    );
    assert_measured(
        &text("time [s],p2 [kPa],T2 [degC]\n", |row| format!("{row},+   {},+ {}", p2_kpa(row), t2_degc(row))),
        "p2",
        "T2",
        true,
    );
    // Groups over several columns with equal names.
    assert_measured(
        &text(
            ",Compressor,,Turbine,\nTime,Outlet pressure,Outlet temperature,Outlet pressure,Outlet temperature\ns,kPa,degC,kPa,degC\n",
            |row| format!("{row},{},{},1,2", p2_kpa(row), t2_degc(row)),
        ),
        "Compressor Outlet pressure",
        "Compressor Outlet temperature",
        true,
    );
}

#[test]
fn a_table_in_long_form_is_gathered() {
    let long = text("Tag,When,Value,Quality\n", |row| {
        let (h, m, s) = clock(row);
        let when = format!("2025-11-18 {h:02}:{m:02}:{s:02}");
        format!("p2,{when},{},192\nT2,{when},{},192", p2_kpa(row), t2_degc(row))
    });
    assert_measured(&long, "p2", "T2", false);
    let with_units = text("time;variable;unit;wert\n", |row| {
        format!("{row};p2;kPa;{}\n{row};T2;degC;{}", p2_kpa(row), t2_degc(row))
    });
    assert_measured(&with_units, "p2", "T2", true);
}

/// A column of words is no name of quantities if it keeps its word: the state of a stand.
#[test]
fn a_state_is_no_name_of_a_quantity() {
    let states = ["idle", "warm up", "step"];
    let text = text("Time;State;p2 [kPa];T2 [degC]\n", |row| {
        format!("{row};{};{};{}", states[row / 10 % 3], p2_kpa(row), t2_degc(row))
    });
    assert_measured(&text, "p2", "T2", true);
    // Tags that begin with the sign of a comment.
    let tags = (0..ROWS).fold("tag,time,value\n".to_owned(), |text, row| {
        text + &format!("/daq/p2,{row},{}\n/daq/T2,{row},{}\n", p2_kpa(row), t2_degc(row))
    });
    assert_measured(&tags, "/daq/p2", "/daq/T2", false);
}

#[test]
fn a_unit_may_begin_with_a_digit() {
    let (layout, rows) = read(&text("time;n\n", |row| format!("{row} s;{} 1/min", 1000 * row)));
    assert_eq!(layout.columns[0].unit.as_deref(), Some("1/min"));
    assert!(rows.iter().enumerate().all(|(row, (_, values))| values[0] == 1000.0 * row as f64));
}

/// The day numbers of a spreadsheet under a word for the date.
#[test]
fn a_date_may_be_a_day_number() {
    let line =
        |row: usize| format!("{:.9};{};{}", 45_979.431 + row as f64 / 86_400.0, p2_kpa(row), t2_degc(row));
    assert_measured(&text("Datum;p2 [kPa];T2 [degC]\n", line), "p2", "T2", true);
}

#[test]
fn a_unit_that_changes_gives_no_number() {
    // An instrument that ranges by itself: 998 mbar, then 1.02 bar.
    let (layout, rows) = read(&text("Time;p2;T2\n", |row| {
        let p2 = if row < 149 { format!("{} mbar", 10.0 * p2_kpa(row)) } else { "1.37 bar".to_owned() };
        format!("{row} s;{p2};{} degC", t2_degc(row))
    }));
    assert_eq!(layout.columns[0].name, "p2");
    assert!(rows[149].1[0].is_nan() || layout.columns[0].unit.is_none());
}

/// Names of several words above columns between blanks, to the right of which the numbers end.
#[test]
fn names_of_several_words_between_blanks() {
    let names = format!("{:>8}{:>22}{:>22}\n", "Time", "Comp Outlet Pressure", "Comp Outlet Temp");
    let units = format!("{:>8}{:>22}{:>22}\n", "(s)", "(kPa)", "(degC)");
    let line = |row: usize| format!("{row:8}{:22.2}{:22.1}", p2_kpa(row), t2_degc(row));
    assert_measured(&text(&(names + &units), line), "Comp Outlet Pressure", "Comp Outlet Temp", true);
    // Four names above three columns name none, the clock neither.
    let unknown = text("Time  Outlet  Pressure of the compressor  and more\n", |row| {
        format!("{row} {} {}", p2_kpa(row), t2_degc(row))
    });
    let file = LogFile::from_bytes(Path::new("log"), unknown.as_bytes());
    let refused = LOG_FORMATS.open(&file, &LogOptions::default()).err().unwrap().to_string();
    assert!(refused.contains("column 1, column 2, column 3"), "{refused}");
    let named = LogOptions { time: vec!["column 1".to_owned()], ..LogOptions::default() };
    assert_eq!(LOG_FORMATS.open(&file, &named).unwrap().1.layout().columns.len(), 2);
}

#[test]
fn a_compressed_log_is_its_content() {
    let plain =
        text("time [s],p2 [kPa],T2 [degC]\n", |row| format!("{row},{},{}", p2_kpa(row), t2_degc(row)));
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packer.write_all(plain.as_bytes()).unwrap();
    let packed = packer.finish().unwrap();
    let open = |bytes: &[u8]| {
        let file = LogFile::from_bytes(Path::new("log.csv.gz"), bytes);
        LOG_FORMATS
            .open(&file, &LogOptions::default())
            .map(|(format, log)| (format.name, log.layout().clone()))
    };
    assert_eq!(open(&packed).unwrap(), open(plain.as_bytes()).unwrap());
    assert!(open(&packed[..packed.len() / 2]).is_err(), "cut short");
}

/// The hour that local time repeats is corrected, wherever in the log it is, with a remark.
#[test]
fn the_end_of_daylight_saving_is_remarked() {
    let rows = 2000;
    let line = |row: usize| {
        let second = 9000 + row;
        let second = if second < 10_800 { second } else { second - 3600 };
        format!(
            "26.10.2025 {:02}:{:02}:{:02};{};20.5\n",
            second / 3600,
            second / 60 % 60,
            second % 60,
            100 + row
        )
    };
    let log =
        |rows: usize| (0..rows).fold("Time;p2 [kPa];T2 [degC]\n".to_owned(), |text, row| text + &line(row));
    let remarks = |text: &str| {
        let file = LogFile::from_bytes(Path::new("log"), text.as_bytes());
        let (_, mut log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
        let before = log.layout().findings.len();
        let mut last_s = 0.0;
        log.rows(&[0], &mut |row| {
            last_s = row.t_s;
            Ok(())
        })
        .unwrap();
        (last_s, log.layout().findings.len() - before)
    };
    assert_eq!(remarks(&log(rows)), (1999.0, 1));
    assert_eq!(remarks(&log(1000)), (999.0, 0));
}

/// Written by xlwt: dates over midnight, with the format of a German Excel.
#[test]
fn an_old_workbook_has_its_dates() {
    let file = LogFile::from_bytes(Path::new("dates.xls"), include_bytes!("dates.xls"));
    let (format, mut log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
    assert_eq!((format.name, log.layout().columns[2].unit.as_deref()), ("Excel", Some("°C")));
    // 2025-11-18 23:59:50.
    assert_eq!(log.layout().start_time_ns, Some(1_763_510_390_000_000_000));
    let mut rows = Vec::new();
    log.rows(&[0, 1, 2], &mut |row| {
        rows.push((row.t_s, row.values.to_vec()));
        Ok(())
    })
    .unwrap();
    assert_eq!((rows.len(), &rows[39]), (40, &(39.0, vec![60_039.0, p2_kpa(39), t2_degc(39)])));
}

/// Two rates next to each other, each with its own clock; the slower one ends in the middle of the file.
#[test]
fn clocks_side_by_side_are_groups() {
    let line = |row: usize| {
        let slow = 2 * row;
        let right = if slow < ROWS { format!("{slow},{}", t2_degc(slow)) } else { ",".to_owned() };
        format!("{row},{},{right}", p2_kpa(row))
    };
    let (layout, rows) = read(&text("time_1 [s],p2 [kPa],time_2 [s],T2 [degC]\n", line));
    let groups: Vec<usize> = layout.columns.iter().map(|column| column.group).collect();
    assert_eq!((layout.groups.len(), groups), (2, vec![0, 1]));
    // Pressures are at least 100 here, temperatures below.
    let (slow, fast): (Vec<_>, Vec<_>) = rows.iter().partition(|(_, values)| values[0] < 100.0);
    assert_eq!((fast.len(), slow.len()), (ROWS, ROWS / 2));
    assert!(slow.iter().all(|(t_s, values)| (values[0] - (20.0 + 0.5 * t_s)).abs() < 1e-9));
}

#[test]
fn names_may_be_in_a_list_above_the_table() {
    let row = |row: usize| format!("{row},{},{}", p2_kpa(row), t2_degc(row));
    for list in [
        "%DataLog%\nVersion : 1.1\nChannel : P2\nUnit : kPa\nID : 7\nType : Raw\nChannel : T2\nUnit : degC\nID : 8\nType : Raw\n",
        "; Ch1 = P2 [kPa]\n; Ch2 = T2 [degC]\n",
        "# 1: Time [s]\n# 2: P2 [kPa]\n# 3: T2 [degC]\n",
    ] {
        let (layout, rows) = read(&text(list, row));
        let columns: Vec<(&str, Option<&str>)> = layout
            .columns
            .iter()
            .map(|column| (column.name.as_str(), column.unit.as_deref()))
            .filter(|(name, _)| *name != "Time")
            .collect();
        assert_eq!(columns, [("P2", Some("kPa")), ("T2", Some("degC"))], "{list}");
        assert_eq!((rows.len(), rows[4].0), (ROWS, 4.0), "{list}");
    }
}

#[test]
fn unknown_units_do_not_hide_the_known_ones() {
    let head = "Time;P2;T2;Torque;Noise;Injection;State\ns;kPa;degC;Nm;dB(A);mg/str;on/off\n";
    let (layout, _) = read(&text(head, |row| format!("{row};{};{};4;5;6;1", p2_kpa(row), t2_degc(row))));
    let unit = |name: &str| layout.columns.iter().find(|column| column.name == name).unwrap().unit.clone();
    assert_eq!((unit("P2").as_deref(), unit("T2").as_deref()), (Some("kPa"), Some("degC")));
}

/// Machine, place and quantity in three rows, with units below or in the names.
#[test]
fn headings_of_three_rows_keep_machine_place_and_quantity() {
    let row = |row: usize| format!("{row},60000,98,{},22,{},150,500", p2_kpa(row), t2_degc(row));
    let groups = ",,Compressor,,,,Turbine,\n,,Inlet,Outlet,Inlet,Outlet,Inlet,\n";
    let places = ",,Compressor,,,,Turbine,\n,,Inlet,Outlet,Inlet,Outlet,Inlet,Inlet\n";
    for head in [
        format!("{groups}Time,N,p,p,T,T,p,T\ns,rpm,kPa,kPa,degC,degC,kPa,degC\n"),
        format!("{places}Time [s],N [rpm],p [kPa],p [kPa],T [degC],T [degC],p [kPa],T [degC]\n"),
    ] {
        assert_measured(&text(&head, row), "Compressor Outlet p", "Compressor Outlet T", true);
        let (layout, _) = read(&text(&head, row));
        let names: Vec<&str> = layout.columns.iter().map(|column| column.name.as_str()).collect();
        assert!(names.contains(&"Turbine Inlet p") && names.contains(&"Turbine Inlet T"), "{names:?}");
    }
}

/// The first keys of imc FAMOS look like text.
#[test]
fn famos_is_named() {
    let file =
        LogFile::from_bytes(Path::new("log.dat"), b"|CF,2,1,1;|CK,1,3,1,1;\r\n|CD,1,20,0.1,1,1,s,0,0,0;\r\n");
    let error = LOG_FORMATS.open(&file, &LogOptions::default()).err().unwrap();
    assert!(
        matches!(&error, mapper_recording::logs::LogError::Unknown { found, .. } if found.contains("FAMOS")),
        "{error}"
    );
}
