//! Damaged, foreign and hostile files: no panic, no hang, what can be saved is saved.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use crate::common::{batch, step, write};
use mapper_core::{Channel, SampleBatch};
use mapper_recording::{
    ChannelMap, ChunkError, ReadOptions, ReadReport, ReadWarning, RecordError, read_recording,
    read_recording_from,
};
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::path::Path;

fn read(bytes: &[u8]) -> Result<ReadReport, RecordError> {
    read_recording_from(bytes, Path::new("test.mcap"), &ChannelMap::native(), &ReadOptions::default())
}

fn recorded(batch: &SampleBatch) -> Vec<u8> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    write(&path, batch, &[step(0, 0.0, 5.0), step(1, 5.0, 20.0)]);
    std::fs::read(path).unwrap()
}

/// The records of a file: offset, opcode, length of the body.
fn records(bytes: &[u8]) -> Vec<(usize, u8, usize)> {
    let mut found = Vec::new();
    let mut offset = 8;
    while offset + 9 < bytes.len() {
        let length = u64::from_le_bytes(bytes[offset + 1..offset + 9].try_into().unwrap()) as usize;
        found.push((offset, bytes[offset], length));
        offset += 9 + length;
    }
    found
}

#[test]
fn every_truncation_gives_a_prefix() {
    let batch = batch(200);
    let bytes = recorded(&batch);
    let mut longest = 0;
    for length in (8..bytes.len()).step_by(97) {
        let report = read(&bytes[..length]).unwrap();
        assert!(!report.warnings.is_empty(), "{length}");
        for (channel, series) in &report.recording.series {
            let whole = batch.column(*channel).unwrap();
            assert_eq!(series.values, whole[..series.values.len()], "{length}");
            longest = series.values.len();
        }
    }
    assert_eq!(longest, 200, "an almost whole file has all samples");
    for length in 0..8 {
        assert!(matches!(read(&bytes[..length]), Err(RecordError::NotMcap { .. })));
    }
}

#[test]
fn a_damaged_chunk_costs_its_own_second_alone() {
    let batch = batch(100);
    let mut bytes = recorded(&batch);
    // The chunks are the topics of the header, then one per second.
    let chunks: Vec<_> = records(&bytes).into_iter().filter(|record| record.1 == 6).collect();
    let (offset, _, length) = chunks[4];
    bytes[offset + 9 + length - 20] ^= 0x10;
    let report = read(&bytes).unwrap();
    assert!(matches!(report.warnings[..], [ReadWarning::DamagedChunk { .. }]), "{:?}", report.warnings);
    let series = &report.recording.series[&Channel::T2];
    assert_eq!(series.t_s.len(), 90);
    assert!(series.t_s.windows(2).all(|pair| pair[0] < pair[1]));
}

#[test]
fn topics_lost_in_a_damaged_chunk_are_found_in_the_index() {
    let mut bytes = recorded(&batch(100));
    let chunks: Vec<_> = records(&bytes).into_iter().filter(|record| record.1 == 6).collect();
    for (offset, _, length) in &chunks[..2] {
        bytes[offset + 9 + length - 20] ^= 0x10;
    }
    let report = read(&bytes).unwrap();
    assert!(report.recording.series[&Channel::T2].t_s.len() >= 80, "{:?}", report.warnings);
    assert!(!report.warnings.iter().any(|w| matches!(w, ReadWarning::UndefinedChannel { .. })));
}

#[test]
fn a_chunk_that_claims_more_than_it_holds_is_left_out_without_allocating_it() {
    let mut bytes = recorded(&batch(100));
    let chunks: Vec<_> = records(&bytes).into_iter().filter(|record| record.1 == 6).collect();
    for (claim, at) in [(u64::MAX, 4), (200 << 20, 5), (1, 6)] {
        let uncompressed_size = chunks[at].0 + 9 + 16;
        bytes[uncompressed_size..uncompressed_size + 8].copy_from_slice(&claim.to_le_bytes());
    }
    let report = read(&bytes).unwrap();
    let damaged = report.warnings.iter().filter(|w| matches!(w, ReadWarning::DamagedChunk { .. })).count();
    assert_eq!((damaged, report.recording.series[&Channel::T2].t_s.len()), (3, 70));
}

