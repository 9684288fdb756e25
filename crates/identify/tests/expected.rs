//! The expected result of a forecast agrees with the scatter of recordings.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common::{RIG, Transient, add_noise};
use mapper_core::Channel;
use mapper_identify::{DeclaredUncertainty, IdentifyConfig, WindowRule, expected, identify};
use mapper_physics::operating_point::forecast::ForecastRow;
use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;

const SEEDS: u64 = 200;

fn config(with_offsets: bool) -> IdentifyConfig {
    let window = WindowRule::Fixed { start_s: 10.0, end_s: 110.0 };
    let mut config = IdentifyConfig { window, ..IdentifyConfig::default() };
    for (channel, noise_sigma, offset) in RIG {
        let offset_sigma = if with_offsets { offset } else { 0.0 };
        let declared = DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio: 0.0 };
        config.declared.insert(channel, declared);
    }
    config
}

/// Noise-free rows of the window, `every` tenths of a second apart.
fn rows(transient: &Transient, every: usize) -> Vec<ForecastRow> {
    let recording = transient.recording();
    let at = |channel, i: usize| recording.series[&channel].values[i];
    // The jump is at 30 s.
    (400..=1400)
        .step_by(every)
        .map(|i| ForecastRow {
            t_s: 0.1 * i as f64,
            speed_rpm: at(Channel::ShaftSpeed, i),
            t1_k: at(Channel::T1, i),
            t2_k: at(Channel::T2, i),
            tc_k: at(Channel::Tc, i),
            p1_pa: at(Channel::P1, i),
            p2_pa: at(Channel::P2, i),
            flow_kg_s: at(Channel::CompressorFlow, i),
            efficiency: transient.eta,
            h_w_m2k: transient.h_w_m2k,
        })
        .collect()
}

/// 200 seeds determine a standard deviation to 5 %.
#[test]
fn two_hundred_seeds_scatter_as_expected() {
    let transient = Transient::default();
    for with_offsets in [false, true] {
        let config = config(with_offsets);
        let (mut eta, mut h) = (0.0, 0.0);
        for seed in 0..SEEDS {
            let mut rng = Pcg64::seed_from_u64(seed);
            let mut recording = transient.recording();
            for (channel, noise, offset) in RIG {
                let series = recording.series.get_mut(&channel).unwrap();
                add_noise(series, noise, &mut rng);
                let shift: f64 = StandardNormal.sample(&mut rng);
                if with_offsets {
                    series.values.iter_mut().for_each(|value| *value += shift * offset);
                }
            }
            let point = identify(&recording, &config).unwrap().swap_remove(1);
            eta += (point.eta.unwrap() - transient.eta).powi(2);
            h += (point.h_w_m2k.unwrap() - transient.h_w_m2k).powi(2);
        }
        let expected = expected(&rows(&transient, 5), 0.5, &config).unwrap();
        let [eta, h] = [eta, h].map(|sum| (sum / SEEDS as f64).sqrt());
        assert!((expected.sigma_eta / eta - 1.0).abs() < 0.2, "{} {eta}", expected.sigma_eta);
        assert!((expected.sigma_h_w_m2k / h - 1.0).abs() < 0.2, "{} {h}", expected.sigma_h_w_m2k);
    }
}

/// Rows five times sparser represent means: the result stays the same.
#[test]
fn the_interval_of_the_rows_matters_little() {
    let transient = Transient::default();
    let [dense, sparse] =
        [(1, 0.1), (5, 0.5)].map(|(every, s)| expected(&rows(&transient, every), s, &config(true)).unwrap());
    // Noise-free: the truth, to the fit's own tolerance.
    assert!((dense.eta - transient.eta).abs() < 1e-6 && (sparse.eta - transient.eta).abs() < 1e-6);
    // Sums over 1001 rows and over 201 differ by their ends.
    assert!((sparse.sigma_eta / dense.sigma_eta - 1.0).abs() < 0.03);
}
