//! Each kind of mistake gives a finding at its place; several give several; nothing makes the reader panic.

#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_campaign::campaign::MapSource;
use mapper_campaign::{
    Campaign, Concern, Finding, FindingKind as Kind, Findings, check, check_with, warnings,
};
use mapper_core::Dwell;
use std::io;
use std::path::Path;

/// A campaign without mistakes, short enough to count lines in.
const RIGHT: &str = "\
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
  T2: {noise: 0.1 K}
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

/// Two speed lines that bracket the short campaign's.
const TABLE: &str = "\
rpm,kg/s,PR,eta
80000,0.0190,1.44,0.60
80000,0.0659,1.32,0.72
80000,0.0930,1.10,0.50
120000,0.0330,2.20,0.60
120000,0.0900,1.90,0.74
120000,0.1250,1.30,0.50
";

fn files(path: &Path) -> io::Result<String> {
    match path.to_str() {
        Some("dir/maps/there.csv") => Ok(TABLE.into()),
        Some("dir/maps/bad.csv") => Ok(TABLE.replace("0.0659", "much")),
        // The same points under headings that say nothing, speeds in krpm.
        Some("dir/maps/open.csv") => Ok(TABLE.replace("rpm,kg/s,PR,eta", "a,b,c,d").replace("000,", ",")),
        Some("dir/maps/open.yaml") => {
            Ok("speed: \"a [krpm]\"\nflow: \"b [kg/s]\"\npressure_ratio: c\nefficiency: d\n".into())
        }
        Some("dir/maps/wrong.yaml") => Ok("flow: \"b [slug]\"\ndesign: 1\n".into()),
        _ => Err(io::ErrorKind::NotFound.into()),
    }
}

fn run(text: &str) -> Result<Campaign, Findings> {
    check(text, Path::new("dir/short.yaml"), &files)
}

fn mistakes(text: &str) -> Findings {
    run(text).expect_err("this text has mistakes")
}

/// The text with one line replaced, and that line's number.
fn with(old: &str, new: &str) -> (String, usize) {
    assert_eq!(RIGHT.matches(old).count(), 1, "{old}");
    let line = 1 + RIGHT[..RIGHT.find(old).unwrap()].matches('\n').count();
    (RIGHT.replace(old, new), line)
}

/// One replacement, one finding: of this kind, pointing at `at`, saying this.
#[track_caller]
fn one(old: &str, new: &str, kind: Kind, at: &str, message: &str, remedy: &str) {
    let (text, _) = with(old, new);
    let findings = mistakes(&text);
    assert_eq!(findings.list.len(), 1, "{findings}");
    let finding = &findings.list[0];
    // The last occurrence in the replaced part: a duplicate is complained about at the second.
    let part = text.find(new).unwrap();
    let offset = part + new.rfind(at).unwrap();
    let line = 1 + text[..offset].matches('\n').count();
    let column = 1 + text[..offset].rsplit('\n').next().unwrap().chars().count();
    assert_eq!((finding.kind, finding.line, finding.column), (kind, line, column), "{findings}");
    assert!(finding.message.contains(message), "{findings}");
    assert!(finding.remedy.contains(remedy), "{findings}");
}

#[test]
fn the_short_campaign_is_right() {
    let campaign = run(RIGHT).unwrap_or_else(|findings| panic!("{findings}"));
    let speeds: Vec<_> = campaign.points.iter().map(|p| (p.speed_rpm, p.valve_opening_ratio)).collect();
    assert_eq!(speeds, [(90e3, 0.7), (110e3, 0.7), (90e3, 1.0), (110e3, 1.0)]);
    assert_eq!(campaign.boundary.ambient_temperature_k, 298.15);
}

/// The dwell is set in exactly one of three ways.
#[test]
fn one_key_sets_the_dwell() {
    let timing = "timing: {dwell: 120 s}";
    one(
        timing,
        "timing: {warm_up: 2 min}",
        Kind::MissingKey,
        "timing",
        "set the duration",
        "`time_budget: 45 min`",
    );
    let both = "timing: {dwell: 120 s, time_budget: 45 min}";
    one(timing, both, Kind::Conflict, "45 min", "both set the time", "keep one");
    let script = "timing: {time_budget: 45 min}\norder: conventional";
    one(timing, script, Kind::Conflict, "45 min", "until nothing drifts", "`dwell`");
    for (text, dwell) in [
        ("timing: {dwell: 50 s}", Dwell::Fixed(50.0)),
        ("timing: {time_budget: 45 min}", Dwell::TimeBudget(2700.0)),
        ("timing: {required_sigma_eta: 0.3 %}", Dwell::RequiredSigmaEta(0.003)),
    ] {
        let campaign = run(&with(timing, text).0).unwrap_or_else(|findings| panic!("{findings}"));
        assert_eq!(campaign.timing.dwell, dwell);
    }
}

/// A key or an order of an earlier version is refused with what replaces it.
#[test]
fn removed_keys_name_their_replacement() {
    for (order, remedy) in [
        ("sum_gradient", "thermal_gradient"),
        ("worst_gradient", "speed_lines"),
        ("min_gradient", "`listed`"),
        ("information", "thermal_gradient"),
        ("time", "required_sigma_eta"),
        ("best", "--compare"),
        ("greedy", "thermal_gradient"),
    ] {
        let line = format!("campaign: short\norder: {order}\n");
        one("campaign: short\n", &line, Kind::WrongValue, order, "no longer known", remedy);
    }
    for (line, key, remedy) in [
        ("gradient_share: 75 %", "gradient_share", "thermal_gradient"),
        ("replan: after_each_step", "replan", "sequence"),
        ("required_sigma_eta: 0.5 %", "required_sigma_eta", "timing: {required_sigma_eta"),
    ] {
        let text = format!("campaign: short\n{line}\n");
        one("campaign: short\n", &text, Kind::UnknownKey, key, "no longer known", remedy);
    }
    let ends = "timing: {dwell: 120 s, ends: when_certain}";
    one("timing: {dwell: 120 s}", ends, Kind::UnknownKey, "ends", "no longer known", "time_budget");
}