/// One such chunk is damage, and all of them are the work of another program, whatever the channel map asks for.
#[test]
fn a_file_of_unknown_compression_is_refused_by_its_name() {
    let whole = recorded(&batch(100));
    let chunks: Vec<_> = records(&whole).into_iter().filter(|record| record.1 == 6).collect();
    let renamed = |count: usize| {
        let mut bytes = whole.clone();
        for chunk in &chunks[..count] {
            // Times, size, checksum and the length of the name before it.
            let name = chunk.0 + 9 + 8 + 8 + 8 + 4 + 4;
            assert_eq!(&bytes[name..name + 4], b"zstd");
            bytes[name..name + 4].copy_from_slice(b"brot");
        }
        bytes
    };
    assert!(read(&renamed(1)).unwrap().recording.series[&Channel::T2].t_s.len() >= 80);
    let refused = read(&renamed(chunks.len())).unwrap_err();
    let RecordError::NothingReadable { warning: ReadWarning::DamagedChunk { source, .. }, .. } = &refused
    else {
        panic!("{refused}")
    };
    assert!(matches!(source, ChunkError::Compression { compression } if compression == "brot"), "{refused}");
}

#[test]
fn a_record_that_claims_more_than_the_file_ends_the_reading() {
    let mut bytes = recorded(&batch(100));
    let chunks: Vec<_> = records(&bytes).into_iter().filter(|record| record.1 == 6).collect();
    let offset = chunks[4].0;
    bytes[offset + 1..offset + 9].copy_from_slice(&u64::MAX.to_le_bytes());
    let report = read(&bytes).unwrap();
    assert!(report.warnings.contains(&ReadWarning::Truncated { offset: offset as u64 }));
    assert_eq!(report.recording.series[&Channel::T2].t_s.len() % 10, 0);
}

#[test]
fn messages_are_bounded() {
    let bytes = recorded(&batch(100));
    let options = ReadOptions { max_messages: 100, ..ReadOptions::default() };
    let report = read_recording_from(&bytes, Path::new("x"), &ChannelMap::native(), &options).unwrap();
    assert!(report.warnings.contains(&ReadWarning::TooManyMessages { limit: 100 }));
}

#[test]
fn values_are_bounded() {
    let options = ReadOptions { max_values: 100, ..ReadOptions::default() };
    let report =
        read_recording_from(&recorded(&batch(100)), Path::new("x"), &ChannelMap::native(), &options).unwrap();
    assert!(report.warnings.contains(&ReadWarning::TooManyValues { limit: 100 }));
    let kept: usize = report.recording.series.values().map(|series| series.t_s.len()).sum();
    assert!((80..130).contains(&kept), "{kept}");
}

/// Records that a chunk holds by the million take no memory each.
#[test]
fn damaged_records_are_counted_and_a_few_are_listed() {
    let magic = b"\x89MCAP0\r\n";
    // A message of one byte.
    let cut = [&[5u8][..], &1u64.to_le_bytes(), &[0]].concat();
    let bytes = [&magic[..], &cut.repeat(1000)].concat();
    let report = read(&bytes).unwrap();
    let listed = report.warnings.iter().filter(|w| matches!(w, ReadWarning::DamagedRecord { .. })).count();
    assert_eq!(listed, 100);
    assert!(report.warnings.contains(&ReadWarning::MoreDamage { count: 900 }), "{:?}", report.warnings);
    let options = ReadOptions { max_messages: 500, ..ReadOptions::default() };
    let bounded = read_recording_from(&bytes, Path::new("x"), &ChannelMap::native(), &options).unwrap();
    assert!(bounded.warnings.contains(&ReadWarning::MoreDamage { count: 400 }), "{:?}", bounded.warnings);
}

#[test]
fn a_file_that_is_not_mcap_is_refused() {
    let error = read(b"time,T2\n0,300\n").unwrap_err();
    assert!(error.to_string().contains("not an MCAP file"), "{error}");
    let missing = read_recording(Path::new("/no/such.mcap"), &ChannelMap::native(), &ReadOptions::default());
    assert!(matches!(missing, Err(RecordError::Read { .. })));
}

