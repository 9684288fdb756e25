//! No recording causes a panic, a NaN or a number without interval and verdict.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::common::Transient;
use mapper_core::{Channel, IdentifiedPoint, Method, Recording, Series, Verdict, Warning};
use mapper_identify::{
    DeclaredUncertainty, IdentifyConfig, PressureTap, SettleBands, WindowRule, identify, identify_each,
};
use proptest::prelude::*;

fn assert_sound(point: &IdentifiedPoint) {
    let always = [
        point.speed_rpm,
        point.flow_kg_s,
        point.flow_corrected_kg_s,
        point.speed_corrected_rpm,
        point.pressure_ratio,
        point.t1_k,
        point.p1_pa,
    ];
    let sometimes = [
        point.eta,
        point.eta_low,
        point.eta_high,
        point.h_w_m2k,
        point.h_low_w_m2k,
        point.h_high_w_m2k,
        point.residual_rms_k,
        point.dt2_k,
        point.dtc_k,
    ];
    assert!(always.iter().all(|value| value.is_finite()), "{point:?}");
    assert!(sometimes.iter().flatten().all(|value| value.is_finite()), "{point:?}");
    assert!(point.verdict == Verdict::Good || !point.warnings.is_empty());
    assert!(point.verdict != Verdict::Good || point.eta.is_some());
    assert!(point.eta.is_none() || point.eta_low.is_some());
}

fn values() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => 0.01..1e6f64,
        1 => prop_oneof![
            Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), Just(0.0), Just(-1.0), Just(1e300),
            Just(-1e300), Just(f64::MIN_POSITIVE),
        ],
    ]
}

const CHANNELS: [Channel; 9] = [
    Channel::ShaftSpeed,
    Channel::CompressorFlow,
    Channel::P1,
    Channel::T1,
    Channel::P2,
    Channel::T2,
    Channel::Tc,
    Channel::P3Command,
    Channel::ValveCommand,
];

/// Any values at rising times, separately for each channel.
fn series() -> impl Strategy<Value = Series> {
    prop::collection::vec((1e-3..5.0f64, values()), 0..60).prop_map(|pairs| {
        let mut t_s = 0.0;
        let mut series = Series::default();
        for (step_s, value) in pairs {
            t_s += step_s;
            series.t_s.push(t_s);
            series.values.push(value);
        }
        series
    })
}

fn any_config() -> impl Strategy<Value = IdentifyConfig> {
    let window = prop_oneof![
        Just(WindowRule::default()),
        Just(WindowRule::Fixed { start_s: 10.0, end_s: 110.0 }),
        Just(WindowRule::Fixed { start_s: 0.0, end_s: f64::INFINITY }),
    ];
    let bands = prop_oneof![
        Just(SettleBands::default()),
        Just(SettleBands { speed_ratio: 0.0, flow_ratio: f64::INFINITY, pressure_ratio_ratio: 0.0 }),
    ];
    let switches = (any::<bool>(), any::<bool>(), any::<bool>());
    (window, bands, switches).prop_map(|(window, settle_bands, (steady, taps, declared))| {
        let mut config = IdentifyConfig { window, settle_bands, ..IdentifyConfig::default() };
        config.thresholds.fewest_samples = 3;
        if steady {
            config.method = Method::Steady;
        }
        if taps {
            config.outlet_tap = PressureTap::Static { pipe_diameter_m: 0.04 };
        }
        if declared {
            for channel in CHANNELS {
                let declared =
                    DeclaredUncertainty { noise_sigma: 0.1, offset_sigma: 0.2, gain_sigma_ratio: 0.01 };
                config.declared.insert(channel, declared);
            }
        }
        config
    })
}

proptest! {
    // No files next to the sources.
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nothing_recorded_makes_it_panic(
        all in prop::collection::vec(series(), 9),
        times in prop::collection::vec(prop_oneof![0.0..200.0f64, values()], 0..6),
        config in any_config(),
    ) {
        let mut recording = Recording::default();
        recording.series.extend(CHANNELS.into_iter().zip(all));
        let template = Transient::default().recording().steps[1];
        for (index, pair) in times.windows(2).enumerate() {
            let mut step = template;
            (step.index, step.start_s, step.end_s, step.p3_pa) = (index, pair[0], pair[1], 1e5 * (index + 1) as f64);
            recording.steps.push(step);
        }
        if let Ok(points) = identify(&recording, &config) {
            points.iter().for_each(assert_sound);
        }
    }

    /// A good recording with some values lost or corrupted.
    #[test]
    fn spoilt_samples_do_no_harm(
        spoilt in prop::collection::vec((0usize..7, 0usize..1500, values()), 0..40),
        config in any_config(),
    ) {
        let mut recording = Transient::default().recording();
        for (channel, index, value) in spoilt {
            recording.series.get_mut(&CHANNELS[channel]).unwrap().values[index] = value;
        }
        identify(&recording, &config).unwrap().iter().for_each(assert_sound);
    }
}

/// Lost samples are left out and counted; a spike is left out and reported; the result stays the same.
#[test]
fn lost_samples_and_spikes_are_left_out() {
    let transient = Transient::default();
    let mut recording = transient.recording();
    for i in (450..480).chain([700, 900]) {
        recording.series.get_mut(&Channel::Tc).unwrap().values[i] = f64::NAN;
    }
    recording.series.get_mut(&Channel::T2).unwrap().values[800] += 500.0;
    let config = IdentifyConfig::default();
    let point = &identify(&recording, &config).unwrap()[1];
    assert!((point.eta.unwrap() - transient.eta).abs() < 1e-8);
    let reported = |expected: &dyn Fn(&Warning) -> bool| point.warnings.iter().any(expected);
    assert!(reported(&|warning| matches!(warning, Warning::LostSamples { lost: 32, .. })));
    assert!(reported(&|warning| *warning == Warning::Outliers { count: 1 }));
    assert_eq!(point.verdict, Verdict::Good);
}

/// A step without its flow has no position on the map: it is left out, and the reason is available.
#[test]
fn a_step_without_a_place_says_so() {
    let mut recording = Transient::default().recording();
    recording.series.get_mut(&Channel::CompressorFlow).unwrap().values[300..].fill(f64::NAN);
    let config = IdentifyConfig::default();
    let each = identify_each(&recording, &config).unwrap();
    assert!(each[0].is_ok());
    assert!(each[1].as_ref().unwrap_err().to_string().contains("no usable sample of m_c"));
    assert_eq!(identify(&recording, &config).unwrap().len(), 1);
}

#[test]
fn a_channel_lost_for_the_window_makes_the_point_unusable() {
    let mut recording = Transient::default().recording();
    recording.series.get_mut(&Channel::Tc).unwrap().values[300..].fill(f64::NAN);
    let point = &identify(&recording, &IdentifyConfig::default()).unwrap()[1];
    assert_eq!((point.verdict, point.eta), (Verdict::Unusable, None));
    assert_eq!(point.warnings[0].code(), "too_few_samples");
}

#[test]
fn no_compression_is_reported() {
    let transient = Transient { pressure_ratio: 0.99, ..Transient::default() };
    for method in [Method::Dynamic, Method::Steady] {
        let config = IdentifyConfig { method, ..IdentifyConfig::default() };
        let point = &identify(&transient.recording(), &config).unwrap()[1];
        assert_eq!((point.verdict, point.eta), (Verdict::Unusable, None));
        assert_eq!(point.warnings.last().unwrap().code(), "no_compression");
    }
}