#[test]
fn orders_and_repeats_fit_the_rest() {
    let (text, _) = with(
        "campaign: short\n",
        "campaign: short\nrepeats: {jump: {from: {speed: 90 krpm, opening: 0.7}, to: {speed: 90000 rpm, opening: 0.7}}}\n",
    );
    let findings = mistakes(&text);
    assert!(findings.to_string().contains("ends where it starts"), "{findings}");
    let (text, _) = with("campaign: short\n", "campaign: short\nrepeats: off\norder: listed\n");
    assert_eq!(run(&text).unwrap_or_else(|findings| panic!("{findings}")).repeats, None);
    // Silence switches nothing off.
    let silent = run(RIGHT).unwrap_or_else(|findings| panic!("{findings}")).repeats.unwrap();
    assert_eq!((silent.jump, silent.at_least), (None, 2));
}

/// What no machine does is a mistake: 44 cm at 110 krpm are pi 0.44 110e3/60 = 2534 m/s.
#[test]
fn doomed_campaigns_are_refused_with_their_numbers() {
    one(
        "machine: {name: a, map: closed_form}",
        "machine: {name: a, map: closed_form, geometry: {compressor: {wheel_diameter: 44 cm}}}",
        Kind::Implausible,
        "44 cm",
        "wheel of 440 mm has a tip speed of 2534 m/s at the grid's highest speed, 110.0 krpm",
        "lower the highest speed",
    );
    one("dwell: 120 s", "dwell: 9 s", Kind::Implausible, "9 s", "shorter than the 40 s", "at least 40 s");
    let table = "machine: {name: a, map: {file: maps/there.csv, reference: SAE}}";
    for (speed, message) in [("60 krpm", "begins at 80.0 krpm"), ("140 krpm", "ends at 120.0 krpm")] {
        let (text, _) = with("machine: {name: a, map: closed_form}", table);
        let findings = mistakes(&text.replace("[90 krpm, 110 krpm]", &format!("[90 krpm, {speed}]")));
        assert_eq!(findings.list.len(), 1, "{findings}");
        let finding = &findings.list[0];
        assert_eq!(
            (finding.kind, finding.path.as_str()),
            (Kind::Implausible, "grid.speeds[1]"),
            "{findings}"
        );
        assert!(
            finding.message.contains(message)
                && finding.message.contains(&format!("{}.0", &speed[..speed.len() - 5])),
            "{findings}"
        );
    }
}

/// What few machines do is a warning at its key, and the campaign is one that can be run.
/// A wheel in cm would leave no line of the map within reach; the wheel is named, not each line.
#[test]
fn a_wheel_that_does_not_fit_its_map_is_one_mistake() {
    one(
        "machine: {name: a, map: closed_form}",
        "machine: {name: a, map: {file: maps/there.csv, reference: SAE}, geometry: {compressor: {wheel_diameter: 6 mm}}}",
        Kind::Implausible,
        "maps/there.csv",
        "times too large for a wheel of 6 mm",
        "wheel_diameter",
    );
}

#[test]
fn rare_values_are_warned_of() {
    let warned = |old: &str, new: &str| {
        let (text, _) = with(old, new);
        let campaign = run(&text).unwrap_or_else(|findings| panic!("{findings}"));
        (warnings(&text, Path::new("dir/short.yaml"), &campaign, Vec::new()), text)
    };
    assert_eq!(warned("campaign: short", "campaign: short").0.count(), 0);
    let geometry = |inside: &str| format!("machine: {{name: a, map: closed_form, geometry: {inside}}}");
    for (old, new, at, message) in [
        (
            "timing: {dwell: 120 s}",
            "timing: {dwell: 30 s}\nidentification: {method: dynamic}".to_owned(),
            "30 s",
            "every point would be doubtful",
        ),
        (
            "machine: {name: a, map: closed_form}",
            geometry("{compressor: {housing_mass: 93 kg}}"),
            "93 kg",
            "the housing of the compressor is 93 kg; with a compressor wheel of 52 mm 0.093 to 9.3 kg would be usual",
        ),
        (
            "machine: {name: a, map: closed_form}",
            // A table stays as it is; a closed form would grow with the wheel.
            "machine: {name: a, map: {file: maps/there.csv, reference: SAE}, geometry: {compressor: {wheel_diameter: 110 mm}, turbine: {choked_flow: 0.078 kg/s, wheel_radius: 23.5 mm}, outlet: {valve_area: 0.4e-3 m^2}}}".to_owned(),
            "110 mm",
            "tip speed of 634 m/s",
        ),
        (
            "machine: {name: a, map: closed_form}",
            geometry("{turbine: {peak_efficiency: 0.95}}"),
            "0.95",
            "above that of any turbine",
        ),
    ] {
        let (found, text) = warned(old, &new);
        assert_eq!(found.count(), 1, "{new}: {found}");
        let finding = &found.list[0];
        assert!(finding.kind == Kind::Unusual && finding.kind.is_warning(), "{found}");
        assert_eq!(&text[finding.span.start..finding.span.start + at.len()], at, "{found}");
        assert!(finding.message.contains(message), "{found}");
        let shown = found.to_string();
        assert!(shown.starts_with("warning: ") && shown.ends_with("dir/short.yaml: 1 warning\n"), "{shown}");
    }
    // Warnings of other checks of the campaign appear with these.
    let campaign = run(RIGHT).unwrap_or_else(|findings| panic!("{findings}"));
    let concern = Concern::warning(&["timing", "dwell"], "too long a night".to_owned(), "sleep".to_owned());
    let found = warnings(RIGHT, Path::new("dir/short.yaml"), &campaign, vec![concern]);
    assert!(found.to_string().contains("timing.dwell: too long a night"), "{found}");
}

