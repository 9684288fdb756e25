//! Diagnoses recordings and writes NAME.diagnosis.json into a directory: `diagnose_files OUT FILE...`.
use mapper_gap::calibration::Calibration;
use mapper_gap::{declared::*, diagnose::*};
use mapper_record::*;
use std::time::Instant;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let gap_map = ChannelMap::from_yaml(&std::fs::read_to_string("examples/channels/gap_rig.yaml").unwrap()).unwrap();
    let native = std::env::var("NATIVE").is_ok();
    let map = if native { ChannelMap::native() } else { gap_map.clone() };
    for f in &a[2..] {
        let t0 = Instant::now();
        let path = std::path::Path::new(f);
        let r = read_recording(path, &map, &ReadOptions::default()).unwrap();
        let declared = Declared { sensors: gap_map.sensors.clone(), noise_colour: gap_map.noise_colour.unwrap(), tolerances: Default::default(), nominal: Default::default() };
        let done = diagnose(Question { recording: &r.recording, declared, model: mapper_physics::model::Model::nominal(), effects: mapper_effects::catalogue(), calibration: Calibration::shipped().unwrap(), progress: &|_, _| {} });
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        match done {
            Err(e) => println!("{name}: {e}"),
            Ok(d) => {
                std::fs::write(format!("{}/{name}.diagnosis.json", a[1]), serde_json::to_string_pretty(&d.diagnosis).unwrap()).unwrap();
                println!("{name} {:.1}s {:?} p0 {:.3} pout {:.3} {:?}", t0.elapsed().as_secs_f64(), d.diagnosis.verdict, d.diagnosis.probability_none, d.diagnosis.probability_outside, d.adequacy);
                let mut best: [f64; 3] = [d.null.score, f64::NEG_INFINITY, f64::NEG_INFINITY];
                for f in &d.fits { let k = f.hypothesis.effects.len().min(2); best[k] = best[k].max(f.score); }
                println!("STAT {name} n {} null {:.2} single {:.2} pair {:.2} nullcost {:.1} bestcost {:.1} smooth {:.3} scatter {:.3} more {:.3} ms {:.4} seconds {:.1}", d.null.residual.len(), best[0], best[1], best[2], d.null.cost, d.fits.first().map_or(0.0, |f| f.cost), d.adequacy.smooth_sigma, d.adequacy.scatter_sigma, d.adequacy.one_more, d.adequacy.mean_square, t0.elapsed().as_secs_f64());
                println!("   null {:.1} {:.0}  shrink {:.3} [{:.3},{:.3}]", d.null.score, d.null.cost, d.diagnosis.gap.shrink, d.diagnosis.gap.shrink_low, d.diagnosis.gap.shrink_high);
                for (c, f) in d.diagnosis.candidates.iter().zip(&d.fits).take(4) {
                    println!("   {:?} {:.3} s {:.1} cost {:.0} {:?} eq {:?}", c.effects, c.probability, f.score, f.cost, c.parameters.values().map(|e| format!("{:.5} [{:.5},{:.5}]", e.value, e.low, e.high)).collect::<Vec<_>>(), c.equivalent);
                }
                println!("   where {:?} next {:?}", d.diagnosis.r#where.iter().take(3).map(|w| format!("{} {} {} {} {:.2} {:.1} {:.3}", w.submodel, w.channel, w.phase, w.region, w.share, w.sigma, w.size)).collect::<Vec<_>>(), d.diagnosis.next);
            }
        }
    }
}
