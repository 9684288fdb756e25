//! Prints how long it takes to write and read a run of 48 000 samples, all channels and 12 columns of truth:
//! `cargo run --release -p mapper-recording --example recording_speed -- FILE`. The file is not removed.
#![allow(clippy::print_stdout)]

use mapper_core::{CHANNELS, ChannelColumn, SampleBatch, TruthColumn};
use mapper_recording::{ChannelMap, ReadOptions, RecordingHeader, RecordingWriter, read_recording};
use std::time::Instant;

const SAMPLES: usize = 48_000;
const BATCH: usize = 10;

/// A deterministic value with as many digits as a noisy sensor's.
fn noisy(index: usize, column: usize) -> f64 {
    let x = (index as f64 * 0.618_033_988 + column as f64 * 0.414_213_562).fract();
    300.0 + 10.0 * (index as f64 * 1e-3).sin() + x
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("name a file to write")?;
    let path = std::path::Path::new(&path);
    let batches: Vec<SampleBatch> = (0..SAMPLES / BATCH)
        .map(|batch| {
            let rows = batch * BATCH..(batch + 1) * BATCH;
            let column = |c: usize| rows.clone().map(|i| noisy(i, c)).collect::<Vec<f64>>();
            SampleBatch {
                first_sequence: rows.start as u64,
                t_s: rows.clone().map(|i| i as f64 / 10.0).collect(),
                columns: (0..CHANNELS.len())
                    .map(|c| ChannelColumn { channel: CHANNELS[c].channel, values: column(c) })
                    .collect(),
                elements: Vec::new(),
                provenance: Vec::new(),
                truth: (0..12)
                    .map(|c| TruthColumn {
                        name: format!("state_{c}_k"),
                        unit: "K".to_owned(),
                        values: column(c + 50),
                    })
                    .collect(),
                events: Vec::new(),
            }
        })
        .collect();

    let started = Instant::now();
    let mut writer = RecordingWriter::create(path, &RecordingHeader::default())?;
    for batch in &batches {
        writer.write_batch(batch)?;
    }
    writer.finish()?;
    println!("write {:.0} ms, {} bytes", started.elapsed().as_secs_f64() * 1e3, path.metadata()?.len());

    let started = Instant::now();
    let report = read_recording(path, &ChannelMap::native(), &ReadOptions::default())?;
    println!(
        "read {:.0} ms, {} series",
        started.elapsed().as_secs_f64() * 1e3,
        report.recording.series.len()
    );
    Ok(())
}