#[test]
fn several_sensors() {
    for (sensors, kind, place, message, remedy) in [
        (
            "[{noise: 0.1 K}, {noise: 0.1 K, count: 2}]",
            Kind::Conflict,
            "2",
            "`count` has no effect here",
            "leave `count` out",
        ),
        ("{noise: 0.1 K, name: A}", Kind::Conflict, "A", "`name` has no effect here", "write a list"),
        ("{noise: 0.1 K, count: 17}", Kind::Range, "17", "is too high", "at most 16"),
        ("{noise: 0.1 K, count: 0}", Kind::Range, "0", "is too low", "at least 1"),
        (
            "[{noise: 0.1 K, name: A}, {noise: 0.2 K, name: A}]",
            Kind::Conflict,
            "A",
            "another sensor of T1 is called `A` too",
            "its own name",
        ),
        (
            "[{noise: 0.1 K, common_offset: 0.1 K}, {noise: 0.1 K, common_offset: 0.2 K}]",
            Kind::Conflict,
            "0.2 K",
            "`common_offset` is 0.1 K for another sensor of T1",
            "the same value",
        ),
        (
            "[{noise: 0.1 K}, {nois: 0.1 K}]",
            Kind::UnknownKey,
            "nois",
            "`sensors.T1[1]`",
            "did you mean `noise`?",
        ),
    ] {
        one("  T1: {noise: 0.1 K}", &format!("  T1: {sensors}"), kind, place, message, remedy);
    }
}

#[test]
fn keys() {
    one(
        "  inlet_pressure: 100 kPa",
        "  inlet_presure: 100 kPa",
        Kind::UnknownKey,
        "inlet_presure",
        "no key `inlet_presure` in `boundary`",
        "did you mean `inlet_pressure`?",
    );
    one(
        "  Tc: {noise: 0.15 K}",
        "  Tc: {noise: 0.15 K}\n  T9: {noise: 1 K}",
        Kind::UnknownKey,
        "T9",
        "no key `T9` in `sensors`",
        "T_oil",
    );
    one(
        "  Tc: {noise: 0.15 K}",
        "  Tc: {noise: 0.15 K, nois: 1 K}",
        Kind::UnknownKey,
        "nois",
        "`sensors.Tc`",
        "did you mean `noise`?",
    );
    one(
        "  inlet_pressure: 100 kPa",
        "  inlet_pressure: 100 kPa\n  inlet_pressure: 101 kPa",
        Kind::DuplicateKey,
        "inlet_pressure",
        "second time",
        "remove one",
    );
    one(
        "campaign: short\n",
        "name: short\ncampaign: x\n",
        Kind::UnknownKey,
        "name",
        "no key `name` in a campaign",
        "the keys are",
    );
}

#[test]
fn missing_keys_are_reported_at_their_mapping() {
    let (text, _) = with("  oil_temperature: 50 degC\n", "");
    let findings = mistakes(&text);
    let finding = &findings.list[0];
    assert_eq!(
        (finding.kind, finding.line, finding.column, findings.list.len()),
        (Kind::MissingKey, 3, 1, 1)
    );
    assert!(finding.remedy.contains("write e.g. `oil_temperature: 50 degC`"), "{findings}");
    let (text, line) = with("  T2: {noise: 0.1 K}", "  T2: {}");
    let findings = mistakes(&text);
    assert_eq!(
        (findings.list[0].kind, findings.list[0].line, findings.list[0].column),
        (Kind::MissingKey, line, 3)
    );
    let (text, _) = with("  Tc: {noise: 0.15 K}\n", "");
    assert!(mistakes(&text).list[0].remedy.contains("write e.g. `Tc: {noise: 0.1 K}`"));
    let (text, line) =
        with("machine: {name: a, map: closed_form}", "machine: {name: a, map: {file: maps/there.csv}}");
    let findings = mistakes(&text);
    assert_eq!((findings.list[0].line, findings.list[0].column), (line, 20), "{findings}");
    for choice in ["SAE (298 K, 100 kPa)", "Garrett (545 degR, 13.95 psia)", "BorgWarner (293 K, 98.1 kPa)"] {
        assert!(findings.list[0].remedy.contains(choice), "{findings}");
    }
}

#[test]
fn units() {
    one("dwell: 120 s", "dwell: 120", Kind::Unit, "120", "`120` has no unit", "write e.g. `120 s`");
    one("dwell: 120 s", "dwell: 120 K", Kind::Unit, "120 K", "not a unit of a time", "s, ms, min, h");
    one(
        "dwell: 120 s",
        "dwell: -1 s",
        Kind::Range,
        "-1 s",
        "`-1 s` is too low",
        "above 0 s and at most 24 h",
    );
    one("dwell: 120 s", "dwell:", Kind::WrongType, "dwell", "no value", "e.g. `40 s`, or remove the key");
    one(
        "dwell: 120 s",
        "dwell: [120 s]",
        Kind::WrongType,
        "dwell",
        "a list is given where a time is needed",
        "e.g. `40 s`",
    );
    one(
        "inlet_temperature: 25 degC\n  inlet_p",
        "inlet_temperature: 25 kPa\n  inlet_p",
        Kind::Unit,
        "25 kPa",
        "not a unit of a temperature",
        "K, degC, degF, degR",
    );
    one(
        "inlet_temperature: 25 degC\n  inlet_p",
        "inlet_temperature: 25 K\n  inlet_p",
        Kind::Range,
        "25 K",
        "too low",
        "at least 200 K and at most 400 K",
    );
    one(
        "T1: {noise: 0.1 K}",
        "T1: {noise: 0.1 K, offset: 0.25 degC}",
        Kind::Unit,
        "0.25 degC",
        "`degC` is not a unit of a temperature difference",
        "not a difference of two",
    );
    one("T1: {noise: 0.1 K}", "T1: {noise: -0.1 K}", Kind::Range, "-0.1 K", "too low", "at least 0 K");
    one("inlet_pressure: 100 kPa", "inlet_pressure: 1 barg", Kind::Unit, "1 barg", "`barg`", "absolute");
    one("[90 krpm, 110 krpm]", "[90 krpm, 110]", Kind::Unit, "110", "has no unit", "`110 krpm`");
}