/// A file as another program writes it: `mcap`'s own defaults, uncompressed.
fn foreign(topic: &str, rows: &[(u64, &str)], metadata: &[(&str, &str)]) -> Vec<u8> {
    let mut file = std::io::Cursor::new(Vec::new());
    let mut writer = mcap::WriteOptions::new().compression(None).create(&mut file).unwrap();
    let metadata: BTreeMap<_, _> = metadata.iter().map(|(k, v)| ((*k).to_owned(), (*v).to_owned())).collect();
    let schema = writer.add_schema("rig", "jsonschema", b"{}").unwrap();
    let channel_id = writer.add_channel(schema, topic, "json", &metadata).unwrap();
    for (sequence, (log_time, data)) in rows.iter().enumerate() {
        let header = mcap::records::MessageHeader {
            channel_id,
            sequence: sequence as u32,
            log_time: *log_time,
            publish_time: *log_time,
        };
        writer.write_to_known_channel(&header, data.as_bytes()).unwrap();
    }
    writer.finish().unwrap();
    drop(writer);
    file.into_inner()
}

/// The chunks of an uncompressed file with `pack` applied to their content.
fn packed(bytes: &[u8], compression: &str, pack: impl Fn(&[u8]) -> Vec<u8>) -> Vec<u8> {
    let mut file = bytes[..8].to_vec();
    for (at, opcode, length) in records(bytes) {
        let body = &bytes[at + 9..at + 9 + length];
        // Chunk: start, end, size, checksum, no compression, content.
        let body = match opcode {
            6 => {
                let content = pack(&body[8 + 8 + 8 + 4 + 4 + 8..]);
                let name = [&(compression.len() as u32).to_le_bytes(), compression.as_bytes()].concat();
                [&body[..28], &name, &(content.len() as u64).to_le_bytes(), &content].concat()
            }
            _ => body.to_vec(),
        };
        file.push(opcode);
        file.extend((body.len() as u64).to_le_bytes());
        file.extend(body);
    }
    [&file, &bytes[bytes.len() - 8..]].concat()
}

