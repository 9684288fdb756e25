//! Measures how closely the speed loop follows its target at each step, on the virtual lab with sensor noise, over several seeds.
//!
//! ```text
//! cargo run --release --locked -p mapper-session --example speed_study
//! ```

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout, missing_docs)]

#[path = "../tests/common/mod.rs"]
mod common;

use common::shipped::campaign;
use common::{Driven, driven};

const SEEDS: u64 = 20;

fn main() {
    println!(
        "| machine | loop | end of step, % (median, worst) | from 10 s on, % (median, worst) | overshoot of a jump up, % (worst) | P3's scatter, Pa (median, worst) | not reached |"
    );
    println!("|---|---|---:|---:|---:|---:|---:|");
    let machines = [
        ("nominal", "virtual_lab: {}"),
        ("turbine 10 % worse", "virtual_lab: {effects: {turbine_efficiency: 0.9}}"),
        ("turbine 10 % better", "virtual_lab: {effects: {turbine_efficiency: 1.1}}"),
        ("tolerances drawn", "virtual_lab: {tolerances: drawn}"),
    ];
    for (name, lab) in machines {
        for control in ["{band: 0.3 %}", "off"] {
            let runs: Vec<Driven> = (1..=SEEDS).map(|seed| run(lab, control, seed)).collect();
            row(name, control, &runs);
        }
    }
}

fn run(lab: &str, control: &str, seed: u64) -> Driven {
    driven(&campaign(&[
        ("virtual_lab: {}", lab),
        ("seed: 1  ", &format!("speed_control: {control}\nseed: {seed}  ")),
        (
            "speeds: [50 krpm, 65 krpm, 80 krpm, 95 krpm, 110 krpm, 125 krpm, 140 krpm, 155 krpm]",
            "speeds: [50 krpm, 80 krpm, 110 krpm, 140 krpm, 155 krpm]",
        ),
        ("openings: [0.5, 0.7, 1.0, 1.4, 2.0, 2.5]", "openings: [0.5, 1.0, 2.0]"),
        ("zero: {soak: 30 min, nonuniformity: 0.01 K, pressure_nonuniformity: 1 Pa}\n", ""),
    ]))
}

fn row(name: &str, control: &str, runs: &[Driven]) {
    let steps = || runs.iter().flat_map(|run| &run.steps);
    let ends: Vec<f64> = steps().map(|step| step.end_off_ratio().abs()).collect();
    let windows: Vec<f64> =
        steps().map(|step| step.off_ratio(10.0, step.marker.end_s - step.marker.start_s).abs()).collect();
    let highest = steps().filter_map(|step| step.overshoot_ratio()).fold(f64::NEG_INFINITY, f64::max);
    let scatters: Vec<f64> = steps().map(|step| step.p3_scatter_pa()).collect();
    let not_reached = steps().filter(|step| step.not_reached).count();
    let both = |values: &[f64], scale: f64| {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        format!("{:.3}, {:.3}", scale * sorted[sorted.len() / 2], scale * sorted[sorted.len() - 1])
    };
    println!(
        "| {name} | {control} | {} | {} | {:+.2} | {} | {not_reached} of {} |",
        both(&ends, 100.0),
        both(&windows, 100.0),
        100.0 * highest,
        both(&scatters, 1.0),
        ends.len()
    );
}