#[test]
fn types_and_names() {
    one(
        "campaign: short\n",
        "campaign: a/b\n",
        Kind::WrongValue,
        "a/b",
        "`a/b` is not of the form",
        "Letters, digits",
    );
    one(
        "campaign: short\n",
        "campaign: 7\n",
        Kind::WrongType,
        "7",
        "`7` is a number, but text is needed",
        "quotes: `\"7\"`",
    );
    one(
        "campaign: short\n",
        "campaign: short\norder: lsited\n",
        Kind::WrongValue,
        "lsited",
        "not one of thermal_gradient, speed_lines, listed, conventional",
        "did you mean `listed`?",
    );
    one(
        "map: closed_form",
        "map: closedform",
        Kind::WrongValue,
        "closedform",
        "`closedform` is not one of closed_form",
        "did you mean `closed_form`?",
    );
    one("map: closed_form", "map: 3", Kind::WrongType, "3", "`3` is not one of the forms", "closed_form");
    one("[0.7, 1.0]", "[0.7, 2.6]", Kind::Range, "2.6", "2.6 is too high", "at most 2.5");
    one("[0.7, 1.0]", "[0.7, -0.1]", Kind::Range, "-0.1", "-0.1 is too low", "above 0");
    one("[0.7, 1.0]", "[0.7, .nan]", Kind::WrongValue, ".nan", "not a finite number", "write a number");
    one(
        "[0.7, 1.0]",
        "[0.7, 50 %]",
        Kind::WrongType,
        "50 %",
        "text, but a plain number",
        "above 0, at most 2.5",
    );
    one("backend: {virtual_lab: {}}", "backend: {}", Kind::Range, "backend", "empty", "virtual_lab");
    one(
        "backend: {virtual_lab: {}}",
        "backend: {virtual_lab: {}, replay: {}}",
        Kind::Range,
        "backend",
        "too many",
        "exactly 1",
    );
    one(
        "campaign: short\n",
        "campaign: short\nreport: {calibration: {T2: 2026-02-30}}\n",
        Kind::WrongValue,
        "2026-02-30",
        "not a calendar date",
        "2026-09-01",
    );
    one(
        "T1: {noise: 0.1 K}",
        "T1: {noise: 0.1 K, calibration: {date: 2027-01-31, due: 2026-01-31}}",
        Kind::Conflict,
        "2026-01-31",
        "before its day 2027-01-31",
        "exchange the days",
    );
    one(
        "T1: {noise: 0.1 K}",
        "T1: {noise: 0.1 K, calibration: {date: 2026-01-31, range: {min: 0 degC, max: 9 kPa}}}",
        Kind::Unit,
        "9 kPa",
        "not a unit of a temperature",
        "degC",
    );
    one(
        "campaign: short\n",
        "campaign: short\nreport: {calibration: {T2: yesterday}}\n",
        Kind::WrongValue,
        "yesterday",
        "not of the form",
        "2026-09-01",
    );
    one(
        "campaign: short\n",
        "campaign: short\nreport: {calibration: {X2: 2026-02-03}}\n",
        Kind::UnknownKey,
        "X2",
        "no key `X2`",
        "did you mean",
    );
    one(
        "campaign: short\n",
        "campaign: short\ndisplay: {pressure: kpa}\n",
        Kind::WrongValue,
        "kpa",
        "`kpa` is not one of",
        "did you mean `kPa`?",
    );
    one("campaign: short\n", "campaign: short\nseed: -1\n", Kind::Range, "-1", "too low", "at least 0");
}

#[test]
fn what_must_fit_together() {
    one(
        "[90 krpm, 110 krpm]",
        "[90 krpm, 90000 rpm]",
        Kind::Duplicate,
        "90000 rpm",
        "appears twice",
        "remove one",
    );
    one("[0.7, 1.0]", "[0.7, 0.70]", Kind::Duplicate, "0.70", "appears twice", "remove one");
    one("  openings: [0.7, 1.0]", "  openings: []", Kind::Range, "openings", "empty", "0.5");
    one(
        "[90 krpm, 110 krpm]",
        "[90 krpm, 190 krpm]",
        Kind::Range,
        "190 krpm",
        "above `limits.speed`, `180 krpm`",
        "lower it",
    );
    one(
        "  openings: [0.7, 1.0]\n",
        "  openings: [0.7, 1.0]\n  skip: [{speed: 91 krpm, opening: 0.7}]\n",
        Kind::Conflict,
        "{speed",
        "do not contain the point",
        "name a speed",
    );
    one(
        "  openings: [0.7, 1.0]\n",
        "  openings: [0.7, 1.0]\n  points: [{speed: 91 krpm, opening: 0.7}]\n",
        Kind::Conflict,
        "points",
        "together with",
        "`speeds` and `openings`, or `points`",
    );
    one(
        "  speeds: [90 krpm, 110 krpm]\n  openings: [0.7, 1.0]\n",
        "  points:\n    - {speed: 90 krpm, opening: 1}\n    - {speed: 90000 rpm, opening: 1.0}\n",
        Kind::Duplicate,
        "{speed",
        "appears twice",
        "remove one",
    );
    one(
        "  openings: [0.7, 1.0]\n",
        "  skip: [{speed: 90 krpm, opening: 0.7}, {speed: 110 krpm, opening: 0.7}]\n  openings: [0.7]\n",
        Kind::Conflict,
        "skip",
        "every point",
        "at least one",
    );
    one(
        "map: closed_form",
        "map: {file: maps/gone.csv, reference: SAE}",
        Kind::MissingFile,
        "maps/gone.csv",
        "`dir/maps/gone.csv` cannot be read",
        "relative to the campaign file",
    );
    one(
        "map: closed_form",
        "map: {file: maps/bad.csv, reference: SAE}",
        Kind::WrongValue,
        "maps/bad.csv",
        "line 3: the mass flow",
        "mapper map inspect",
    );
    one(
        "P1: {noise: 20 Pa}",
        "P1: {noise: 20 Pa, tap: static}",
        Kind::MissingKey,
        "static",
        "inner diameter",
        "pipe_diameter: 40 mm",
    );
    one(
        "timing: {dwell: 120 s}",
        "timing: {dwell: 120 s}\nidentification: {window: {start: 10 s, end: 3 min}}",
        Kind::Conflict,
        "3 min",
        "beyond the dwell of `120 s`",
        "timing.dwell",
    );
    one(
        "timing: {dwell: 120 s}",
        "timing: {dwell: 120 s}\nidentification: {window: {start: 50 s, end: 20 s}}",
        Kind::Conflict,
        "20 s",
        "not after its start at `50 s`",
        "after `start`",
    );
}

