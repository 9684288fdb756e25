//! The joint method on campaigns of the lumped model: required results without noise, and with it.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::honesty::Honesty;
use crate::lab::{Campaign, Machine, campaign, eighteen, measured};
use mapper_core::{Channel, IdentifiedPoint, Method, Recording, ThermalModel, Verdict};
use mapper_identify::{
    Choice, DeclaredUncertainty, Identified, IdentifyConfig, JointSettings, WindowRule, identify_recording,
};
use rand::SeedableRng;
use rand_pcg::Pcg64;

fn joint() -> IdentifyConfig {
    IdentifyConfig { method: Method::Joint, ..IdentifyConfig::default() }
}

fn found(recording: &Recording, config: &IdentifyConfig) -> (Vec<IdentifiedPoint>, ThermalModel) {
    let Identified { points, thermal, .. } = identify_recording(recording, config, None).unwrap();
    (points.into_iter().map(Result::unwrap).collect(), thermal.unwrap())
}

/// Maximum errors of eta (fraction) and h (ratio).
fn worst(points: &[IdentifiedPoint], campaign: &Campaign) -> (f64, f64) {
    points.iter().zip(&campaign.truth).fold((0.0, 0.0), |(eta, h), (point, truth)| {
        let off_eta = (point.eta.unwrap() - truth.eta).abs();
        let off_h = (point.h_w_m2k.unwrap() / truth.h_w_m2k - 1.0).abs();
        (f64::max(eta, off_eta), f64::max(h, off_h))
    })
}

fn value(shared: &mapper_core::SharedValue) -> f64 {
    shared.value.unwrap()
}

/// With constant h a jump to 50 krpm has an error of 4 points. With the law and the surface only the polynomial error of the map remains. Also
/// the first point, which has no transient.
#[test]
fn without_noise_every_point_of_the_nominal_machine_is_right() {
    let campaign = campaign(&eighteen(), 120.0, Machine::default());
    let (points, thermal) = found(&campaign.recording, &joint());
    let (eta, h) = worst(&points, &campaign);
    assert!(eta < 0.0015 && h < 0.015, "eta {eta}, h {h}");
    let law = thermal.convection.unwrap();
    // MODEL.md's law: 0.004 and 1.13. A coefficient at Re = 1 is three decades away from the points.
    assert!(
        (value(&law.exponent) - 1.13).abs() < 0.002 && (value(&law.coefficient) / 0.004 - 1.0).abs() < 0.02
    );
    assert!(thermal.doubts.is_empty(), "{:?}", thermal.doubts);
    assert!(points[0].warnings.iter().any(|warning| warning.code() == "from_convection_law"));
}

/// The twelve reference jumps of the paper's table: each in its own kind of campaign, two levels at three openings.
#[test]
fn without_noise_the_reference_jumps_are_right() {
    let jumps = [(110e3, 50e3), (50e3, 110e3), (150e3, 90e3), (90e3, 150e3)];
    let points: Vec<(f64, f64)> = [0.5, 0.7, 1.0]
        .into_iter()
        .flat_map(|valve| jumps.into_iter().flat_map(move |(from, to)| [(valve, from), (valve, to)]))
        .collect();
    let campaign = campaign(&points, 110.0, Machine::default());
    let (points, _) = found(&campaign.recording, &joint());
    let (eta, h) = worst(&points, &campaign);
    assert!(eta < 0.0015 && h < 0.015, "eta {eta}, h {h}");
}

#[test]
fn without_noise_an_unknown_share_before_the_wheel_is_found() {
    let campaign = campaign(&eighteen(), 120.0, Machine { alpha: 0.2, ..Machine::default() });
    let (points, thermal) = found(&campaign.recording, &joint());
    let (eta, _) = worst(&points, &campaign);
    let alpha = value(&thermal.alpha_area_ratio);
    assert!((alpha - 0.2).abs() < 0.002 && eta < 0.001, "alpha {alpha}, eta {eta}");
}

#[test]
fn without_noise_a_slow_probe_is_found_with_and_without_a_known_share() {
    for alpha in [0.0, 0.2] {
        let campaign = campaign(&eighteen(), 120.0, Machine { alpha, probe_m: 3e-3, ..Machine::default() });
        let (points, thermal) = found(&campaign.recording, &joint());
        let (eta, _) = worst(&points, &campaign);
        let diameter_m = value(&thermal.probe_diameter_m);
        assert!((diameter_m - 3e-3).abs() < 2e-5 && eta < 0.005, "{diameter_m} m, eta {eta}");
    }
}

