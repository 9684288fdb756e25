use mapper_gap::{declared::*, fit::*, study::*, table::Table, whiten::*};
use mapper_record::*;
use std::time::Instant;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let map = ChannelMap::from_yaml(&std::fs::read_to_string("examples/channels/gap_rig.yaml").unwrap()).unwrap();
    for f in &a[1..] {
        let t = Instant::now();
        let r = read_recording(std::path::Path::new(f), &map, &ReadOptions::default()).unwrap();
        println!("{f} read {:?} {:?}", t.elapsed(), r.warnings);
        let declared = Declared { sensors: map.sensors.clone(), noise_colour: map.noise_colour.unwrap(), tolerances: ModelTolerances::default(), nominal: Default::default() };
        let t = Instant::now();
        let table = Table::new(&r.recording).unwrap();
        let study = Study::new(&r.recording, table, declared, mapper_physics::model::Model::nominal(), mapper_effects::catalogue()).unwrap();
        println!("study {:?} steps {} rows {} lag {:?} noise {:?}", t.elapsed(), study.steps.len(), study.measured.len(), study.measured_lag_s, study.inputs.noise());
        let t = Instant::now();
        let p = study.predict(&study.nothing()).unwrap();
        println!("predict {:?} {}", t.elapsed(), p.values.len());
        let t = Instant::now();
        let lin = Linearised::new(&study).unwrap();
        println!("lin {:?}", t.elapsed());
        let t = Instant::now();
        let null = fit(&study, &lin, &study.nothing(), &Selection::all(&study), Effort::default()).unwrap();
        println!("null {:?} cost {:.0} n {} score {:.1}", t.elapsed(), null.cost, study.measured.len(), null.score);
        for o in 0..9 {
            let mut s = String::new();
            for st in 0..study.steps.len() {
                for g in study.groups.iter().filter(|g| g.output == o && g.step == st) {
                    let c: f64 = null.residual[g.rows.clone()].iter().map(|x| x * x).sum();
                    s += &format!("{:5.0}", c);
                }
            }
            println!("{:8} {s}  /{}", mapper_gap::nuisance::OUTPUTS[o].symbol(), study.groups[o].rows.len());
        }
        let stem = std::path::Path::new(f).file_stem().unwrap().to_string_lossy().into_owned();
        let truth: Vec<(&str, Vec<f64>)> = match stem.as_str() {
            "open_area_split" => vec![("area_split", vec![0.12])],
            "open_directional_htc" => vec![("directional_htc", vec![0.65])],
            "open_friction_and_valve" => vec![("bearing_friction", vec![1.5e-6]), ("valve_area", vec![1.05])],
            "open_inner_node" => vec![("inner_node", vec![0.35, 15.0])],
            "open_tip_diameter" => vec![("tip_diameter", vec![0.0015])],
            _ => vec![],
        };
        let mut start = study.nothing();
        start.effects = truth.iter().map(|(id, v)| (study.effects.iter().position(|e| e.info().id == *id).unwrap(), v.clone())).collect();
        let t = Instant::now();
        let null = fit(&study, &lin, &start, &Selection::all(&study), Effort::default()).unwrap();
        println!("truth {:?} cost {:.0} score {:.1} {:?} cov {:?}", t.elapsed(), null.cost, null.score, null.hypothesis.effects, null.covariance.diagonal().map(|x| x.sqrt()));
        for o in 0..9 {
            let mut s = String::new();
            for st in 0..study.steps.len() {
                for g in study.groups.iter().filter(|g| g.output == o && g.step == st) {
                    let c: f64 = null.residual[g.rows.clone()].iter().map(|x| x * x).sum();
                    s += &format!("{:5.0}", c);
                }
            }
            println!("{:8} {s}", mapper_gap::nuisance::OUTPUTS[o].symbol());
        }
        let t = Instant::now();
        let lin2 = lin.at(&study, &null.hypothesis).unwrap();
        println!("relin {:?}", t.elapsed());
        let t = Instant::now();
        let null = fit(&study, &lin2, &null.hypothesis, &Selection::all(&study), Effort::default()).unwrap();
        println!("refit {:?} cost {:.0} score {:.1} {:?} cov {:?}", t.elapsed(), null.cost, null.score, null.hypothesis.effects, null.covariance.diagonal().map(|x| x.sqrt()));
        let mut big: Vec<_> = study.nuisances.iter().zip(&null.hypothesis.nuisances).map(|(n, u)| (format!("{:?}", n.kind), *u)).collect();
        big.sort_by(|a, b| b.1.abs().total_cmp(&a.1.abs()));
        println!("{}", big.iter().take(14).map(|(a, b)| format!("{a} {b:.2}")).collect::<Vec<_>>().join(", "));
    }
}