#[test]
fn limits_that_contradict_each_other() {
    let (text, line) = with("{min: 110 kPa, max: 500 kPa}", "{min: 300 kPa, max: 2 bar}");
    let findings = mistakes(&text);
    assert_eq!(findings.list.len(), 1, "{findings}");
    assert_eq!(
        (findings.list[0].kind, findings.list[0].line, findings.list[0].column),
        (Kind::Conflict, line, 47)
    );
    assert!(
        findings.list[0].message.contains("`2 bar` is not above the lowest pressure, `300 kPa`"),
        "{findings}"
    );
    let (text, _) = with("  speed: 180 krpm\n", "  turbine_inlet_temperature: 450 degC\n  speed: 180 krpm\n");
    let findings = mistakes(&text);
    assert_eq!(
        (findings.list.len(), findings.list[0].line, findings.list[0].column),
        (1, 6, 30),
        "{findings}"
    );
}

#[test]
fn a_grid_without_points_says_which_forms_there_are() {
    let (text, line) = with("grid:\n  speeds: [90 krpm, 110 krpm]\n  openings: [0.7, 1.0]\n", "grid: {}\n");
    let findings = mistakes(&text);
    assert_eq!(
        (findings.list.len(), findings.list[0].line, findings.list[0].column),
        (1, line, 1),
        "{findings}"
    );
    assert!(findings.list[0].remedy.contains("`speeds` and `openings`, or `points`"), "{findings}");
}

#[test]
fn yaml_that_a_campaign_does_not_use() {
    one("dwell: 120 s", "dwell: &d 120 s", Kind::Unsupported, "&d", "anchors", "write the value out");
    one("dwell: 120 s", "dwell: *d", Kind::Syntax, "*d", "", "");
    one("campaign: short\n", "campaign: !!str short\n", Kind::Unsupported, "!!str", "tags", "remove the tag");
    let findings = mistakes(&format!("{RIGHT}---\na: b\n"));
    assert_eq!((findings.list[0].kind, findings.list[0].line), (Kind::Unsupported, 25), "{findings}");
    let (text, _) = with("timing: {dwell: 120 s}", "timing: &t {dwell: 120 s}\nidentification: {<<: *t}");
    let kinds: Vec<_> = mistakes(&text).list.iter().map(|finding| finding.kind).collect();
    assert_eq!(kinds, [Kind::Unsupported, Kind::Unsupported, Kind::Unsupported]);
}

/// YAML 1.2.2, sections 5.5 and 7.4.2: a tab separates as a space does, and a flow mapping may leave a value out.
#[test]
fn separating_tabs_and_empty_values_are_read() {
    let (text, line) = with("timing: {dwell: 120 s}", "timing:\t{dwell:\t120 s}\t# a\tremark");
    assert_eq!(run(&text).unwrap_or_else(|findings| panic!("{findings}")).timing.dwell, Dwell::Fixed(120.0));
    let findings = mistakes(&text.replace("120 s", "120 K"));
    assert_eq!((findings.list[0].line, findings.list[0].column), (line, 17), "{findings}");
    assert!(run(&with("{virtual_lab: {}}", "{virtual_lab:}").0).is_ok());
}

/// Refused YAML does not hide other mistakes, and aliases expand to nothing.
#[test]
fn refused_yaml_leaves_the_other_mistakes() {
    let text = RIGHT.replace("dwell: 120 s", "dwell: 120").replace("25 degC", "&t 25 degC");
    let text = text
        .replace("oil_temperature: 50 degC", "oil_temperature: *t")
        .replace("{noise: 30 rpm}", "!x {noise: 30}");
    let found: Vec<(Kind, usize)> =
        mistakes(&text).list.iter().map(|found| (found.kind, found.line)).collect();
    let refused = [4, 8, 10].map(|line| (Kind::Unsupported, line));
    assert_eq!(found, [&refused[..], &[(Kind::Unit, 10), (Kind::Unit, 21)]].concat());
    let bomb: String = (1..40).map(|n| format!("a{n}: &a{n} [*a{0}, *a{0}]\n", n - 1)).collect();
    assert!(
        mistakes(&format!("a0: &a0 [x]\n{bomb}")).list.iter().any(|found| found.kind == Kind::Unsupported)
    );
    // YAML 1.1 breaks the line here, where YAML 1.2 continues the comment.
    let hidden = format!("a: b #\u{85}{}", "[".repeat(500_000));
    assert_eq!(mistakes(&hidden).list[0].kind, Kind::Unsupported);
}

#[test]
fn malformed_text_has_a_place() {
    for (text, line) in [
        ("a: [1, 2\n", 2),
        ("a: b\n\tc: d\n", 2),
        ("a:\n  b: 1\n\tc: 2\n", 3),
        ("a:\n  b: |\n    x\n\ty\n", 4),
        ("a: 'x\n", 1),
        ("a: b: c\n", 1),
        ("{a: b}}\n", 1),
    ] {
        let findings = mistakes(text);
        assert_eq!(findings.list[0].kind, Kind::Syntax, "{text:?} {findings}");
        assert_eq!(findings.list[0].line, line, "{text:?} {findings}");
    }
    assert_eq!(mistakes("").list[0].message, "the file is empty");
    assert_eq!(mistakes("just text").list[0].kind, Kind::WrongType);
    assert_eq!(mistakes(&"- ".repeat(5000)).list[0].kind, Kind::TooLarge);
    assert_eq!(mistakes(&format!("{}{}", "[".repeat(50), "]".repeat(50))).list[0].kind, Kind::TooLarge);
    assert_eq!(mistakes(&"[".repeat(5000)).list.len(), 1);
    assert_eq!(mistakes(&"a: ".repeat(5000)).list[0].kind, Kind::Syntax);
    assert_eq!(mistakes(&"a".repeat(2 << 20)).list[0].kind, Kind::TooLarge);
}