#[test]
fn without_noise_convection_that_depends_on_direction_is_found() {
    let campaign =
        campaign(&eighteen(), 120.0, Machine { heating_cooling_ratio: 0.65, ..Machine::default() });
    let (points, thermal) = found(&campaign.recording, &joint());
    let (eta, _) = worst(&points, &campaign);
    let factor = value(&thermal.heating_cooling_ratio);
    assert!((factor - 0.65).abs() < 0.02 && eta < 0.003, "factor {factor}, eta {eta}");
}

/// A parameter with its prior switched off is not searched for.
#[test]
fn a_fixed_share_stays_what_it_was_declared() {
    let campaign = campaign(&eighteen()[..8], 120.0, Machine { alpha: 0.2, ..Machine::default() });
    let fixed = JointSettings { alpha_area: Choice::Fixed, ..JointSettings::default() };
    let (points, thermal) =
        found(&campaign.recording, &IdentifyConfig { joint: fixed, alpha_area_ratio: 0.2, ..joint() });
    assert_eq!(thermal.alpha_area_ratio, mapper_core::SharedValue::assumed(0.2));
    assert!(worst(&points, &campaign).0 < 0.002);
}

/// 0.1 K of white noise on T2, as in the figure of the issue: alpha_A within 0.015, eta within 0.6 points. Uses the root mean square over
/// seeds, since three standard errors of a single one are more.
#[test]
fn with_noise_on_t2_the_share_is_found() {
    let campaign = campaign(&eighteen(), 120.0, Machine { alpha: 0.2, ..Machine::default() });
    let (mut alpha_squares, mut eta_squares, mut count) = (0.0, 0.0, 0.0);
    let mut honesty = Honesty::default();
    let seeds = 5;
    for seed in 0..seeds {
        let mut rng = Pcg64::seed_from_u64(seed);
        let mut recording = campaign.recording.clone();
        let series = recording.series.get_mut(&Channel::T2).unwrap();
        let mut normal =
            || -> f64 { rand_distr::Distribution::sample(&rand_distr::StandardNormal, &mut rng) };
        series.values.iter_mut().for_each(|value| *value += 0.1 * normal());
        let mut config = joint();
        // The law of h before the wheel is known here; otherwise intervals are wider by its uncertainty (tests/inlet.rs).
        config.joint.inlet_h = Choice::Fixed;
        config.noise_colour.first_order_share_ratio = 0.0;
        let noise = DeclaredUncertainty { noise_sigma: 0.1, ..DeclaredUncertainty::default() };
        config.declared.insert(Channel::T2, noise);
        let (points, thermal) = found(&recording, &config);
        alpha_squares += (value(&thermal.alpha_area_ratio) - 0.2).powi(2);
        for (point, truth) in points.iter().zip(&campaign.truth) {
            eta_squares += (point.eta.unwrap() - truth.eta).powi(2);
            honesty.add(point.eta, point.eta_low, point.eta_high, truth.eta);
            count += 1.0;
        }
    }
    let alpha_rms = f64::sqrt(alpha_squares / seeds as f64);
    let eta_rms = f64::sqrt(eta_squares / count);
    assert!(alpha_rms < 0.015 && eta_rms < 0.006, "alpha {alpha_rms}, eta {eta_rms}");
    // The model is exact here except for noise, which the method does not assume. Intervals may be wider than the errors, so that all but one
    // of a seed's eighteen cover the truth, but at most four times the permitted error.
    assert!(
        honesty.held() > 0.94 && honesty.stated_rms() < 0.012,
        "{} {}",
        honesty.held(),
        honesty.stated_rms()
    );
}

/// Noise on every channel, with its slow part: an ideal probe must not be identified as a slow one, and every interval is honest. A lag would
/// smooth the noise in T1 and flow, which biases the fit.
#[test]
fn noise_in_the_inputs_is_not_taken_for_a_probe() {
    let campaign = campaign(&eighteen(), 120.0, Machine::default());
    for seed in 0..4 {
        let mut rng = Pcg64::seed_from_u64(seed);
        let (recording, declared) = measured(&campaign.recording, 1.0, 0.0, &mut rng);
        let config = IdentifyConfig { declared, ..joint() };
        let (points, thermal) = found(&recording, &config);
        let (eta, _) = worst(&points, &campaign);
        assert!(value(&thermal.probe_diameter_m) < 1e-3, "seed {seed}: {:?}", thermal.probe_diameter_m);
        // Three standard errors at 50 krpm, where the dynamic method has an error of 4 points even without noise.
        assert!(eta < 0.01, "seed {seed}: {eta}");
    }
}

