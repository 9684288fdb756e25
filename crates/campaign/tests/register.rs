//! The calibration register and the criteria of acceptance.

use mapper_campaign::campaign::Date;
use mapper_campaign::{CalibrationWarning, Campaign, forecast_calibration_warnings, nominal_model};
use mapper_core::{CalibrationDefect, Channel, Warning};
use std::path::Path;

const NIGHT: &str = "\
campaign: short
machine: {name: a, map: closed_form}
boundary:
  inlet_temperature: 25 degC
  inlet_pressure: 100 kPa
  turbine_inlet_temperature: 500 degC
  turbine_outlet_pressure: 110 kPa
  oil_temperature: 50 degC
sensors:
  N: {noise: 30 rpm}
  m_c: {noise: 1.5e-4 kg/s}
  P1: {noise: 20 Pa}
  P2: {noise: 60 Pa}
  T1: {noise: 0.1 K}
  T2: [{noise: 0.1 K, name: a}, {noise: 0.1 K, offset: 0.2 K, name: b, calibration: CALIBRATION}]
  Tc: {noise: 0.15 K}
backend: {virtual_lab: {}}
grid:
  speeds: [90 krpm, 110 krpm]
  openings: [0.7, 1.0]
timing: {dwell: 120 s}
limits:
  speed: 180 krpm
  turbine_inlet_pressure: {min: 110 kPa, max: 500 kPa}
";

fn campaign(calibration: &str, more: &str) -> Campaign {
    let text = format!("{}{more}", NIGHT.replace("CALIBRATION", calibration));
    let none = |_: &Path| Err(std::io::ErrorKind::NotFound.into());
    mapper_campaign::check(&text, Path::new("a.yaml"), &none).unwrap_or_else(|findings| panic!("{findings}"))
}

fn concerns(campaign: &Campaign, day: &str) -> Vec<CalibrationWarning> {
    forecast_calibration_warnings(campaign, &nominal_model(campaign).unwrap(), Some(day.parse().unwrap()))
}

#[test]
fn a_certificate_is_valid_on_its_last_day_and_within_its_range() {
    let of = |range: &str| {
        campaign(&format!("{{date: 2026-01-31, due: 2027-01-31, range: {range}, uncertainty: 0.4 K}}"), "")
    };
    let wide = of("{min: 0 degC, max: 200 degC}");
    assert_eq!(concerns(&wide, "2027-01-31"), []);
    let late = concerns(&wide, "2027-02-01");
    assert_eq!(late.len(), 1);
    let expired = CalibrationDefect::Expired { due: "2027-01-31".to_owned(), day: "2027-02-01".to_owned() };
    let warning = Warning::Calibration { channel: Channel::T2, sensor: "b".to_owned(), defect: expired };
    assert_eq!(late[0].warning, warning);
    // At 110 krpm air from 25 degC leaves the compressor well above 60 degC.
    let narrow = of("{min: 0 degC, max: 60 degC}");
    assert_eq!(concerns(&narrow, "2026-06-01").len(), 1);
    // The day of a simulated run is not known.
    let model = nominal_model(&wide).unwrap();
    assert_eq!(forecast_calibration_warnings(&wide, &model, None), []);

    let read = |high_k: f64| {
        let only_t2 = |channel| (channel == Channel::T2).then_some((300.0, high_k));
        narrow.calibration_warnings(None, only_t2)
    };
    assert_eq!(read(333.0), []);
    let defect = CalibrationDefect::Range { reading: 334.0, min: 273.15, max: 333.15 };
    let warning = Warning::Calibration { channel: Channel::T2, sensor: "b".to_owned(), defect };
    assert_eq!(read(334.0).into_iter().map(|one| one.warning).collect::<Vec<_>>(), [warning]);
}

/// Half of the expanded uncertainty is the certificate's standard uncertainty (k = 2).
#[test]
fn a_declaration_below_its_certificate_is_a_warning() {
    for (certified, warnings) in [("0.4 K", 0), ("0.6 K", 1)] {
        let campaign = campaign(&format!("{{date: 2026-01-31, uncertainty: {certified}}}"), "");
        assert_eq!(concerns(&campaign, "2026-06-01").len(), warnings, "{certified}");
    }
}

#[test]
fn required_calibrations_are_mistakes_where_one_is_missing() {
    let all = "{certificate: C1, date: 2026-01-31, due: 2027-01-31, range: {min: 0 degC, max: 200 degC}}";
    let required = campaign(all, "calibration: required\n");
    let concerns = concerns(&required, "2026-06-01");
    // N, m_c, P1, P2, T1, Tc and the first of the two sensors of T2.
    assert_eq!(concerns.len(), 7);
}

#[test]
fn the_short_form_gives_the_day_alone() {
    let short = campaign("{date: 2026-01-31}", "report: {calibration: {T1: 2026-02-28, T2: 2020-01-01}}\n");
    let day = |channel: Channel| {
        let dates = short.sensors[&channel].calibrations.iter().flatten().map(|one| one.date.to_string());
        dates.collect::<Vec<_>>()
    };
    assert_eq!(
        (day(Channel::T1), day(Channel::T2)),
        (vec!["2026-02-28".to_owned()], vec!["2026-01-31".to_owned()])
    );
}

/// 2026-11-27 is day 20,784 since 1970.
#[test]
fn a_time_has_a_day_and_zero_has_none() {
    let day_ns = 86_400_000_000_000;
    let text = |ns: u64| Date::from_epoch_ns(ns).map(|date| date.to_string());
    assert_eq!(text(20_784 * day_ns).as_deref(), Some("2026-11-27"));
    assert_eq!(text(20_784 * day_ns - 1_000_000_000).as_deref(), Some("2026-11-26"));
    assert_eq!(text(0), None);
}

#[test]
fn criteria_are_a_preset_or_the_users_own() {
    let preset = campaign("{date: 2026-01-31}", "acceptance: PTC 10\n").acceptance.unwrap();
    assert!(preset.source.contains("3.4") && preset.heat_balance_ratio.is_none());
    let own = "acceptance: {name: J1826, source: edition 2022, fluctuation: {N: 0.2 %}, heat_balance: 5 %}\n";
    let own = campaign("{date: 2026-01-31}", own).acceptance.unwrap();
    assert_eq!(own.fluctuation_ratio, [(Channel::ShaftSpeed, 0.002)].into());
    assert_eq!(own.heat_balance_ratio, Some(0.05));
}