/// 141 speeds at 141 openings are a month on the rig, and more pairs than a planner compares: refused with both.
#[test]
fn a_grid_without_end_is_refused_with_an_estimate() {
    let list = |first: f64, step: f64, unit: &str| {
        let values: Vec<String> =
            (0..141).map(|i| format!("{:.4}{unit}", first + step * f64::from(i))).collect();
        format!("[{}]", values.join(", "))
    };
    let text = RIGHT
        .replace("[90 krpm, 110 krpm]", &list(50.0, 0.5, " krpm"))
        .replace("[0.7, 1.0]", &list(0.5, 0.01, ""));
    let findings = mistakes(&text);
    let found = findings.list.iter().find(|finding| finding.kind == Kind::TooLarge).unwrap();
    // 19 881 points of 120 s.
    assert!(found.message.contains("19881") && found.message.contains("27.6 days"), "{findings}");
}

#[test]
fn all_mistakes_come_in_one_go_and_in_the_order_of_the_text() {
    let text = RIGHT
        .replace("campaign: short", "campaign: short\nordre: greedy")
        .replace("25 degC", "25")
        .replace("100 kPa", "14.5 psi")
        .replace("  Tc: {noise: 0.15 K}\n", "")
        .replace("[90 krpm, 110 krpm]", "[90 krpm, 90 krpm, 200 krpm]")
        .replace("120 s", "120");
    let findings = mistakes(&text);
    let found: Vec<(Kind, usize, &str)> =
        findings.list.iter().map(|f| (f.kind, f.line, f.path.as_str())).collect();
    assert_eq!(
        found,
        [
            (Kind::UnknownKey, 2, "ordre"),
            (Kind::Unit, 5, "boundary.inlet_temperature"),
            (Kind::Unit, 6, "boundary.inlet_pressure"),
            (Kind::MissingKey, 10, "sensors"),
            (Kind::Duplicate, 19, "grid.speeds[1]"),
            (Kind::Range, 19, "grid.speeds[2]"),
            (Kind::Unit, 21, "timing.dwell"),
        ],
        "{findings}"
    );
}

#[test]
fn a_finding_is_shown_with_file_line_source_and_carets() {
    let (text, line) = with("dwell: 120 s", "dwell: 120 K");
    let shown = mistakes(&text).to_string();
    assert!(shown.contains(&format!("dir/short.yaml:{line}:17")), "{shown}");
    assert!(shown.contains("timing: {dwell: 120 K}"), "{shown}");
    assert!(shown.contains("^^^^^"), "{shown}");
    assert!(shown.contains("timing.dwell: `K` is not a unit of a time"), "{shown}");
    assert!(shown.ends_with("dir/short.yaml: 1 mistake\n"), "{shown}");
    assert!(!shown.contains('\u{1b}'), "{shown}");
    assert!(mistakes(&text).render(true).contains('\u{1b}'));
}

#[test]
fn carets_stand_under_the_value_after_letters_of_several_bytes_and_with_other_line_ends() {
    let (text, line) = with(
        "campaign: short\n",
        "description: Prüfstand №3 – größer\ncampaign: short\nx: {ä: °, order: 1}\n",
    );
    let findings = mistakes(&text.replace('\n', "\r\n"));
    let finding: &Finding = &findings.list[0];
    assert_eq!((finding.line, finding.column, finding.path.as_str()), (line + 2, 1, "x"), "{findings}");
    let (text, _) = with("T2: {noise: 0.1 K}", "T2: {probe_diameter: 5 µm, noise: 0.1 °C}");
    let findings = mistakes(&format!("\u{feff}{}", text.replace('\n', "\r\n")));
    assert_eq!(
        (findings.list.len(), findings.list[0].line, findings.list[0].column),
        (1, 15, 37),
        "{findings}"
    );
}

#[test]
fn unreachable_points_are_complained_about_at_their_entry() {
    let (text, line) = with("max: 500 kPa", "max: 180 kPa");
    let findings = mistakes(&text);
    assert!(findings.list.iter().all(|finding| finding.kind == Kind::Unreachable), "{findings}");
    // A second implementation of the model holds 110 krpm with 173.7 kPa at opening 0.7 and 185.4 kPa at opening 1,
    // 90 krpm with 152.4 and 160.4 kPa.
    assert_eq!(findings.list.len(), 1, "{findings}");
    assert_eq!(findings.list[0].path, "grid.speeds[1]", "{findings}");
    assert_eq!((findings.list[0].line, findings.list[0].column), (19, 21), "{findings}");
    assert!(
        findings.list[0].message.contains("110 krpm, valve area 100 % needs P3 = 185.4 kPa"),
        "{findings}"
    );
    assert!(
        findings.list[0].message.contains("above `limits.turbine_inlet_pressure.max` = 180 kPa"),
        "{findings}"
    );
    assert_eq!(line, 24);
    // A caller that knows better decides itself.
    assert!(check_with(&text, Path::new("dir/short.yaml"), &files, &|_| Vec::new()).is_ok());
}

#[test]
fn a_table_is_read_with_its_reference_state_and_its_points_are_judged() {
    let (text, _) = with(
        "map: closed_form",
        "map: {file: maps/there.csv, reference: {temperature: 20 degC, pressure: 1 bar}}",
    );
    let campaign = run(&text).unwrap_or_else(|findings| panic!("{findings}"));
    let MapSource::Table { path, text: table, reference, .. } = &campaign.machine.map else {
        panic!("a table")
    };
    assert_eq!((path.as_path(), table.as_str()), (Path::new("dir/maps/there.csv"), TABLE));
    assert_eq!((reference.t_ref_k, reference.p_ref_pa), (293.15, 100_000.0));
    let findings = mistakes(&text.replace("max: 500 kPa", "max: 115 kPa"));
    assert!(findings.list.iter().all(|finding| finding.kind == Kind::Unreachable), "{findings}");
    // All points are out of reach: the limit is named, not each point.
    assert_eq!(findings.list.len(), 1, "{findings}");
    assert_eq!(findings.list[0].path, "limits.turbine_inlet_pressure.max", "{findings}");
}

