//! Channel maps: the shipped one, and what is refused.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_core::{Channel, DeclaredUncertainty, NoiseColour, ReferenceState};
use mapper_record::{ChannelMap, MachineConstants, WindowLimits};

#[test]
fn the_shipped_map_says_what_its_text_says() {
    let map = ChannelMap::from_yaml(include_str!("../../../examples/channels/gap_rig.yaml")).unwrap();
    assert_eq!(map.channels.len(), 16);
    let t2 = &map.channels[&Channel::T2];
    assert_eq!(
        (t2.topic.as_str(), t2.field.as_str(), t2.unit.as_deref()),
        ("/rig/compressor", "outlet_temperature", Some("degC"))
    );
    assert_eq!(map.reference, Some(ReferenceState::SAE));
    assert_eq!(map.window, Some(WindowLimits { start_s: 10.0, end_s: 110.0 }));
    assert_eq!(
        map.machine,
        Some(MachineConstants {
            compressor_internal_area_m2: 29e-3,
            alpha_area_ratio: 0.0,
            compressor_inlet_diameter_m: None,
            compressor_outlet_diameter_m: None,
            t2_probe_diameter_m: 0.0,
        })
    );
    let p3 = DeclaredUncertainty { noise_sigma: 80.0, offset_sigma: 150.0, gain_sigma_ratio: 0.0 };
    assert_eq!(map.sensors[&Channel::P3], p3);
    assert_eq!(map.noise_colour, Some(NoiseColour { first_order_share_ratio: 0.6, time_constant_s: 2.0 }));
}

#[test]
fn gain_and_colour_of_noise_are_read_with_their_units() {
    let text = "\
channels: {m_c: {topic: /a, field: x, unit: kg/hr}}
sensors: {m_c: {noise: 0.54 kg/h, gain: 0.5 %}}
noise_colour: {share: 60 %, time_constant: 2 s}
";
    let map = ChannelMap::from_yaml(text).unwrap();
    let flow = map.sensors[&Channel::CompressorFlow];
    assert_eq!((flow.offset_sigma, flow.gain_sigma_ratio), (0.0, 0.005));
    // One division: half a unit in the last place.
    assert!((flow.noise_sigma - 1.5e-4).abs() < 1e-19, "{}", flow.noise_sigma);
    assert_eq!(map.noise_colour, Some(NoiseColour { first_order_share_ratio: 0.6, time_constant_s: 2.0 }));
    for (wrong, path) in [
        ("60 %, time_constant: 0 s", "noise_colour.time_constant"),
        ("160 %, time_constant: 2 s", "noise_colour.share"),
        ("60 K, time_constant: 2 s", "noise_colour.share"),
    ] {
        let error = ChannelMap::from_yaml(&text.replace("60 %, time_constant: 2 s", wrong)).unwrap_err();
        assert_eq!((error.issues.len(), error.issues[0].path.as_str()), (1, path), "{error}");
        assert_eq!(error.issues[0].line, Some(3));
    }
}

#[test]
fn a_wrong_unit_is_answered_with_the_right_ones() {
    for (channel, unit, advice) in [
        ("T2", "degc", "did you mean `degC`?"),
        ("P3", "barg", "all pressures are absolute"),
        ("valve_command", "K", "a ratio may be written with `1`"),
    ] {
        let text = format!("channels: {{{channel}: {{topic: /a, field: x, unit: {unit}}}}}");
        let error = ChannelMap::from_yaml(&text).unwrap_err().to_string();
        assert!(error.contains(advice), "{error}");
    }
}

#[test]
fn all_wrong_values_are_named_with_their_lines() {
    let text = "\
channels:
  T2: {topic: /a, field: x, unit: degG}
  P3:
    topic: /truth/model
    field: y
    unit: kPa
constants: {P3: 1 bar}
window: {start: 10, end: 5 s}
machine:
  compressor_internal_area: -1 m^2
sensors:
  T2: {noise: 0.1 Pa}
";
    let error = ChannelMap::from_yaml(text).unwrap_err();
    let found: Vec<_> = error.issues.iter().map(|issue| (issue.line, issue.path.as_str())).collect();
    let expected = [
        (Some(2), "channels.T2.unit"),
        (Some(4), "channels.P3.topic"),
        (Some(7), "constants.P3"),
        (Some(8), "window.start"),
        (Some(10), "machine.compressor_internal_area"),
        (Some(12), "sensors.T2.noise"),
    ];
    assert_eq!(found, expected, "{error}");
}

#[test]
fn unknown_missing_and_repeated_keys_are_refused_with_a_line() {
    for (text, line, word) in [
        ("channels:\n  T2: {topic: /a, field: x}\nwindw: {}\n", 3, "windw"),
        ("channels:\n  T9: {topic: /a, field: x}\n", 2, "T9"),
        ("channels:\n  T2: {topic: /a}\n", 2, "field"),
        ("channels:\n  T2: {topic: /a, field: x}\n  T2: {topic: /a, field: x}\n", 2, "twice"),
        ("channels: [", 2, ""),
    ] {
        let error = ChannelMap::from_yaml(text).unwrap_err();
        assert!(error.to_string().contains(word), "{error}");
        assert!(error.issues[0].line.is_some_and(|found| found.abs_diff(line) <= 1), "{error}");
    }
    assert!(ChannelMap::from_yaml("").is_err());
    assert!(ChannelMap::from_yaml("channels: {}").is_err());
}
