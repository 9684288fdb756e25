//! Text logs as test stands write them, and the findings about them.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_log_formats::LOG_FORMATS;
use mapper_recording::logs::{Layout, LogFile, LogOptions};
use std::path::Path;

/// Layout and, by group, times and rows.
type Read = (Layout, Vec<Vec<(f64, Vec<f64>)>>);

fn read_with(bytes: &[u8], options: &[(&str, &str)]) -> Result<Read, String> {
    let mut by = LogOptions::default();
    options.iter().for_each(|(key, value)| by.set(key, value).unwrap());
    let file = LogFile::from_bytes(Path::new("log"), bytes);
    let (_, mut log) = LOG_FORMATS.open(&file, &by).map_err(|error| error.to_string())?;
    let layout = log.layout().clone();
    let wanted: Vec<usize> = (0..layout.columns.len()).collect();
    let mut rows = vec![Vec::new(); layout.groups.len()];
    log.rows(&wanted, &mut |row| {
        rows[row.group].push((row.t_s, row.values.to_owned()));
        Ok(())
    })
    .map_err(|error| error.to_string())?;
    Ok((layout, rows))
}

fn read(text: &str) -> Read {
    read_with(text.as_bytes(), &[]).unwrap()
}

fn names(layout: &Layout) -> Vec<(&str, Option<&str>)> {
    layout.columns.iter().map(|column| (column.name.as_str(), column.unit.as_deref())).collect()
}

/// The same three rows in any notation.
const ROWS: [(f64, [f64; 2]); 3] = [(0.0, [1.5, 20.25]), (0.1, [2.5, 20.5]), (0.2, [3.5, 20.75])];

fn assert_rows(rows: &[(f64, Vec<f64>)], what: &str) {
    assert_eq!(rows.len(), 3, "{what}");
    for ((t_s, values), (expected_s, expected)) in rows.iter().zip(ROWS) {
        assert!((t_s - expected_s).abs() < 1e-9 && values[..] == expected, "{what}: {t_s} {values:?}");
    }
}

#[test]
fn separators_decimal_signs_headers_and_preambles_are_found() {
    for text in [
        "time [s],p2 [kPa],T2 [degC]\n0,1.5,20.25\n0.1,2.5,20.5\n0.2,3.5,20.75\n",
        "t;p2;T2\ns;kPa;degC\n0,0;1,5;20,25\n0,1;2,5;20,5\n0,2;3,5;20,75\n",
        "Zeit / s\tp2 / kPa\tT2 / degC\r\n0,0\t1,5\t20,25\r\n0,1\t2,5\t20,5\r\n0,2\t3,5\t20,75\r\n",
        "Stand: 7\nDate: 22.11.2026; x\n\ntime;p2;T2;\n[s];[kPa];[degC];\n0.0;1.5;20.25;\n0.1;2.5;20.5;\n0.2;3.5;20.75;\n",
        "time p2 T2\ns kPa degC\n0.0  1.5   20.25\n0.1  2.5   20.5\n0.2  3.5   20.75\n",
        "time|p2|T2\nReal time|Pressure out|Temperature out\ns|kPa|degC\n0|1.5|20.25\n0.1|2.5|20.5\n0.2|3.5|20.75\n",
        "\u{feff}t_ms,p2 [kPa],T2 [degC]\n0,1.5,20.25\n100,2.5,20.5\n200,3.5,20.75\n",
    ] {
        let (layout, rows) = read(text);
        assert_eq!(names(&layout), [("p2", Some("kPa")), ("T2", Some("degC"))], "{text}");
        assert_rows(&rows[0], text);
    }
}

#[test]
fn letters_in_latin_1_and_utf_16_are_read() {
    let text = "Zeit [s];Öl [°C];p2 [kPa]\n0,0;1,5;20,25\n0,1;2,5;20,5\n0,2;3,5;20,75\n";
    let latin: Vec<u8> = text.chars().map(|letter| u8::try_from(u32::from(letter)).unwrap()).collect();
    let wide: Vec<u8> =
        [0xFF, 0xFE].into_iter().chain(text.encode_utf16().flat_map(u16::to_le_bytes)).collect();
    let unmarked: Vec<u8> = wide[2..].to_vec();
    for bytes in [latin, wide, unmarked, text.as_bytes().to_vec()] {
        let (layout, rows) = read_with(&bytes, &[]).unwrap();
        assert_eq!(names(&layout)[0], ("Öl", Some("°C")));
        assert_rows(&rows[0], text);
    }
}