fn noisy(seed: u64) -> (Campaign, Recording, IdentifyConfig) {
    let campaign = campaign(&eighteen(), 120.0, Machine::default());
    let (recording, declared) = measured(&campaign.recording, 1.0, 0.0, &mut Pcg64::seed_from_u64(seed));
    (campaign, recording, IdentifyConfig { declared, ..joint() })
}

/// Spikes, gaps and a stuck sensor in single steps: those steps get warnings, the others stay right.
#[test]
fn bad_data_in_one_step_does_not_spoil_the_others() {
    let (campaign, mut recording, config) = noisy(7);
    let t2 = recording.series.get_mut(&Channel::T2).unwrap();
    // Spikes in step 3, no values for half of step 5.
    for i in (3 * 1200 + 100..4 * 1200).step_by(97) {
        t2.values[i] += 40.0;
    }
    t2.values[5 * 1200..5 * 1200 + 600].fill(f64::NAN);
    // Tc is stuck in step 8, and the flow has an error of 20 % in step 11.
    let tc = recording.series.get_mut(&Channel::Tc).unwrap();
    let stuck = tc.values[8 * 1200 + 300];
    tc.values[8 * 1200 + 300..9 * 1200].fill(stuck);
    let t1 = recording.series.get_mut(&Channel::T1).unwrap();
    for (i, value) in t1.values[11 * 1200..12 * 1200].iter_mut().enumerate() {
        *value += 5.0 * (i as f64 / 120.0).sin();
    }
    let (points, _) = found(&recording, &config);
    let warned = |step: usize, code: &str| points[step].warnings.iter().any(|warning| warning.code() == code);
    assert!(warned(3, "outliers") && warned(5, "lost_samples") && warned(8, "stuck"));
    assert!(warned(11, "poor_fit") && warned(11, "left_out"), "{:?}", points[11].warnings);
    for step in [5, 8, 11] {
        assert_ne!(points[step].verdict, Verdict::Good, "step {step}");
    }
    for (step, (point, truth)) in points.iter().zip(&campaign.truth).enumerate() {
        let off = (point.eta.unwrap() - truth.eta).abs();
        assert!(off < 0.015 || point.verdict != Verdict::Good, "step {step} is called good and {off} off");
    }
}

/// An empty window: no number, and a reason.
#[test]
fn a_step_without_samples_has_no_number() {
    let (_, mut recording, config) = noisy(8);
    recording.series.get_mut(&Channel::Tc).unwrap().values[4 * 1200..5 * 1200].fill(f64::NAN);
    let (points, _) = found(&recording, &config);
    assert_eq!((points[4].eta, points[4].verdict), (None, Verdict::Unusable));
    assert_eq!(points[4].warnings[0].code(), "too_few_samples");
    assert!(points[3].eta.is_some() && points[5].eta.is_some());
}

/// The same recording gives the same result, to the bit.
#[test]
fn the_result_is_repeatable() {
    let (_, recording, config) = noisy(9);
    assert_eq!(found(&recording, &config), found(&recording, &config));
}

/// A window rule that the joint method does not need is not an error.
#[test]
fn a_campaign_of_one_step_gives_what_it_can() {
    let campaign = campaign(&eighteen()[..1], 120.0, Machine::default());
    let config = IdentifyConfig { window: WindowRule::Fixed { start_s: 10.0, end_s: 110.0 }, ..joint() };
    let Identified { points, .. } = identify_recording(&campaign.recording, &config, None).unwrap();
    let point = points[0].as_ref().unwrap();
    // Settled, and alone: efficiency and heat cannot be separated. The point is not good, but its interval covers the truth.
    assert_ne!(point.verdict, Verdict::Good, "{point:?}");
    assert!(codes(point).contains(&"prior_dominated"), "{point:?}");
    let (low, high) = point.eta_low.zip(point.eta_high).unwrap();
    assert!((low..=high).contains(&campaign.truth[0].eta), "{low} to {high}");
}