/// What a map file leaves open stands in a map description.
#[test]
fn a_description_completes_a_map_file() {
    let described = |description: &str| {
        let new = format!("map: {{file: maps/open.csv, reference: SAE{description}}}");
        with("map: closed_form", &new).0
    };
    let plain = with("map: closed_form", "map: {file: maps/there.csv, reference: SAE}").0;
    let [open, plain] = [described(", description: maps/open.yaml"), plain].map(|text| {
        let campaign = run(&text).unwrap_or_else(|findings| panic!("{findings}"));
        campaign.machine.map.table().unwrap().unwrap().speeds_corrected_rpm()
    });
    assert_eq!(open, plain);
    for (description, at) in [
        ("", "machine.map.file"),
        (", description: maps/wrong.yaml", "machine.map.description"),
        (", description: maps/gone.yaml", "machine.map.description"),
    ] {
        let findings = mistakes(&described(description));
        assert_eq!((findings.list.len(), findings.list[0].path.as_str()), (1, at), "{findings}");
    }
}

#[test]
fn named_reference_states_are_those_the_makers_print() {
    for (name, t_ref_k, p_ref_pa) in
        [("SAE", 298.0, 100e3), ("Garrett", 302.778, 96_182.0), ("BorgWarner", 293.0, 98_100.0)]
    {
        let campaign = run(&format!("{RIGHT}reference: {name}\n")).unwrap();
        // 545 degR and 13.95 psia in K and Pa, to the digits written here.
        assert!((campaign.reference.t_ref_k - t_ref_k).abs() < 1e-3, "{name}");
        assert!((campaign.reference.p_ref_pa - p_ref_pa).abs() < 1.0, "{name}");
    }
}

/// Molar gas constant over the molar masses: 8.314462618/0.0289652 and, with 10 % of hydrogen, /0.0262703 (CODATA, IUPAC).
#[test]
fn a_gas_is_air_or_a_mixture_whose_fractions_add_up() {
    let gas_of = |text: &str| {
        let campaign = run(&format!("{RIGHT}gas: {text}\n")).unwrap_or_else(|findings| panic!("{findings}"));
        campaign.machine.params
    };
    let constant = |text: &str| gas_of(text).compressor.gas.gas_constant_j_kgk;
    // The standard's air has less carbon dioxide than today's: 0.015.
    assert!((constant("{compressor: air}") - 287.05).abs() < 0.02);
    let mixture = "{compressor: {N2: 70.28 %, O2: 18.84 %, Ar: 0.84 %, CO2: 0.04 %, H2: 10 %}}";
    assert!((constant(mixture) - 316.50).abs() < 0.05, "{}", constant(mixture));
    // Burnt diesel has less oxygen and more carbon dioxide, which is heavier, and water, which is lighter: its gas constant is that of air within
    // 0.5 %, its heat capacity larger.
    let burnt = gas_of("{turbine: {fuel: diesel, air_ratio: 2}}").turbine.gas;
    let air = gas_of("{compressor: air}").compressor.gas;
    assert!((burnt.gas_constant_j_kgk / air.gas_constant_j_kgk - 1.0).abs() < 5e-3);
    assert!((1.02..1.06).contains(&(burnt.heat_capacity_j_kgk(900.0) / air.heat_capacity_j_kgk(900.0))));
    let findings = mistakes(&format!("{RIGHT}gas: {{compressor: {{N2: 78 %, O2: 2.1 %}}}}\n"));
    assert_eq!((findings.list.len(), findings.list[0].kind), (1, Kind::Conflict), "{findings}");
}

#[test]
fn where_the_schema_is_wider_than_the_reader_the_reader_complains() {
    // For a JSON schema 1.0 is a whole number.
    let findings = mistakes(&format!("{RIGHT}seed: 1.0\n"));
    assert_eq!((findings.list.len(), findings.list[0].kind), (1, Kind::WrongValue), "{findings}");
}

#[test]
fn a_hostile_file_is_refused_in_time_and_in_few_words() {
    // The last two are above the limit of 100,000 values.
    let keys: String = (0..20_000).map(|i| format!("k{i}: 1\n")).collect();
    let aliases = format!("a: &a 1\nb: [{}]", "*a,".repeat(101_000));
    let items = format!("grid: {{speeds: [{}]}}", "1,".repeat(101_000));
    let bomb = "a: &a [x,x]\nb: &b [*a,*a]\nc: &c [*b,*b]\n";
    for text in [keys.as_str(), &aliases, &items, bomb] {
        let findings = mistakes(text);
        assert!(!findings.list.is_empty() && findings.list.len() <= Findings::LIMIT);
        assert!(findings.to_string().len() < 1 << 20);
    }
    assert!(!mistakes("a: \u{7}\u{1b}[31m").to_string().contains('\u{1b}'));
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig::with_cases(300))]

    #[test]
    fn any_text_gives_an_answer(text in "\\PC{0,200}") {
        let _ = run(&text).map_err(|findings| findings.to_string());
    }

    #[test]
    fn any_bytes_give_an_answer(bytes in proptest::collection::vec(proptest::prelude::any::<u8>(), 0..300)) {
        let _ = run(&String::from_utf8_lossy(&bytes)).map_err(|findings| findings.to_string());
    }

    #[test]
    fn any_piece_of_yaml_gives_an_answer(text in "([a-c?&*!|>%@`#'\"-]|: |- |\\[|\\]|\\{|\\}|, |\n|\n  |\t|<<: |---|1|µ){0,60}") {
        let _ = run(&text).map_err(|findings| findings.to_string());
    }

    #[test]
    fn a_campaign_with_a_hole_gives_an_answer(from in 0usize..RIGHT.len(), length in 0usize..40, put in "[ -~\n]{0,6}") {
        let mut text = RIGHT.to_owned();
        text.replace_range(from..(from + length).min(RIGHT.len()), &put);
        match run(&text) {
            Ok(campaign) => proptest::prop_assert!(!campaign.points.is_empty()),
            Err(findings) => {
                proptest::prop_assert!(!findings.list.is_empty());
                let lines = text.matches('\n').count() + 1;
                proptest::prop_assert!(findings.list.iter().all(|f| f.line >= 1 && f.line <= lines));
                let _ = findings.to_string();
            }
        }
    }
}