#[test]
fn the_finest_of_several_clocks_is_read_and_the_date_is_kept() {
    let text = "Datum;Uhrzeit;t [s];p2 [kPa];T2 [degC]\n\
                22.11.2026;14:03:05;0,0;1,5;20,25\n22.11.2026;14:03:05;0,1;2,5;20,5\n22.11.2026;14:03:05;0,2;3,5;20,75\n";
    let (layout, rows) = read(text);
    assert_rows(&rows[0], text);
    // 2026-11-22 14:03:05 by `date -u -d ... +%s`.
    assert_eq!(layout.start_time_ns, Some(1_795_356_185_000_000_000));
    let dated = "when,p2 [kPa],T2 [degC]\n2026-11-22 23:59:59.900,1.5,20.25\n2026-11-23 00:00:00.000,2.5,20.5\n2026-11-23T00:00:00.100,3.5,20.75\n";
    assert_rows(&read(dated).1[0], dated);
    let midnight =
        "Uhrzeit;p2 [kPa];T2 [degC]\n23:59:59,9;1,5;20,25\n00:00:00,0;2,5;20,5\n00:00:00,1;3,5;20,75\n";
    assert_rows(&read(midnight).1[0], midnight);
}

#[test]
fn columns_behind_a_clock_of_another_pace_belong_to_it() {
    let text = "t_fast [s],N [rpm],t_slow [s],T2 [degC]\n0.0,1,0.0,20\n0.1,2,1.0,21\n0.2,3,2.0,22\n0.3,4,,\n";
    let (layout, rows) = read(text);
    assert_eq!(
        layout.groups.iter().map(|group| group.name.as_str()).collect::<Vec<_>>(),
        ["t_fast", "t_slow"]
    );
    assert_eq!(rows[0], [(0.0, vec![1.0]), (0.1, vec![2.0]), (0.2, vec![3.0]), (0.3, vec![4.0])]);
    assert_eq!(rows[1], [(0.0, vec![20.0]), (1.0, vec![21.0]), (2.0, vec![22.0])]);
}

#[test]
fn rows_that_share_a_second_are_spread_over_it() {
    let mut text = String::from("time,N [rpm]\n");
    (0..50).for_each(|row| text.push_str(&format!("14:03:{:02},{row}\n", row / 10)));
    let (layout, rows) = read(&text);
    assert!(
        rows[0].windows(2).all(|pair| (pair[1].0 - pair[0].0 - 0.1).abs() < 1e-9),
        "{:?}",
        &rows[0][..12]
    );
    assert!(
        layout.findings.iter().any(|finding| finding.to_string().contains("10 rows share")),
        "{:?}",
        layout.findings
    );
}

#[test]
fn options_take_precedence_over_detection() {
    let text = "a,b,c\n1,1,-9999\n2,4,5\n3,9,6\n";
    assert!(read_with(text.as_bytes(), &[]).unwrap_err().contains("no column is a clock"));
    let (layout, rows) = read_with(text.as_bytes(), &[("rate", "10 Hz"), ("missing", "-9999")]).unwrap();
    assert_eq!(names(&layout).len(), 3);
    assert!(rows[0][0].1[2].is_nan() && rows[0][1] == (0.1, vec![2.0, 4.0, 5.0]));
    let (_, rows) = read_with(text.as_bytes(), &[("time", "b"), ("time_unit", "ms")]).unwrap();
    assert_eq!(rows[0].iter().map(|row| row.0).collect::<Vec<_>>(), [0.001, 0.004, 0.009]);
}

#[test]
fn empty_cells_and_words_are_not_numbers() {
    let (_, rows) = read("t [s];T2 [degC]\n0;20\n1;\n2;NaN\n3;Fehler\n4;21\n");
    let finite: Vec<bool> = rows[0].iter().map(|row| row.1[0].is_finite()).collect();
    assert_eq!(finite, [true, false, false, false, true]);
}
