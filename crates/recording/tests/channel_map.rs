//! Channel maps: the shipped one, and what is refused.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_core::{Channel, DeclaredUncertainty, Element, NoiseColour, ReferenceState};
use mapper_recording::{ChannelMap, ChannelMapError, MachineConstants, WindowLimits};
use mapper_yaml::{FindingKind as Kind, Findings};
use std::path::Path;

fn read(text: &str) -> Result<ChannelMap, Findings> {
    ChannelMap::from_yaml(text, Path::new("dir/map.yaml"))
}

fn mistakes(text: &str) -> Findings {
    read(text).expect_err("this text has mistakes")
}

/// Line, column and path of each mistake.
fn places(findings: &Findings) -> Vec<(usize, usize, &str)> {
    findings.list.iter().map(|finding| (finding.line, finding.column, finding.path.as_str())).collect()
}

#[test]
fn the_shipped_map_says_what_its_text_says() {
    let map = read(include_str!("../../../examples/channels/gap_rig.yaml"))
        .unwrap_or_else(|mistakes| panic!("{mistakes}"));
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
    let p3 = DeclaredUncertainty { noise_sigma: 80.0, offset_sigma: 150.0, gain_sigma_ratio: 5e-4 };
    assert_eq!(map.sensors[&Channel::P3], p3);
    assert_eq!(map.noise_colour, Some(NoiseColour { first_order_share_ratio: 0.6, time_constant_s: 2.0 }));
}

#[test]
fn a_list_of_fields_is_as_many_sensors_of_one_channel() {
    let text = "\
channels:
  T2: {topic: /daq, field: [TC_21, TC_22, TC_23, TC_24], unit: degC}
  P2: {topic: /daq, field: [P_2], unit: kPa}
sensors: {T2: {noise: 0.1 K, offset: 0.24 K, common_offset: 0.16 K}}
";
    let map = read(text).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    let third = &map.elements[&Element { channel: Channel::T2, number: 3 }];
    assert_eq!((third.field.as_str(), third.unit.as_deref()), ("TC_23", Some("degC")));
    assert_eq!(map.elements.len(), 4);
    assert!(!map.channels.contains_key(&Channel::T2) && map.channels.contains_key(&Channel::P2));
    // Half of 0.24 and all of 0.16 in quadrature.
    assert!((map.sensors[&Channel::T2].offset_sigma - 0.2).abs() < 1e-12);
    assert_eq!(map.redundant[&Channel::T2].elements[1].name, "TC_22");
    for (wrong, path) in [
        ("channels: {T2: {topic: /daq, field: [A, A]}}", "channels.T2.field"),
        ("channels: {T2: {topic: /daq, field: []}}", "channels.T2.field"),
        ("channels: {T2: {topic: /daq, field: [A, B]}}\nconstants: {T2: 300 K}", "constants.T2"),
    ] {
        assert_eq!(mistakes(wrong).list[0].path, path, "{wrong}");
    }
}

#[test]
fn two_quantities_of_one_side_are_never_one_column() {
    let found = mistakes("channels:\n  P1: {field: p_in, unit: kPa}\n  P2: {field: p_in, unit: kPa}\n");
    assert_eq!(places(&found), [(3, 15, "channels.P2.field")], "{found}");
    assert!(matches!(found.list[0].kind, Kind::Conflict));
    // A stand that draws its air from the cell may have one sensor for both; groups of a log have columns of equal names.
    for same in [
        "  T1: {field: t, unit: K}\n  T_amb: {field: t, unit: K}\n",
        "  P1: {topic: in, field: p, unit: Pa}\n  P2: {topic: out, field: p, unit: Pa}\n",
    ] {
        read(&format!("channels:\n{same}")).unwrap_or_else(|mistakes| panic!("{mistakes}"));
    }
}

#[test]
fn gain_and_colour_of_noise_are_read_with_their_units() {
    let text = "\
channels: {m_c: {topic: /a, field: x, unit: kg/hr}}
sensors: {m_c: {noise: 0.54 kg/h, gain: 0.5 %}}
noise_colour: {share: 60 %, time_constant: 2 s}
";
    let map = read(text).unwrap_or_else(|mistakes| panic!("{mistakes}"));
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
        let findings = mistakes(&text.replace("60 %, time_constant: 2 s", wrong));
        assert_eq!((findings.list.len(), findings.list[0].path.as_str()), (1, path), "{findings}");
        assert_eq!(findings.list[0].line, 3, "{findings}");
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
        let findings = mistakes(&text);
        assert_eq!(findings.list[0].kind, Kind::Unit, "{findings}");
        assert!(findings.list[0].remedy.contains(advice), "{findings}");
    }
}

