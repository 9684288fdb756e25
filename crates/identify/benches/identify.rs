//! One step of 1000 samples, complete: window, fit, uncertainty, warnings.
#![allow(clippy::unwrap_used, missing_docs)]

#[path = "../tests/common/mod.rs"]
mod common;

use common::{RIG, Transient, add_noise};
use divan::Bencher;
use mapper_core::{Method, Recording};
use mapper_identify::{DeclaredUncertainty, IdentifyConfig, WindowRule, identify};
use rand::SeedableRng;
use rand_pcg::Pcg64;

fn main() {
    divan::main();
}

/// A noisy step with a window of 1000 samples, all sensors declared.
fn step(window: WindowRule) -> (Recording, IdentifyConfig) {
    let mut recording = Transient::default().recording();
    let mut rng = Pcg64::seed_from_u64(1);
    let mut config = IdentifyConfig { window, ..IdentifyConfig::default() };
    for (channel, noise_sigma, offset_sigma) in RIG {
        add_noise(recording.series.get_mut(&channel).unwrap(), noise_sigma, &mut rng);
        let declared = DeclaredUncertainty { noise_sigma, offset_sigma, gain_sigma_ratio: 0.0 };
        config.declared.insert(channel, declared);
    }
    (recording, config)
}

#[divan::bench]
fn dynamic_1000_samples_fixed_window(bencher: Bencher<'_, '_>) {
    let (recording, config) = step(WindowRule::Fixed { start_s: 10.0, end_s: 109.95 });
    bencher.bench(|| identify(&recording, &config));
}

#[divan::bench]
fn dynamic_window_from_stabilisation(bencher: Bencher<'_, '_>) {
    let (recording, config) = step(WindowRule::default());
    bencher.bench(|| identify(&recording, &config));
}

#[divan::bench]
fn steady(bencher: Bencher<'_, '_>) {
    let (recording, mut config) = step(WindowRule::default());
    config.method = Method::Steady;
    bencher.bench(|| identify(&recording, &config));
}
