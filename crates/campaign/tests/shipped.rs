//! The campaigns that come with the program are right, and say what they are meant to say.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_campaign::campaign::MapSource;
use mapper_campaign::{CampaignError, check, load, read_named_file};
use mapper_core::{Channel, Dwell, EfficiencyDefinition, ReferenceState, VisitOrder, WindowRule};
use mapper_physics::machine::params::{BoundaryConditions, Params};
use std::path::{Path, PathBuf};

fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../campaigns")
}

#[test]
fn every_shipped_campaign_is_right() {
    let mut count = 0;
    let entries = [directory(), directory().join("nightly")].map(|folder| std::fs::read_dir(folder).unwrap());
    for entry in entries.into_iter().flatten() {
        let path = entry.unwrap().path();
        // A nightly file lists campaigns and is none.
        let nightly = path.file_stem().is_some_and(|stem| stem == "nightly");
        if !nightly && path.extension().is_some_and(|extension| extension == "yaml") {
            load(&path).unwrap_or_else(|error| panic!("{error}"));
            count += 1;
        }
    }
    assert!(count > 0);
}

/// As PyYAML writes them: it reads a plain `off` as false (YAML 1.1, <https://yaml.org/type/bool.html>).
#[test]
fn campaigns_that_another_yaml_program_rewrote_are_the_same() {
    let mut rewritten = 0;
    for name in ["turbo_a.yaml", "gap_rig.yaml", "grid18.yaml", "nightly/heavy.yaml"] {
        let path = directory().join(name);
        let shipped = std::fs::read_to_string(&path).unwrap();
        for more in ["", "\nspeed_control: off\n"] {
            let text = shipped.clone() + more;
            let other = text.replace(": off\n", ": false\n");
            rewritten += usize::from(other != text);
            let read = |text: &str| {
                let campaign = check(text, &path, &read_named_file).unwrap_or_else(|error| panic!("{error}"));
                serde_json::to_string(&campaign).unwrap()
            };
            assert_eq!(read(&other), read(&text), "{name}");
        }
    }
    assert!(rewritten > 4, "{rewritten}");
}

#[test]
fn turbo_a_is_the_machine_of_appendix_a() {
    let campaign = load(&directory().join("turbo_a.yaml")).unwrap();
    let mut params = campaign.machine.params;
    // The campaign is run at 50 % of humidity with efficiencies by enthalpy, Appendix A's machine in dry air with those of eq. 2.
    assert!((params.compressor.humidity_kg_kg - 0.01).abs() < 1e-3);
    params.compressor.humidity_kg_kg = 0.0;
    assert_eq!(params.compressor.efficiency, EfficiencyDefinition::Enthalpy);
    params.compressor.efficiency = EfficiencyDefinition::KappaOfT1;
    assert_eq!(params, Params::default());
    assert_eq!(campaign.boundary, BoundaryConditions::default());
    assert_eq!(campaign.machine.map, MapSource::ClosedForm);
    assert_eq!(campaign.reference, ReferenceState::SAE);
    assert_eq!(campaign.order, VisitOrder::ThermalGradient);
    assert_eq!(campaign.identification.window, WindowRule::Auto);
    assert_eq!(
        (campaign.timing.warm_up_s, campaign.timing.dwell, campaign.seed),
        (120.0, Dwell::Fixed(40.0), 1)
    );
    assert!(campaign.points.len() >= 30);
    let mut speeds: Vec<f64> = campaign.points.iter().map(|point| point.speed_rpm).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup();
    assert!(speeds.len() >= 8);
    let t2 = &campaign.sensors[&Channel::T2];
    assert_eq!((t2.declared.noise_sigma, t2.declared.offset_sigma, t2.probe_diameter_m), (0.1, 0.25, 0.0));
    assert_eq!(campaign.sensors[&Channel::CompressorFlow].declared.gain_sigma_ratio, 0.005);
    assert_eq!(campaign.report.humidity_ratio, Some(0.5));
    assert_eq!(campaign.report.calibration[&Channel::T2].to_string(), "2026-09-01");
}

#[test]
fn leaving_the_geometry_out_changes_nothing() {
    let text = std::fs::read_to_string(directory().join("turbo_a.yaml")).unwrap();
    let start = text.find("  # What is left out below").unwrap();
    let end = text.find("  # The nominal compressor map").unwrap();
    let short = format!("{}{}", &text[..start], &text[end..]);
    let none = |_: &Path| Err(std::io::ErrorKind::NotFound.into());
    let full = mapper_campaign::check(&text, Path::new("a.yaml"), &none).unwrap();
    let short = mapper_campaign::check(&short, Path::new("a.yaml"), &none).unwrap();
    assert_eq!(serde_json::to_string(&full).unwrap(), serde_json::to_string(&short).unwrap());
}

#[test]
fn a_file_that_is_not_there_or_not_text_is_refused() {
    assert!(matches!(load(Path::new("no/such.yaml")), Err(CampaignError::Read { .. })));
    let here = std::env::temp_dir();
    assert!(matches!(load(&here), Err(CampaignError::Read { .. })));
}
