//! Study.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]
#[path = "../tests/common/mod.rs"]
mod common;
#[path = "../tests/common/lab.rs"]
mod lab;

use lab::{Machine, campaign, eighteen, measured};
use mapper_core::Method;
use mapper_identify::{IdentifyConfig, WindowRule, identify_recording};
use rand::SeedableRng;
use rand_pcg::Pcg64;

fn main() {
    let arg = |i: usize, d: f64| std::env::args().nth(i).and_then(|a| a.parse().ok()).unwrap_or(d);
    let machine = Machine { alpha: arg(1, 0.0), probe_m: arg(2, 0.0) * 1e-3, direction: arg(3, 1.0) };
    let (noise, offset, seeds) = (arg(4, 0.0), arg(5, 0.0), arg(6, 1.0) as u64);
    let clean = campaign(&eighteen(), 120.0, machine);
    for seed in 0..seeds {
        let mut rng = Pcg64::seed_from_u64(seed);
        let (recording, declared) = measured(&clean.recording, noise, offset, &mut rng);
        let mut config = IdentifyConfig {
            method: Method::Joint,
            window: WindowRule::Fixed { start_s: arg(7, 10.0), end_s: arg(8, 110.0) },
            ..IdentifyConfig::default()
        };
        if noise + offset > 0.0 {
            config.declared = declared;
        }
        if std::env::var("DECLARE").is_ok() {
            config.declared = measured(&clean.recording, 1.0, 1.0, &mut rng).1;
        }
        if std::env::var("SIMPLE").is_ok() {
            config.joint.probe = mapper_identify::Choice::Fixed;
            config.joint.direction = mapper_identify::Choice::Fixed;
            config.joint.alpha_area = mapper_identify::Choice::Fixed;
        }
        let found = identify_recording(&recording, &config).unwrap();
        let dynamic =
            identify_recording(&recording, &IdentifyConfig { method: Method::Dynamic, ..config.clone() })
                .unwrap();
        let (mut rms, mut rmsd, mut held, mut n) = (0.0, 0.0, 0.0, 0.0);
        for ((p, d), t) in found.points.iter().zip(&dynamic.points).zip(&clean.truth) {
            let (p, d) = (p.as_ref().unwrap(), d.as_ref().unwrap());
            if let Some(eta) = p.eta {
                let u = p.eta_uncertainty.unwrap_or_default();
                if seeds < 4 {
                    println!(
                        "{:3} v{} {:6.0} rpm eta {:.5} err {:+.3} pts (noise {:.3} bias {:.3}) dyn {:+.3}  h {:+.2} % (se {:.2} %)",
                        p.step,
                        p.valve_opening_ratio,
                        p.speed_rpm,
                        eta,
                        100.0 * (eta - t.eta),
                        100.0 * u.noise_standard_error,
                        100.0 * u.bias_standard_error,
                        100.0 * (d.eta.unwrap_or(f64::NAN) - t.eta),
                        100.0 * (p.h_w_m2k.unwrap() / t.h_w_m2k - 1.0),
                        100.0 * p.h_uncertainty.unwrap_or_default().combined_standard_error() / t.h_w_m2k
                    );
                }
                if let Some(de) = d.eta {
                    rms += (eta - t.eta).powi(2);
                    rmsd += (de - t.eta).powi(2);
                    n += 1.0;
                    held += f64::from(u8::from(((eta - t.eta) / u.combined_standard_error()).abs() < 1.96));
                }
            }
        }
        println!(
            "seed {seed}: rms joint {:.3} dyn {:.3} points, held {:.2}",
            100.0 * f64::sqrt(rms / n),
            100.0 * f64::sqrt(rmsd / n),
            held / n
        );
        if let Some(t) = &found.thermal {
            let show = |v: &mapper_core::SharedValue| {
                format!("{:?}±{:.5}", v.value, v.uncertainty.combined_standard_error())
            };
            println!(
                "[] law {:?} alpha {} probe {} f {} doubts {:?} offsets {:.3?}",
                t.convection.map(|c| (
                    c.exponent.value,
                    c.exponent.uncertainty.combined_standard_error(),
                    c.deviation_ratio
                )),
                show(&t.alpha_area_ratio),
                show(&t.probe_diameter_m),
                show(&t.direction_factor),
                t.doubts,
                t.offsets.values().map(|v| v.value.unwrap_or(0.0)).collect::<Vec<_>>()
            );
        }
    }
}
