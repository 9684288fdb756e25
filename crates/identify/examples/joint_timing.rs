//! Time of a joint fit of 30 points at 10 Hz on one core, the identification alone:
//! `cargo run --release -p mapper-identify --example joint_timing -- ROUNDS DIRECTORY`
//! With a directory it writes the samples (`samples.csv`) and the results (`found.csv`, `points.csv`) there for
//! `benches/peers/joint_scipy.py`.
#![allow(clippy::print_stdout, missing_docs, reason = "what it prints is all it is for")]
#[path = "../tests/common/mod.rs"]
#[allow(clippy::unwrap_used, reason = "shared with the tests")]
mod common;
#[path = "../tests/common/lab.rs"]
#[allow(clippy::unwrap_used, reason = "shared with the tests")]
mod lab;

use lab::{Machine, campaign, measured};
use mapper_core::{Channel, Method};
use mapper_identify::{IdentifyConfig, identify_recording, one_fit};
use mapper_numerics::statistics::median;
use rand::SeedableRng;
use rand_pcg::Pcg64;
use std::fmt::Write;
use std::time::Instant;

/// Five valve openings, at each six speeds in zigzag.
fn thirty() -> Vec<(f64, f64)> {
    let speeds = [90e3, 150e3, 50e3, 130e3, 70e3, 110e3];
    [0.5, 0.6, 0.7, 0.85, 1.0].into_iter().flat_map(|valve| speeds.map(|speed| (valve, speed))).collect()
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let rounds: usize = std::env::args().nth(1).and_then(|text| text.parse().ok()).unwrap_or(5).max(1);
    let machine = Machine { alpha: 0.2, probe_m: 1.5e-3, ..Machine::default() };
    let clean = campaign(&thirty(), 120.0, machine);
    let (recording, declared) = measured(&clean.recording, 1.0, 0.0, &mut Pcg64::seed_from_u64(1));
    let config = IdentifyConfig { method: Method::Joint, declared, ..IdentifyConfig::default() };
    let samples = recording.series[&Channel::T2].t_s.len();
    let mut times_s = Vec::new();
    let timed = || {
        let start = Instant::now();
        let found = identify_recording(&recording, &config);
        (found, start.elapsed().as_secs_f64())
    };
    for _ in 1..rounds {
        times_s.push(timed().1);
    }
    let (found, last_s) = timed();
    times_s.push(last_s);
    let found = found?;
    let mut fit_s = Vec::new();
    let alone = one_fit(&recording, &config, |fit| {
        let mut timed = || {
            let start = Instant::now();
            let found = fit();
            fit_s.push(start.elapsed().as_secs_f64());
            found
        };
        for _ in 1..rounds {
            timed();
        }
        timed()
    })
    .flatten()
    .ok_or("one fit did not converge")?;
    fit_s.sort_by(f64::total_cmp);
    times_s.sort_by(f64::total_cmp);
    let median_s = median(&times_s).ok_or("nothing was timed")?;
    println!(
        "{} points, {samples} samples: fastest {:.3} s, median {:.3} s of {rounds}",
        found.points.len(),
        times_s[0],
        median_s
    );
    println!("one fit of it: fastest {:.3} s, alpha_A {:.4}", fit_s[0], alone.alpha_area_ratio);
    let thermal = found.thermal.ok_or("the points share nothing")?;
    let value = |shared: &mapper_core::SharedValue| shared.value.unwrap_or(f64::NAN);
    let (alpha, probe_m) = (value(&thermal.alpha_area_ratio), value(&thermal.probe_diameter_m));
    let etas: Option<Vec<f64>> = found.points.iter().map(|point| point.as_ref().ok()?.eta).collect();
    let etas = etas.ok_or("a point has no efficiency")?;
    let square: f64 =
        etas.iter().zip(&clean.truth).map(|(eta, truth)| (eta - truth.eta).powi(2)).sum::<f64>();
    println!(
        "alpha_A {alpha:.4}, probe {:.3} mm, eta off by {:.3} points rms",
        1e3 * probe_m,
        100.0 * (square / etas.len() as f64).sqrt()
    );
    let Some(directory) = std::env::args().nth(2) else { return Ok(()) };
    let directory = std::path::Path::new(&directory);
    let mut text = "step,t_s,speed_rpm,flow_kg_s,p1_pa,t1_k,p2_pa,t2_k,tc_k\n".to_owned();
    let channels = [
        Channel::ShaftSpeed,
        Channel::CompressorFlow,
        Channel::P1,
        Channel::T1,
        Channel::P2,
        Channel::T2,
        Channel::Tc,
    ];
    for step in &recording.steps {
        let t_s = &recording.series[&Channel::T2].t_s;
        let from = t_s.partition_point(|t| *t < step.start_s);
        let to = t_s.partition_point(|t| *t < step.end_s);
        for (i, t_s) in t_s.iter().enumerate().take(to).skip(from) {
            write!(text, "{},{}", mapper_core::step_number(step.index), t_s - step.start_s)?;
            for channel in channels {
                write!(text, ",{}", recording.series[&channel].values[i])?;
            }
            text.push('\n');
        }
    }
    std::fs::write(directory.join("samples.csv"), text)?;
    let found = format!(
        "alpha_area_ratio,probe_diameter_m,fastest_s,median_s,fit_s,fit_alpha_area_ratio,fit_probe_diameter_m\n{alpha},{probe_m},{},{},{},{},{}\n",
        times_s[0], median_s, fit_s[0], alone.alpha_area_ratio, alone.probe_diameter_m
    );
    std::fs::write(directory.join("found.csv"), found)?;
    let mut points = "eta,truth_eta,fit_eta\n".to_owned();
    for ((eta, truth), fit_eta) in etas.iter().zip(&clean.truth).zip(&alone.etas) {
        writeln!(points, "{eta},{},{fit_eta}", truth.eta)?;
    }
    std::fs::write(directory.join("points.csv"), points)?;
    Ok(())
}
