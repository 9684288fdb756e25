//! Prints the contents of a recording: `cargo run -p mapper-recording --example recording_summary -- FILE [MAP.yaml]`.
#![allow(clippy::print_stdout)]

use mapper_recording::{ChannelMap, ReadOptions, read_recording};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().ok_or("name a recording")?;
    let map = match arguments.next() {
        Some(map) => ChannelMap::load(map.as_ref())?,
        None => ChannelMap::native(),
    };
    let report = read_recording(path.as_ref(), &map, &ReadOptions::default())?;
    for (channel, series) in &report.recording.series {
        let low = series.values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = series.values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        println!("{channel}: {} samples, {low} to {high} {}", series.t_s.len(), channel.unit());
    }
    for step in &report.recording.steps {
        println!(
            "step {}: {} to {} s, P3 {} Pa, valve {}",
            mapper_core::step_number(step.index),
            step.start_s,
            step.end_s,
            step.p3_pa,
            step.valve_opening_ratio
        );
    }
    for event in &report.recording.events {
        println!("event at {} s: {}", event.t_s, event.message);
    }
    for warning in &report.warnings {
        println!("warning: {warning}");
    }
    println!("format {:?}, metadata {:?}", report.format, report.metadata);
    Ok(())
}
