//! Recommended next steps, as text.

use mapper_core::probability_text;
use mapper_diagnose::gap::{Diagnosis, Kind, Next, Suggestion};

/// 0 degC, K.
const ZERO_C_K: f64 = 273.15;

/// The chapter; empty if nothing remains to be decided.
pub(crate) fn next_text(diagnosis: &Diagnosis) -> String {
    let Some(next) = &diagnosis.next else { return String::new() };
    let mut text = "\nnext experiment\n".to_owned();
    match (next, diagnosis.experiments.first()) {
        (Next::Sensor { sensor, reason }, _) => {
            text += &format!("  {sensor}: {reason}\n");
            if diagnosis.baseline.is_none() {
                text += "  if the model's equations only approximate this rig: give a fault-free recording with --baseline, or declare what they may \
                         miss under `tolerances: structure`\n";
            }
        }
        (Next::Jump { .. } | Next::Soak { .. }, Some(first)) => {
            text += &format!(
                "  {}: {:.1} min, after which the true cause should reach {}\n",
                name_experiment(first),
                first.minutes,
                probability_text(first.expected_probability)
            );
            text += &describe_experiment(first);
        }
        (Next::Jump { .. } | Next::Soak { .. }, None) => {}
    }
    let Some(first) = diagnosis.experiments.first() else { return text };
    text += &format!(
        "  of {:.2} bit still open: bit per minute, in total, chance that the true cause then has 95 %\n",
        first.entropy_bit
    );
    for experiment in &diagnosis.experiments {
        text += &format!(
            "  {:>6.3} bit/min {:>5.2} bit {:>7}  {}, {:.1} min\n",
            experiment.entropy_drop_bit / experiment.minutes,
            experiment.entropy_drop_bit,
            probability_text(experiment.probability_settled),
            name_experiment(experiment),
            experiment.minutes,
        );
    }
    text
}

/// The action, in words.
pub(crate) fn name_experiment(experiment: &Suggestion) -> String {
    let Suggestion { from, to, .. } = experiment;
    let at = format!("at {:.0} krpm and opening {}", to.speed_rpm / 1e3, to.valve);
    let celsius = |change: Option<[f64; 2]>| {
        let [before_k, after_k] = change.unwrap_or([f64::NAN; 2]);
        format!("from {:.0} to {:.0} degC {at}", before_k - ZERO_C_K, after_k - ZERO_C_K)
    };
    let jump = || {
        format!(
            "jump from {:.0} krpm at opening {} to {:.0} krpm at {}",
            from.speed_rpm / 1e3,
            from.valve,
            to.speed_rpm / 1e3,
            to.valve
        )
    };
    match experiment.kind {
        Kind::Jump => jump(),
        Kind::ValveStep => {
            format!(
                "valve step from opening {} to {} at {:.0} krpm",
                from.valve,
                to.valve,
                to.speed_rpm / 1e3
            )
        }
        Kind::T3Step => format!("turbine inlet {}", celsius(experiment.t3_k)),
        Kind::OilStep => format!("oil {}", celsius(experiment.oil_temperature_k)),
        Kind::Sensor => {
            format!("a sensor for {}, and a {}", experiment.sensor.as_deref().unwrap_or("-"), jump())
        }
        Kind::Soak => {
            "a soak before the next run, which determines the offsets of the temperature sensors".to_owned()
        }
    }
}

/// How to run it.
fn describe_experiment(experiment: &Suggestion) -> String {
    let Suggestion { from, to, .. } = experiment;
    match experiment.kind {
        Kind::Jump | Kind::ValveStep => format!(
            "  mapper plan CAMPAIGN --append {:.0}krpm@{} {:.0}krpm@{} --out PLAN puts it after the points\n",
            from.speed_rpm / 1e3,
            from.valve,
            to.speed_rpm / 1e3,
            to.valve,
        ),
        Kind::Soak => {
            format!("  a line of the campaign, before it is run again: {}\n", experiment.script.join(" "))
        }
        _ => format!("  lines of a sequence, after the points: {}\n", experiment.script.join(" ")),
    }
}
