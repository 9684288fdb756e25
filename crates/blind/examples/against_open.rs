//! scratch
#![allow(clippy::print_stdout, clippy::unwrap_used, clippy::panic, missing_docs)]
use mapper_core::{Channel, Series};
use mapper_physics::effect::{self, Effect, Rig};
use mapper_physics::inputs::InterpolatedInputs;
use mapper_physics::instruments::{ChannelFollower, true_value};
use mapper_physics::model::Model;
use mapper_physics::params::BoundaryConditions;
use mapper_physics::simulate::{Simulator, Watch};
use mapper_physics::steady;
use mapper_record::{ChannelMap, ReadOptions, read_recording};
use std::path::Path;

fn mean(s: &Series, a: f64, b: f64) -> f64 {
    let (_, v) = s.slice(a, b);
    v.iter().sum::<f64>() / v.len() as f64
}

fn main() {
    let map_text = std::fs::read_to_string("examples/channels/gap_rig.yaml").unwrap();
    let map = ChannelMap::from_yaml(&map_text).unwrap();
    let cases: Vec<(&str, Vec<(&str, Vec<f64>)>)> = vec![
        ("open_none", vec![]),
        ("open_area_split", vec![("area_split", vec![0.12])]),
        ("open_tip_diameter", vec![("tip_diameter", vec![1.5e-3])]),
        ("open_directional_htc", vec![("directional_htc", vec![0.65])]),
        ("open_friction_and_valve", vec![("bearing_friction", vec![1.5e-6]), ("valve_area", vec![1.05])]),
        ("open_inner_node", vec![("inner_node", vec![0.35, 15.0])]),
        ("open_outside_catalogue", vec![]),
    ];
    for (name, effects) in cases {
        let rec = read_recording(
            Path::new(&format!("/work/shared/gap/open/{name}.mcap")),
            &map,
            &ReadOptions::default(),
        )
        .unwrap()
        .recording;
        let get = |c: Channel| rec.series.get(&c).unwrap();
        let end = *get(Channel::ShaftSpeed).t_s.last().unwrap();
        let changes: Vec<(f64, f64)> = {
            let s = get(Channel::P3Command);
            let mut out: Vec<(f64, f64)> = vec![(0.0, s.values[0])];
            for (t, v) in s.t_s.iter().zip(&s.values) {
                if (*v - out.last().unwrap().1).abs() > 1.0 {
                    out.push((*t, *v));
                }
            }
            out
        };
        if name == "open_none" {
            println!("changes {:?}", changes.iter().map(|c| (c.0, c.1.round())).collect::<Vec<_>>());
            // wander: 20 s means
            for c in [Channel::T1, Channel::P1, Channel::P4, Channel::T3, Channel::TOil] {
                let v: Vec<String> = (0..40)
                    .map(|i| format!("{:.2}", mean(get(c), f64::from(i) * 50.0, f64::from(i) * 50.0 + 50.0)))
                    .collect();
                println!("{c} {}", v.join(" "));
            }
            let v: Vec<String> = (0..36)
                .map(|i| {
                    let a = 30.0 + f64::from(i) * 60.0 + 10.0;
                    format!(
                        "{:.0}",
                        mean(get(Channel::P3), a, a + 50.0) - get(Channel::P3Command).held(a + 1.0).unwrap()
                    )
                })
                .collect();
            println!("P3-cmd {}", v.join(" "));
        }
        let rig0 = Rig::new(Model::nominal());
        let with: Vec<(std::sync::Arc<dyn Effect>, Vec<f64>)> =
            effects.iter().map(|(id, v)| (mapper_effects::find(id).unwrap(), v.clone())).collect();
        let rig1 = effect::compose(&rig0, with.iter().map(|(e, v)| (e.as_ref(), v.as_slice()))).unwrap();
        for (label, rig) in [("nominal", &rig0), ("effect ", &rig1)] {
            // P3 lag
            let mut times = vec![];
            let mut t = 0.0;
            while t < end {
                times.push(t);
                let since = changes.iter().filter(|c| c.0 <= t + 1e-9).next_back().unwrap().0;
                let next = changes.iter().find(|c| c.0 > t + 1e-9).map_or(f64::INFINITY, |c| c.0);
                let dt = if t - since < 3.0 && since > 0.0 { 0.1 } else { 2.0 };
                t = (t + dt).min(next);
            }
            times.push(end);
            let mut p3 = changes[0].1;
            let mut last = 0.0;
            let mut rows = vec![];
            for &t in &times {
                let cmd = |t: f64| changes.iter().filter(|c| c.0 <= t + 1e-9).next_back().unwrap().1;
                let target = cmd((t - 1e-6).max(0.0));
                p3 = target + (p3 - target) * (-(t - last) / 0.3f64).exp();
                last = t;
                let sm = |c: Channel| mean(get(c), (t - 5.0).max(0.0), (t + 5.0).min(end));
                rows.push(BoundaryConditions {
                    t1_k: sm(Channel::T1),
                    p1_pa: sm(Channel::P1),
                    p3_pa: p3,
                    t3_k: sm(Channel::T3),
                    p4_pa: sm(Channel::P4),
                    oil_temperature_k: sm(Channel::TOil),
                    ambient_temperature_k: 298.15,
                    valve_opening_ratio: get(Channel::ValveCommand).held(t + 1e-6).unwrap(),
                });
            }
            let start = steady::settle_under(&rig.model, &rows[0]).unwrap();
            let inputs = InterpolatedInputs::new(times, rows).unwrap();
            let mut sim = Simulator::new(&rig.model, 0.0, start.state, 1e-6, Watch::default());
            let channels = [
                Channel::ShaftSpeed,
                Channel::CompressorFlow,
                Channel::P2,
                Channel::T2,
                Channel::Tc,
                Channel::TurbineFlow,
                Channel::T4,
                Channel::Tt,
            ];
            let mut followers: Vec<ChannelFollower> =
                channels.iter().map(|c| ChannelFollower::new(*rig.instruments.path(*c))).collect();
            let samples: Vec<f64> = (0..=(end * 10.0) as usize).map(|i| i as f64 * 0.1).collect();
            let mut res: Vec<Vec<(f64, f64)>> = vec![vec![]; channels.len()];
            sim.run_to(
                end,
                &inputs,
                samples,
                |t, s, o| {
                    use mapper_physics::inputs::Inputs;
                    let b = inputs.at(t);
                    let p = rig.model.prepare(&b);
                    for (i, c) in channels.iter().enumerate() {
                        let y = followers[i].read(t, true_value(*c, &p, s, o).unwrap());
                        if let Some(m) = get(*c).interpolate(t) {
                            res[i].push((t, m - y));
                        }
                    }
                },
                |_| {},
            )
            .unwrap();
            // residual of 10 s means: (mean, rms around mean)
            let line: Vec<String> = channels
                .iter()
                .zip(&res)
                .map(|(c, r)| {
                    let mut blocks = vec![];
                    for k in 0..(end / 10.0) as usize {
                        let b: Vec<f64> =
                            r.iter().filter(|(t, _)| (*t / 10.0) as usize == k).map(|x| x.1).collect();
                        blocks.push(b.iter().sum::<f64>() / b.len() as f64);
                    }
                    let m = blocks.iter().sum::<f64>() / blocks.len() as f64;
                    let rms =
                        (blocks.iter().map(|b| (b - m) * (b - m)).sum::<f64>() / blocks.len() as f64).sqrt();
                    let scale = match c.unit() {
                        "kg/s" => 1e3,
                        _ => 1.0,
                    };
                    format!("{c} {:+.3}±{:.3}", m * scale, rms * scale)
                })
                .collect();
            println!("{name} {label} {}", line.join("  "));
        }
    }
}