#[test]
fn all_mistakes_come_in_one_go_each_at_its_place() {
    let text = "\
channels:
  T2: {topic: /a, field: x, unit: degG}
  P3:
    topic: /truth/model
    field: y
    unit: kPa
  T9: {topic: /a, field: x}
constants: {P3: 1 bar}
window: {start: 10, end: 5 s}
machine:
  compressor_internal_area: -1 m^2
  alpha_area: 1.5
sensors:
  T2: {noise: 0.1 Pa, offsett: 1 K}
noise_color: {share: 1, time_constant: 2 s}
";
    let expected = [
        (2, 35, "channels.T2.unit"),
        (4, 12, "channels.P3.topic"),
        (7, 3, "channels.T9"),
        (8, 17, "constants.P3"),
        (9, 17, "window.start"),
        (11, 29, "machine.compressor_internal_area"),
        (12, 15, "machine.alpha_area"),
        (14, 15, "sensors.T2.noise"),
        (14, 23, "sensors.T2.offsett"),
        (15, 1, "noise_color"),
    ];
    let findings = mistakes(text);
    assert_eq!(places(&findings), expected, "{findings}");
    for (index, advice) in
        [(2, "the keys are N, P1,"), (8, "did you mean `offset`?"), (9, "did you mean `noise_colour`?")]
    {
        assert!(findings.list[index].remedy.contains(advice), "{findings}");
    }
    let shown = findings.to_string();
    assert!(shown.contains("dir/map.yaml:2:35") && shown.contains("^^^^"), "{shown}");
    assert!(shown.ends_with("dir/map.yaml: 10 mistakes\n"), "{shown}");
}

#[test]
fn missing_and_repeated_keys_and_wrong_types_are_refused_at_their_place() {
    for (text, kind, place, words) in [
        ("channels:\n  T2: {topic: /a}\n", Kind::MissingKey, (2, 3), "has no key `field`"),
        (
            "channels:\n  T2: {topic: /a, field: x}\n  T2: {topic: /a, field: x}\n",
            Kind::DuplicateKey,
            (3, 3),
            "second time",
        ),
        ("channels:\n  T2: [/a, x]\n", Kind::WrongType, (2, 3), "a list is given where a mapping is needed"),
        ("channels:\n  T2: {topic: /a, field: x, unit: 1}\n", Kind::WrongType, (2, 35), "text is needed"),
        (
            "channels: {T2: {topic: /a, field: x}}\nreference: SEA\n",
            Kind::WrongValue,
            (2, 12),
            "not one of SAE",
        ),
        (
            "channels: {T2: {topic: /a, field: x}}\nwindow: {start: 10 s, end: 5 s}\n",
            Kind::Conflict,
            (2, 28),
            "not after its start",
        ),
        (
            "channels: {T2: {topic: /a, field: x}}\nconstants: {P1: [1 bar]}\n",
            Kind::WrongType,
            (2, 13),
            "a list is given where text or a plain number is needed",
        ),
        ("channels: {}", Kind::Range, (1, 1), "the mapping is empty"),
        (
            "channels: &a {T2: {topic: /a, field: x}}",
            Kind::Unsupported,
            (1, 11),
            "not allowed in a channel map",
        ),
        ("", Kind::MissingKey, (1, 1), "the file is empty"),
    ] {
        let findings = mistakes(text);
        let finding = &findings.list[0];
        assert_eq!((findings.count(), finding.kind), (1, kind), "{findings}");
        assert_eq!((finding.line, finding.column), place, "{findings}");
        assert!(finding.message.contains(words), "{findings}");
    }
    assert_eq!(mistakes("channels: [").list[0].kind, Kind::Syntax);
}

#[test]
fn a_missing_file_and_a_file_that_is_not_text_are_distinguished() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("map.yaml");
    assert!(matches!(ChannelMap::load(&path), Err(ChannelMapError::Read { .. })));
    std::fs::write(&path, b"channels: \xff").unwrap();
    let Err(ChannelMapError::Mistakes(findings)) = ChannelMap::load(&path) else { panic!("mistakes") };
    assert_eq!((findings.list[0].line, findings.list[0].column), (1, 11), "{findings}");
}

proptest::proptest! {
    #[test]
    fn any_piece_of_yaml_gives_an_answer(text in "(channels|T2|topic|field|unit|sensors|noise|window|start|: |\\{|\\}|, |\n|\n  |1|0.1 K|degC|/a){0,30}") {
        let _ = read(&text).map_err(|findings| findings.to_string());
    }
}
