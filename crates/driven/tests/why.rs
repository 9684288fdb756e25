//! Causes planted in simulated engines, and what the diagnosis by measured neighbours says of them.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod common;

use common::{Course, declared, engine, healthy};
use mapper_core::{Channel, Recording};
use mapper_driven::why::{Ask, Diagnosis, Which, diagnose};
use mapper_effects::catalogue;
use mapper_gap::calibration::Calibration;
use mapper_physics::effect::Rig;
use mapper_physics::model::Model;

fn diagnosis(recording: &Recording, fit_until_s: f64) -> Diagnosis {
    let ask = Ask {
        recording,
        nominal: &Rig::new(Model::nominal()),
        effects: &catalogue(),
        declared: &declared(),
        calibration: &Calibration::shipped().unwrap(),
        fit_until_s,
        seed: 1,
    };
    diagnose(&ask, Which::Compressor).unwrap()
}

#[test]
fn look() {
    let planted: &[(&str, f64)] = &[
        ("", 0.0), ("tip_diameter", 2.5e-3), ("area_split", 0.3), ("t2_offset", 6.0), ("t1_offset", 5.0), ("flowmeter_gain", 1.15), ("flowmeter_lag", 2.0),
        ("stem_conduction", 0.2), ("recovery", 0.3), ("inlet_preheat", 4.0), ("recirculation", 0.08), ("tc_offset", 15.0), ("htc_scale", 2.5), ("p2_offset", 8000.0),
    ];
    let only = std::env::var("ONLY").unwrap_or_default();
    for course in ["brake", "hills"] {
        for tc in [true, false] {
            for (id, value) in planted {
                if !only.is_empty() && !format!("{course}/{tc}/{id}").contains(&only) { continue; }
                for seed in 0..3 {
                    let what: Vec<(&str, f64)> = if id.is_empty() { vec![] } else { vec![(*id, *value)] };
                    let c = if course == "brake" { Course::brake() } else { Course::hills() };
                    let (mut recording, _) = engine(seed, &c, &what, healthy);
                    if !only.is_empty() && only != format!("{course}/{tc}/{seed}") { continue; }
                if !tc { recording.series.remove(&Channel::Tc); }
                    let t = std::time::Instant::now();
                    let d = diagnosis(&recording, f64::INFINITY);
                    let top: Vec<String> = d.causes.iter().take(4).map(|c| format!("{} {:.2} {:?} left {:.2}", c.effects.join("+"), c.probability, c.parameters.values().map(|e| e.size.clone()).collect::<Vec<_>>(), c.left_k[0])).collect();
                    println!("{course} tc={tc} {id} {value} s{seed} [{:.1}s]: {:?} none {:.2} out {:.2} before {:.2} after {:.2} | {:?} | {}", t.elapsed().as_secs_f64(), d.word, d.probability_none, d.probability_outside, d.before_k, d.after_k,
                        d.held_out.as_ref().map(|h| (h.phases.len(), (h.before_k*100.0).round()/100.0, (h.after_k*100.0).round()/100.0, (h.shrink_low_k*100.0).round()/100.0)), top.join("; "));
                    if seed == 0 && id.is_empty() {
                        for a in &d.asked { println!("   seen {} {:?}", a.effect, a.size); }
                        for a in &d.not_asked { println!("   not {}: {}", a.effect, a.reason); }
                        for u in &d.unknowns { println!("   {} {:.3} {:.3} {:.3} {}", u.name, u.value, u.low, u.high, u.told); }
                    }
                }
            }
        }
    }
}
#[test]
fn nulls() {
    let only = std::env::var("ONLY").unwrap_or_default();
    for seed in 0..8 {
        for course in ["brake", "hills"] {
            let c = if course == "brake" { Course::brake() } else { Course::hills() };
            let (mut recording, truth) = engine(seed, &c, &[], healthy);
            for tc in [true, false] {
                if !only.is_empty() && only != format!("{course}/{tc}/{seed}") { continue; }
                if !tc { recording.series.remove(&Channel::Tc); }
                let t = std::time::Instant::now();
                let d = diagnosis(&recording, f64::INFINITY);
                let top: Vec<String> = d.causes.iter().take(3).map(|c| format!("{} {:.2} {:?} left {:.2}", c.effects.join("+"), c.probability, c.parameters.values().map(|e| e.size.clone()).collect::<Vec<_>>(), c.left_k[0])).collect();
                println!("{course} tc={tc} s{seed} [{:.1}s] eta {:.3} h {:.2} m {:.2}: {:?} none {:.2} out {:.2} before {:.2} after {:.2} | {:?} | {}", t.elapsed().as_secs_f64(), truth.compressor.efficiency_scale_ratio, truth.compressor.nusselt_coefficient/0.004, truth.compressor.housing_mass_kg/0.93, d.word, d.probability_none, d.probability_outside, d.before_k, d.after_k,
                        d.held_out.as_ref().map(|h| (h.phases.len(), (h.before_k*100.0).round()/100.0, (h.after_k*100.0).round()/100.0, (h.shrink_low_k*100.0).round()/100.0)), top.join("; "));
                println!("   null z {:?}", d.null_z.iter().map(|z| (z * 10.0).round() / 10.0).collect::<Vec<_>>());
            }
        }
    }
}