#[test]
fn an_unknown_format_is_reported_with_its_place() {
    let text = format!("{RIGHT}outputs: {{formats: [csv, cvs]}}\n");
    let campaign = run(&text).unwrap();
    let findings = mapper_campaign::format_mistake(
        &text,
        Path::new("a.yaml"),
        campaign.outputs.formats[1].name(),
        &["csv"],
    );
    let line = text.lines().position(|line| line.contains("cvs")).unwrap() + 1;
    let finding = &findings.list[0];
    assert_eq!((findings.list.len(), finding.line, finding.path.as_str()), (1, line, "outputs.formats[1]"));
    assert!(finding.message.contains("`cvs`") && finding.remedy.contains("csv"), "{findings}");
}

/// A grid of lines in place of the short campaign's.
fn lines(grid: &str) -> String {
    with("  speeds: [90 krpm, 110 krpm]\n  openings: [0.7, 1.0]\n", grid).0
}

#[test]
fn lines_become_points_from_choke_to_surge_at_their_corrected_speed() {
    let text = lines(
        "  lines: [{speed_corrected: 90 krpm, points: 3}, {speed_corrected: 110 krpm, spacing: 20 g/s}]\n",
    );
    let campaign = run(&text).unwrap_or_else(|findings| panic!("{findings}"));
    let first = &campaign.points[..3];
    // SAE's 298 K against a T1 of 298.15 K.
    assert!(
        first.iter().all(|point| (point.speed_rpm / (90e3 * (298.15f64 / 298.0).sqrt()) - 1.0).abs() < 1e-12)
    );
    assert_eq!(first[0].valve_opening_ratio, 2.5);
    assert!(first.windows(2).all(|pair| pair[1].valve_opening_ratio < pair[0].valve_opening_ratio));
    assert!(campaign.points[3..].iter().all(|point| point.speed_rpm > first[0].speed_rpm));
    assert_eq!(warnings(&text, Path::new("dir/short.yaml"), &campaign, Vec::new()).count(), 0);
    // Openings in addition: nothing of this is in the campaign, nor in its hash.
    assert!(!serde_json::to_string(&run(RIGHT).unwrap()).unwrap().contains("\"lines\""));
}

#[test]
fn lines_that_have_no_points_are_refused_at_their_place() {
    let grid = "  speeds: [90 krpm, 110 krpm]\n  openings: [0.7, 1.0]\n";
    let line = |text: &str| format!("  lines: [{text}]\n");
    for (text, kind, at, message, remedy) in [
        (
            "{speed_corrected: 90 krpm, points: 3, spacing: 8 g/s}",
            Kind::Conflict,
            "spacing",
            "both `points` and `spacing`",
            "number of points or their spacing",
        ),
        (
            "{speed_corrected: 90 krpm}",
            Kind::MissingKey,
            "{speed_corrected: 90",
            "neither `points` nor `spacing`",
            "points: 6",
        ),
        (
            "{speed_corrected: 90 krpm, points: 3}, {speed_corrected: 90000 rpm, points: 4}",
            Kind::Duplicate,
            "90000 rpm",
            "appears twice",
            "remove one",
        ),
        (
            "{speed_corrected: 190 krpm, points: 3}",
            Kind::Unreachable,
            "190 krpm",
            "190.05 krpm at T1 = 298.15 K, above `limits.speed`",
            "lower it",
        ),
        (
            "{speed_corrected: 110 krpm, spacing: 100 g/s}",
            Kind::Unreachable,
            "100 g/s",
            "gives one point",
            "smaller spacing",
        ),
        (
            "{speed_corrected: 110 krpm, spacing: 0.1 g/s}",
            Kind::Unreachable,
            "0.1 g/s",
            "at most 100",
            "wider spacing",
        ),
        (
            "{speed_corrected: 110 krpm, points: 3, widest_opening: 0.3}",
            Kind::Unreachable,
            "3, widest",
            "has no points",
            "raise `widest_opening`",
        ),
    ] {
        one(grid, &line(text), kind, at, message, remedy);
    }
    one(
        grid,
        "  lines: [{speed_corrected: 90 krpm, points: 3}]\n  openings: [0.7]\n",
        Kind::Conflict,
        "openings",
        "`openings` is given together with `lines`",
        "write",
    );
    one(
        grid,
        "  speeds: [90 krpm]\n  openings: [0.7, 1.0]\n  surge_margin: 5 %\n",
        Kind::Conflict,
        "surge_margin",
        "belongs to `lines`",
        "remove it",
    );
    // One mistake, although it would put the last point of each line beyond the surge line.
    one(
        grid,
        "  lines: [{speed_corrected: 90 krpm, points: 3}, {speed_corrected: 110 krpm, points: 3}]\n  surge_margin: -10 %\n",
        Kind::Conflict,
        "-10 %",
        "below `limits.surge_margin`, `0 %`",
        "lower the limit",
    );
}

/// The table begins at 80 krpm, corrected: 2.5 % below it openings are believed with a warning, the ends of a line are not.
#[test]
fn a_line_outside_the_nominal_map_is_refused() {
    let text = lines("  lines: [{speed_corrected: 78 krpm, points: 3}]\n")
        .replace("map: closed_form", "map: {file: maps/there.csv, reference: SAE}");
    let findings = mistakes(&text);
    assert_eq!((findings.list.len(), findings.list[0].kind), (1, Kind::Implausible), "{findings}");
    assert!(findings.list[0].path.ends_with("speed_corrected"), "{findings}");
    assert!(findings.list[0].message.contains("80.0 krpm"), "{findings}");
}
