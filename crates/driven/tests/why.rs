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

fn diagnosis(recording: &Recording, side: Which, fit_until_s: f64) -> Diagnosis {
    let ask = Ask {
        recording,
        nominal: &Rig::new(Model::nominal()),
        effects: &catalogue(),
        declared: &declared(),
        calibration: &Calibration::shipped().unwrap(),
        fit_until_s,
        seed: 1,
    };
    diagnose(&ask, side).unwrap()
}


#[test]
fn turbine_look() {
    for (id, value) in [("", 0.0), ("t4_lag", 1.5), ("t3_lag", 1.5), ("t4_offset", 30.0), ("t3_offset", 30.0), ("turbine_flow_gain", 1.2), ("turbine_flow_lag", 1.5)] {
        for course in ["brake", "hills"] {
            for tt in [true, false] {
                for seed in 0..3 {
                    let c = if course == "brake" { Course::brake() } else { Course::hills() };
                    let what: Vec<(&str, f64)> = if id.is_empty() { vec![] } else { vec![(id, value)] };
                    let (mut recording, _) = engine(seed, &c, &what, healthy);
                    if !tt { recording.series.remove(&Channel::Tt); }
                    let t = std::time::Instant::now();
                    let d = diagnosis(&recording, Which::Turbine, f64::INFINITY);
                    let top: Vec<String> = d.causes.iter().take(3).map(|c| format!("{} {:.2} {:?} left {:.2}", c.effects.join("+"), c.probability, c.parameters.values().map(|e| e.size.clone()).collect::<Vec<_>>(), c.left_k[0])).collect();
                    println!("{course} tt={tt} {id} {value} s{seed} [{:.1}s]: {:?} none {:.2} out {:.2} before {:.2} after {:.2} | {:?} | {}", t.elapsed().as_secs_f64(), d.word, d.probability_none, d.probability_outside, d.before_k, d.after_k,
                        d.held_out.as_ref().map(|h| (h.phases.len(), (h.before_k*100.0).round()/100.0, (h.after_k*100.0).round()/100.0, (h.shrink_low_k*100.0).round()/100.0)), top.join("; "));
                    if seed == 0 && id.is_empty() {
                        for a in &d.asked { println!("   seen {} {:?}", a.effect, a.size); }
                        for a in &d.not_asked { println!("   not {}: {}", a.effect, a.reason); }
                        for u in &d.unknowns { println!("   unk {} {:.3} {:.3} {:.3} {}", u.name, u.value, u.low, u.high, u.told); }
                    }
                }
            }
        }
    }
}
