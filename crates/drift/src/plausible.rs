//! Whether readings can be what their channels say, before the model is driven by them.

use mapper_core::{Channel, Dimension, Recording, Series};

/// Share of readings that may be no numbers.
const NO_NUMBERS_SHARE: f64 = 0.02;
/// What the model is driven by, and compared with.
const USED: [Channel; 14] = [
    Channel::ShaftSpeed,
    Channel::CompressorFlow,
    Channel::TurbineFlow,
    Channel::P1,
    Channel::P2,
    Channel::P3,
    Channel::P4,
    Channel::T1,
    Channel::T2,
    Channel::T3,
    Channel::T4,
    Channel::Tc,
    Channel::Tt,
    Channel::TOil,
];

/// Lowest and highest middle reading of a turbocharger that runs, SI, and what else it may be.
fn range(dimension: Dimension) -> (f64, f64, &'static str) {
    match dimension {
        Dimension::RotationalSpeed => (1e3, 1e6, "Is it in krpm?"),
        Dimension::MassFlow => (1e-4, 20.0, "Is it in g/s or kg/h?"),
        Dimension::Pressure => (2e4, 2e6, "Is it in kPa or bar?"),
        Dimension::Temperature => (200.0, 1600.0, "Is it in degC?"),
        Dimension::Ratio => (f64::NEG_INFINITY, f64::INFINITY, ""),
    }
}

/// What is wrong with a recording's readings within its steps, in words; `None` where nothing is.
pub(crate) fn implausible(recording: &Recording) -> Option<String> {
    let (start_s, end_s) = (recording.steps.first()?.start_s, recording.steps.last()?.end_s);
    USED.iter().find_map(|channel| of_channel(*channel, recording.series.get(channel)?, start_s, end_s))
}

fn of_channel(channel: Channel, series: &Series, start_s: f64, end_s: f64) -> Option<String> {
    let values = series.slice(start_s, end_s).1;
    let mut finite: Vec<f64> = values.iter().copied().filter(|value| value.is_finite()).collect();
    let missing = values.len() - finite.len();
    if missing as f64 > NO_NUMBERS_SHARE * values.len() as f64 {
        return Some(format!(
            "{missing} of {} readings of {} are no numbers; mend the channel, or record it anew",
            values.len(),
            channel.symbol()
        ));
    }
    finite.sort_by(f64::total_cmp);
    let middle = *finite.get(finite.len() / 2)?;
    let (low, high, hint) = range(channel.info().dimension);
    (!(low..=high).contains(&middle)).then(|| {
        format!(
            "{} reads {middle:.6} {unit} in the middle, which no running machine has ({low} to {high} {unit}). {hint} A \
             channel map (`--channels`) says in what unit each field is",
            channel.symbol(),
            unit = channel.unit(),
        )
    })
}