#[test]
fn lz4_is_read_and_another_compression_is_named() {
    let rows = [(1_000_000_000, r#"{"tt2": 300.0}"#), (2_000_000_000, r#"{"tt2": 301.0}"#)];
    let plain = foreign("/daq", &rows, &[]);
    let lz4 = packed(&plain, "lz4", |content| {
        let mut frames = lz4_flex::frame::FrameEncoder::new(Vec::new());
        std::io::Write::write_all(&mut frames, content).unwrap();
        frames.finish().unwrap()
    });
    let series = |bytes: &[u8]| {
        read_foreign(bytes, &map(", unit: K")).unwrap().recording.series[&Channel::T2].values.clone()
    };
    assert_eq!(series(&lz4), [300.0, 301.0]);
    assert_eq!(series(&lz4), series(&plain));
    let other = packed(&plain, "brotli", <[u8]>::to_vec);
    let error = read_foreign(&other, &map(", unit: K")).unwrap_err();
    assert!(matches!(error, RecordError::NothingReadable { .. }), "{error}");
    assert!(error.to_string().contains("brotli"), "{error}");
}

fn map(unit: &str) -> ChannelMap {
    let text = format!("channels:\n  T2: {{topic: /daq, field: tt2{unit}}}\nconstants: {{T_amb: 25 degC}}\n");
    ChannelMap::from_yaml(&text, Path::new("map.yaml")).unwrap()
}

fn read_foreign(bytes: &[u8], map: &ChannelMap) -> Result<ReadReport, RecordError> {
    read_recording_from(bytes, Path::new("test.mcap"), map, &ReadOptions::default())
}

#[test]
fn times_out_of_order_are_sorted_and_repeats_left_out() {
    let second = 1_000_000_000;
    let rows = [
        (7 * second, "{\"tt2\": 1}"),
        (9 * second, "{\"tt2\": 3}"),
        (8 * second, "{\"tt2\": NaN}"),
        (9 * second, "{\"tt2\": 4}"),
        (10 * second, "{\"tt2\": \"hot\"}"),
        (11 * second, "not json"),
    ];
    let report = read_foreign(&foreign("/daq", &rows, &[("tt2", "degC")]), &map("")).unwrap();
    let series = &report.recording.series[&Channel::T2];
    assert_eq!(series.t_s, [0.0, 1.0, 2.0, 3.0]);
    assert_eq!((series.values[0], series.values[2]), (274.15, 276.15));
    assert!(series.values[1].is_nan() && series.values[3].is_nan());
    let ambient = &report.recording.series[&Channel::TAmb];
    assert_eq!((&ambient.t_s[..], &ambient.values[..]), (&[0.0, 3.0][..], &[298.15, 298.15][..]));
    for expected in [
        ReadWarning::OutOfOrder { channels: vec![Channel::T2], reordered: 1, repeated: 1 },
        ReadWarning::NotANumber { channels: vec![Channel::T2], count: 1 },
        ReadWarning::DamagedMessages { topic: "/daq".to_owned(), count: 1 },
        ReadWarning::NoCommands,
    ] {
        assert!(report.warnings.contains(&expected), "{expected} in {:?}", report.warnings);
    }
}

#[test]
fn a_single_wrong_time_is_left_out_and_reported() {
    let second = 1_000_000_000;
    let mut rows: Vec<(u64, &str)> =
        (0..100).map(|row| (1_795_356_185 * second + row * second, "{\"tt2\": 1}")).collect();
    // A clock that was not yet set, and one in another unit.
    rows.insert(3, (0, "{\"tt2\": 1}"));
    rows.push((9_000_000_000 * second, "{\"tt2\": 1}"));
    let report = read_foreign(&foreign("/daq", &rows, &[]), &map(", unit: degC")).unwrap();
    let t_s = &report.recording.series[&Channel::T2].t_s;
    assert_eq!((t_s.len(), t_s[0], t_s[99]), (100, 0.0, 99.0));
    let stray = |warning: &ReadWarning| matches!(warning, ReadWarning::StrayTimes { count: 2, .. });
    assert!(report.warnings.iter().any(stray), "{:?}", report.warnings);
}

#[test]
fn a_unit_comes_from_the_map_or_the_recording_and_never_from_a_guess() {
    let rows = [(0, "{\"tt2\": 1}")];
    let missing = read_foreign(&foreign("/daq", &rows, &[]), &map(""));
    assert!(matches!(missing, Err(RecordError::MissingUnit { .. })));
    let unknown = read_foreign(&foreign("/daq", &rows, &[("tt2", "kPa")]), &map(""));
    assert!(matches!(unknown, Err(RecordError::BadUnit { .. })));
    let contradicting = read_foreign(&foreign("/daq", &rows, &[("tt2", "K")]), &map(", unit: degC")).unwrap();
    assert_eq!(contradicting.recording.series[&Channel::T2].values, [274.15]);
    assert!(contradicting.warnings.iter().any(|w| matches!(w, ReadWarning::UnitContradiction { .. })));
    // Two spellings of one unit are not a contradiction.
    let agreeing = read_foreign(&foreign("/daq", &rows, &[("tt2", "C")]), &map(", unit: degC")).unwrap();
    assert!(!agreeing.warnings.iter().any(|w| matches!(w, ReadWarning::UnitContradiction { .. })));
}

#[test]
fn a_foreign_file_needs_a_map() {
    let error = read(&foreign("/daq", &[(0, "{\"tt2\": 1}")], &[])).unwrap_err();
    assert!(error.to_string().contains("/daq"), "{error}");
    // One command of the same name does not make it a recording of this program.
    let alike = foreign("/rig/command", &[(0, "{\"valve_opening\": 1}")], &[("valve_opening", "1")]);
    assert!(matches!(read(&alike), Err(RecordError::NothingMapped { .. })));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn no_flipped_bytes_panic(flips in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..8)) {
        static BYTES: std::sync::OnceLock<[Vec<u8>; 2]> = std::sync::OnceLock::new();
        let files = BYTES.get_or_init(|| {
            let rows: Vec<_> = (0..50).map(|i| (i * 1_000_000, "{\"tt2\": 1}")).collect();
            [recorded(&batch(50)), foreign("/daq", &rows, &[("tt2", "K")])]
        });
        for (bytes, map) in files.iter().zip([ChannelMap::native(), map("")]) {
            let mut bytes = bytes.clone();
            for (index, value) in &flips {
                let at = index.index(bytes.len());
                bytes[at] = *value;
            }
            drop(read_foreign(&bytes, &map));
        }
    }
}
