//! Channels that a log suggests: what physics contradicts is never sure.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, missing_docs)]

use mapper_core::Channel;
use mapper_log_formats::LOG_FORMATS;
use mapper_recording::logs::proposal::{Certainty, Proposal, propose};
use mapper_recording::logs::{LogFile, LogOptions, survey};
use std::path::Path;

/// A log of two minutes at 1 Hz with these headings; `row` has the values at a load of 0 to 1.
fn proposal(headings: &str, row: impl Fn(f64) -> Vec<f64>) -> Proposal {
    let mut text = format!("Time [s],{headings}\n");
    for second in 0..120 {
        let load = f64::from(second) / 119.0;
        let values: Vec<String> = row(load).iter().map(f64::to_string).collect();
        text += &format!("{second},{}\n", values.join(","));
    }
    let file = LogFile::of_bytes(Path::new("log"), text.as_bytes());
    let (_, mut log) = LOG_FORMATS.open(&file, &LogOptions::default()).unwrap();
    let found = survey(log.as_mut()).unwrap();
    propose(log.layout(), &found)
}

fn sure(proposal: &Proposal) -> Vec<Channel> {
    let sure = proposal.channels.iter().filter(|proposed| proposed.certainty == Certainty::Sure);
    sure.map(|proposed| proposed.channel).collect()
}

/// The stations 2 to 5 of a gas turbine: the temperature rises from 3 to 4, where the combustor is.
#[test]
fn stations_of_a_gas_turbine_are_not_sure() {
    let found = proposal("P2 [kPa],T2 [K],P3 [kPa],T3 [K],P4 [kPa],T4 [K],P5 [kPa],T5 [K]", |load| {
        let ratio = 1.0 + 1.3 * load;
        vec![98.0, 295.0, 98.0 * ratio, 295.0 + 110.0 * load, 97.0 * ratio, 500.0 + 300.0 * load, 99.0, 450.0]
    });
    assert_eq!(sure(&found), []);
    // The same values under the stations of a turbocharger.
    let found = proposal("P1 [kPa],T1 [K],P2 [kPa],T2 [K],P3 [kPa],T3 [K],P4 [kPa],T4 [K]", |load| {
        let ratio = 1.0 + 1.3 * load;
        vec![98.0, 295.0, 98.0 * ratio, 295.0 + 110.0 * load, 97.0 * ratio, 500.0 + 300.0 * load, 99.0, 450.0]
    });
    assert!(sure(&found).contains(&Channel::T3) && sure(&found).contains(&Channel::T2));
}

/// An engine's speed and throttle are not those of the turbocharger and of the valve behind its compressor.
#[test]
fn an_engines_speed_and_throttle_are_not_taken() {
    let found = proposal("RPM [rpm],Throttle Pos. [%],Flow [g/s]", |load| {
        vec![1500.0 + 4200.0 * load, 20.0 + 77.0 * load, 10.0 + 140.0 * load]
    });
    assert!(!sure(&found).contains(&Channel::ShaftSpeed));
    assert!(found.of(Channel::ValveCommand).is_none());
    let found = proposal("RPM [rpm],Flow [g/s]", |load| vec![15e3 + 100e3 * load, 10.0 + 140.0 * load]);
    assert!(sure(&found).contains(&Channel::ShaftSpeed));
}

/// Inches of water are a pressure, and a barometer in inches of mercury is the ambient pressure.
#[test]
fn american_pressures_are_known() {
    let found =
        proposal("Baro [inHg],Comp Inlet Press [inH2O],T1 [F]", |load| vec![29.12, -7.9 * load, 72.0]);
    assert!(found.of(Channel::P1).is_some_and(|inlet| inlet.gauge) && found.ambient.is_some());
}

/// A flow with its unit is as sure as its name; one without gets the unit that fits the wheel.
#[test]
fn a_flow_keeps_its_unit() {
    let row = |load: f64| vec![30e3 + 90e3 * load, 0.03 + 0.12 * load, 99.0, 105.0 + 130.0 * load];
    let found = proposal("n_TC [rpm],m_dot_C [kg/s],p1_C [kPa],p2_C [kPa]", row);
    assert!(sure(&found).contains(&Channel::CompressorFlow));
    let found = proposal("n_TC [rpm],m_dot_C,p1_C [kPa],p2_C [kPa]", row);
    let flow = found.of(Channel::CompressorFlow).unwrap();
    assert_eq!((flow.unit, flow.certainty), (Some("kg/s"), Certainty::Likely));
}
