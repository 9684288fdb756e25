//! The next experiment of a diagnosis, and the sentences of its limits.

use crate::document::{Document, Table};
use crate::formatting::Message;
use mapper_core::probability_text;
use mapper_diagnose::gap::{Diagnosis, GapWarning, Kind, Next, OffsetAtRest, Suggestion};

/// 0 degC, K.
const ZERO_C_K: f64 = 273.15;

/// The next experiment and its alternatives; empty if nothing remains to be decided.
pub(crate) fn next_section(diagnosis: &Diagnosis) -> Document {
    let mut document = Document::default();
    let Some(next) = &diagnosis.next else { return document };
    match (next, diagnosis.experiments.first()) {
        (Next::Sensor { sensor, reason }, _) => {
            document.text(format!("{sensor}: {reason}"));
            if diagnosis.baseline.is_none() {
                document.text(
                    "if the model's equations only approximate this rig: give a fault-free recording with --baseline, or declare what they \
                     may miss under `tolerances: structure`",
                );
            }
        }
        (Next::Jump { .. } | Next::Soak { .. }, Some(first)) => {
            document.text(format!(
                "{}: {:.1} min, after which the true cause should reach {}",
                name_experiment(first),
                first.minutes,
                probability_text(first.expected_probability)
            ));
            document.text(describe_experiment(first));
        }
        (Next::Jump { .. } | Next::Soak { .. }, None) => {}
    }
    let Some(first) = diagnosis.experiments.first() else { return document };
    let heads = ["experiment", "min", "bit/min", "bit", "chance of 95 %"];
    let mut table = Table::new(heads).caption(format!(
        "Of {:.2} bit still open: information per minute and in total, and the chance that the true cause then has 95 %",
        first.entropy_bit
    ));
    for experiment in &diagnosis.experiments {
        table.row([
            name_experiment(experiment),
            format!("{:.1}", experiment.minutes),
            format!("{:.3}", experiment.entropy_drop_bit / experiment.minutes),
            format!("{:.2}", experiment.entropy_drop_bit),
            probability_text(experiment.probability_settled),
        ]);
    }
    document.table(table);
    document
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
            "`mapper plan CAMPAIGN --append {:.0}krpm@{} {:.0}krpm@{} --out PLAN` puts it after the points",
            from.speed_rpm / 1e3,
            from.valve,
            to.speed_rpm / 1e3,
            to.valve,
        ),
        Kind::Soak => {
            format!("a line of the campaign, before it is run again: {}", experiment.script.join(" "))
        }
        _ => format!("lines of a sequence, after the points: {}", experiment.script.join(" ")),
    }
}

impl Message for GapWarning {
    fn message(&self) -> String {
        match self {
            GapWarning::ChannelNotRecorded { channel } => format!(
                "{channel} ({}) is not recorded: effects that show only there cannot be found",
                channel.info().description
            ),
            GapWarning::InputNotRecorded { channel } => {
                format!("{channel} is not recorded: the campaign's value is used")
            }
            GapWarning::GapsInRecording { gaps, missing_s } => format!(
                "the recording has {gaps} gap(s), {missing_s:.1} s in total; blocks without samples are omitted"
            ),
            GapWarning::AssumedNoise { channel, noise_sigma } => format!(
                "no noise is declared for {channel}: that of a typical sensor is used, {noise_sigma} {}",
                channel.unit()
            ),
            GapWarning::UncertainTimes { scatter_s } => format!(
                "the times of the samples are off by {:.0} ms, as P3 shows where it jumps: readings that change have accordingly less weight",
                1e3 * scatter_s
            ),
            GapWarning::BaselineRecording { warning } => {
                format!("the reference recording: {}", warning.message())
            }
            GapWarning::Drift { reason, subtracted: true } => {
                format!(
                    "drift while the recording was made: {reason} It was subtracted from the readings before the diagnosis."
                )
            }
            GapWarning::Drift { reason, subtracted: false } => format!(
                "drift while the recording was made: {reason} The diagnosis assumes a rig that does not change, so no cause is named."
            ),
            GapWarning::DriftNotSubtracted { reason } => {
                format!(
                    "a drift was found and not subtracted, because the residual without it is only noise: {reason}"
                )
            }
            GapWarning::RecordingIncomplete { reason } => reason.clone(),
            GapWarning::Other { message, .. } if !message.is_empty() => message.clone(),
            other => other.code().to_owned(),
        }
    }
}

/// What a sensor reads at rest.
impl Message for OffsetAtRest {
    fn message(&self) -> String {
        let OffsetAtRest { channel, offset, declared_sigma } = self;
        format!(
            "{channel} reads {:.2} {unit} too {} at rest, where {declared_sigma:.2} {unit} are declared",
            offset.abs(),
            if *offset > 0.0 { "high" } else { "low" },
            unit = channel.unit(),
        )
    }
}