/// Noise, then one fault in step 7 of eighteen: that point gets the warning, and the others stay right.
fn spoilt(seed: u64, spoil: impl Fn(&mut Recording, std::ops::Range<usize>)) -> Vec<IdentifiedPoint> {
    let (campaign, mut recording, config) = noisy(seed);
    spoil(&mut recording, SPOILT * 1200..(SPOILT + 1) * 1200);
    let (points, _) = found(&recording, &config);
    for (step, (point, truth)) in points.iter().zip(&campaign.truth).enumerate() {
        let Some(eta) = point.eta else { continue };
        let off = (eta - truth.eta).abs();
        // 1.5 points: five standard errors of noise alone at 50 krpm.
        assert!(off < 0.015 || point.verdict != Verdict::Good, "step {step} is called good and {off} off");
        assert!(step == SPOILT || off < 0.015, "step {step} suffers from step {SPOILT}: {off}");
    }
    points
}

const SPOILT: usize = 7;

fn codes(point: &IdentifiedPoint) -> Vec<&str> {
    point.warnings.iter().map(|warning| warning.code()).collect()
}

/// The rig jumps 40 s after the step's start: the step with the jump is doubtful, and excluded from the shared parameters.
#[test]
fn a_late_jump_is_not_called_good() {
    let points = spoilt(21, |recording, step| {
        for series in recording.series.values_mut() {
            // The first 40 s still show the previous step.
            let before = series.values[step.start - 400..step.start].to_vec();
            series.values[step.start..step.start + 400].copy_from_slice(&before);
        }
    });
    let point = &points[SPOILT];
    assert_ne!(point.verdict, Verdict::Good, "{:?}", codes(point));
}

/// The flow changes by 3 % in 45 s to the end of the step, and the pressure ratio with it.
#[test]
fn a_step_that_never_stabilises_is_doubted() {
    let points = spoilt(22, |recording, step| {
        let start = step.start;
        for i in step {
            let swing = 1.0 + 0.03 * ((i - start) as f64 * 0.1 * std::f64::consts::TAU / 45.0).sin();
            recording.series.get_mut(&Channel::CompressorFlow).unwrap().values[i] *= swing;
            let p2 = recording.series.get_mut(&Channel::P2).unwrap();
            p2.values[i] *= 1.0 + 0.3 * (swing - 1.0);
        }
    });
    let point = &points[SPOILT];
    assert_ne!(point.verdict, Verdict::Good);
    assert!(codes(point).contains(&"not_stabilised"), "{:?}", codes(point));
}

#[test]
fn spikes_are_left_out_and_reported() {
    let points = spoilt(23, |recording, step| {
        for channel in [Channel::T2, Channel::Tc, Channel::T1] {
            let series = recording.series.get_mut(&channel).unwrap();
            for i in step.clone().step_by(61) {
                series.values[i] += 30.0;
            }
        }
    });
    assert!(codes(&points[SPOILT]).contains(&"outliers"), "{:?}", codes(&points[SPOILT]));
    assert!(points[SPOILT].eta.is_some());
}

/// A channel stuck for the whole step gives no number; if it is stuck for the last half, the first half is used.
#[test]
fn a_stuck_sensor_is_reported() {
    for (seed, from) in [(24, 0), (25, 600)] {
        let points = spoilt(seed, |recording, step| {
            let series = recording.series.get_mut(&Channel::T2).unwrap();
            let value = series.values[step.start + from];
            series.values[step.start + from..step.end].fill(value);
        });
        let point = &points[SPOILT];
        assert!(codes(point).contains(&"stuck"), "{:?}", codes(point));
        assert_ne!(point.verdict, Verdict::Good);
        assert!(from > 0 || point.eta.is_none());
    }
}

/// NaN in one channel for a whole step: no number. In a fifth of its samples: a number, and a doubt.
#[test]
fn samples_that_are_no_number_are_reported() {
    for (seed, share) in [(26, 1), (27, 5)] {
        let points = spoilt(seed, |recording, step| {
            let series = recording.series.get_mut(&Channel::CompressorFlow).unwrap();
            for i in step.step_by(share) {
                series.values[i] = f64::NAN;
            }
        });
        let point = &points[SPOILT];
        assert_eq!(point.eta.is_some(), share > 1, "{:?}", codes(point));
        assert_ne!(point.verdict, Verdict::Good);
    }
}

/// Without Tc there is nothing to fit, and the error names the channel.
#[test]
fn a_missing_channel_is_named() {
    let (_, mut recording, config) = noisy(28);
    recording.series.remove(&Channel::Tc);
    match identify_recording(&recording, &config, None) {
        Err(mapper_identify::IdentifyError::MissingChannels { missing, .. }) => {
            assert_eq!(missing, [Channel::Tc]);
        }
        other => panic!("{other:?}"),
    }
}

