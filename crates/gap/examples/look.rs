use mapper_gap::{declared::*, fit::*, select::*, study::*, table::Table, whiten::*};
use mapper_record::*;
use std::time::Instant;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let map =
        ChannelMap::from_yaml(&std::fs::read_to_string("examples/channels/gap_rig.yaml").unwrap()).unwrap();
    for f in &a[1..] {
        let t0 = Instant::now();
        let r = read_recording(std::path::Path::new(f), &map, &ReadOptions::default()).unwrap();
        let declared = Declared {
            sensors: map.sensors.clone(),
            noise_colour: map.noise_colour.unwrap(),
            tolerances: Default::default(),
            nominal: Default::default(),
        };
        let table = Table::new(&r.recording).unwrap();
        let study = Study::new(
            &r.recording,
            table,
            declared,
            mapper_physics::model::Model::nominal(),
            mapper_effects::catalogue(),
        )
        .unwrap();
        let lin = Linearised::new(&study).unwrap();
        let found = search(Search {
            study: &study,
            linearised: &lin,
            selection: &Selection::all(&study),
            progress: &|_, _| {},
        })
        .unwrap();
        println!(
            "{f} {:?} n {} null cost {:.0} score {:.1}",
            t0.elapsed(),
            study.measured.len(),
            found.null.cost,
            found.null.score
        );
        let id = |i: usize| study.effects[i].info().id.clone();
        for f in found.fits.iter().take(8) {
            println!(
                "   score {:.1} cost {:.0} {:?}",
                f.score,
                f.cost,
                f.hypothesis.effects.iter().map(|(i, v)| format!("{} {:?}", id(*i), v)).collect::<Vec<_>>()
            );
        }
        let lin2 = found.anew.as_ref().unwrap_or(&lin);
        let mut more: Vec<_> = additions(&study, lin2, &Selection::all(&study), &found.fits[0])
            .into_iter()
            .map(|a| (a.effect, a.gain))
            .collect();
        more.sort_by(|a, b| b.1.total_cmp(&a.1));
        println!(
            "   one more: {:?}",
            more.iter().take(4).map(|(i, g)| format!("{} {g:.1}", id(*i))).collect::<Vec<_>>()
        );
    }
}