/// Two steps with ten times the noise of a good rig: by T2 alone any alpha_A fits, so no number is given.
#[test]
fn a_share_that_the_recording_cannot_determine_gets_no_number() {
    let campaign = campaign(&eighteen()[..3], 120.0, Machine { alpha: 0.2, ..Machine::default() });
    let (recording, declared) = measured(&campaign.recording, 10.0, 0.0, &mut Pcg64::seed_from_u64(31));
    let joint_settings = JointSettings { balance: Choice::Fixed, ..JointSettings::default() };
    let (_, thermal) = found(&recording, &IdentifyConfig { declared, joint: joint_settings, ..joint() });
    assert_eq!(thermal.alpha_area_ratio.value, None, "{:?}", thermal.alpha_area_ratio);
}

/// Noise, offsets and a gain as declared, 8 campaigns of 18 points: the intervals of eta and of h cover the truth, and are not wider than
/// necessary. The common errors of a campaign are one draw, so 144 points count for some twenty. Of twenty at 95 % fewer than 16 cover it in
/// 0.3 % of the cases; of twenty at 68 % fewer than 7 or more than 18 in 0.3 % and 0.5 %. Their root mean square is known to 16 %; three of
/// that are allowed above a width of 1.4. The intervals include what a recording cannot exclude of alpha_A, the probe and the heating/cooling
/// ratio, none of which this machine has. The common error of h is eight draws, and its intervals reach to a probe and a Tc that lag together,
/// which 18 steps hardly tell from a smaller h: they may be four times as wide.
#[test]
fn intervals_of_a_campaign_with_noise_and_offsets_hold_and_are_not_too_wide() {
    let campaign = campaign(&eighteen(), 120.0, Machine::default());
    let (mut eta, mut h) = (Honesty::default(), Honesty::default());
    for seed in 100..108 {
        let mut rng = Pcg64::seed_from_u64(seed);
        let (mut recording, mut declared) = measured(&campaign.recording, 1.0, 1.0, &mut rng);
        let gain: f64 = rand_distr::Distribution::sample(&rand_distr::StandardNormal, &mut rng);
        let flow = recording.series.get_mut(&Channel::CompressorFlow).unwrap();
        flow.values.iter_mut().for_each(|value| *value *= 1.0 + 0.005 * gain);
        declared.get_mut(&Channel::CompressorFlow).unwrap().gain_sigma_ratio = 0.005;
        let (points, _) = found(&recording, &IdentifyConfig { declared, ..joint() });
        for (point, truth) in points.iter().zip(&campaign.truth) {
            eta.add(point.eta, point.eta_low, point.eta_high, truth.eta);
            h.add(point.h_w_m2k, point.h_low_w_m2k, point.h_high_w_m2k, truth.h_w_m2k);
        }
    }
    for (name, honesty, most_within, widest) in [("eta", eta, 0.92, 2.1), ("h", h, 1.0, 4.5)] {
        let (held, within_one, width) = (honesty.held(), honesty.within_one(), honesty.width());
        assert!(held >= 0.8, "{name}: {held} hold");
        assert!((0.35..=most_within).contains(&within_one), "{name}: {within_one} within one standard error");
        assert!((0.6..=widest).contains(&width), "{name}: {width} as wide as the errors");
    }
}

/// A recording says little about the gain of T2, which is efficiency to eqs. 1-3: a gain that is hardly known widens the intervals, but moves no
/// point by more than half of them. Fitted to the noise of T2, it would.
#[test]
fn an_unknown_gain_of_t2_moves_no_point() {
    let campaign = campaign(&eighteen(), 40.0, Machine::default());
    let (recording, declared) = measured(&campaign.recording, 1.0, 0.0, &mut Pcg64::seed_from_u64(52));
    let with_gain = |gain_sigma_ratio: f64| {
        let mut declared = declared.clone();
        declared.get_mut(&Channel::T2).unwrap().gain_sigma_ratio = gain_sigma_ratio;
        found(&recording, &IdentifyConfig { declared, ..joint() }).0
    };
    let (known, unknown) = (with_gain(1e-5), with_gain(0.01));
    for (known, unknown) in known.iter().zip(&unknown) {
        let half = 0.5 * (unknown.eta_high.unwrap() - unknown.eta_low.unwrap());
        let (known, unknown) = (known.eta.unwrap(), unknown.eta.unwrap());
        assert!((unknown - known).abs() < 0.5 * half, "{known} and {unknown} +/- {half}");
    }
}
