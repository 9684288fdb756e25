//! Whether what was read can be what the channel map says, before anything is computed from it.

use crate::ChannelSource;
use crate::complaints::Complaints;
use mapper_core::{Channel, Series};
use mapper_logs::plausible::{fits, fitting_units, looks_like_gauge};
use mapper_logs::units::{kind_of, unit};
use mapper_logs::{Kind, Unit};
use mapper_numerics::statistics::quantile;
use mapper_yaml::{FindingKind, steps};

/// Share of the readings left out at each end: spikes are no matter of units.
const OUTER: f64 = 0.02;

/// Complains about a channel whose readings are impossible in their unit, where another unit would make them possible. Readings
/// that no unit makes possible are a matter of the sensor, not of the map.
pub(crate) fn check(
    channel: Channel,
    source: &ChannelSource,
    unit_used: &'static Unit,
    series: &Series,
    complaints: &mut Complaints,
) {
    let values: Vec<f64> = series.values.iter().copied().filter(|value| value.is_finite()).collect();
    let at = |share: f64| quantile(&values, share);
    let (Some(low), Some(high)) = (at(OUTER), at(1.0 - OUTER)) else { return };
    if fits(channel, low, high) {
        return;
    }
    let written = |inside: f64| unit_used.from_inside(inside);
    let (written_low, written_high) = (written(low), written(high));
    let mut right: Vec<String> = Vec::new();
    if looks_like_gauge(channel, low, high) && !source.gauge {
        right.push("as pressures over the ambient pressure they would be plausible: write `gauge: true` and `ambient_pressure`".to_owned());
    }
    // Without their gauge part those of a gauge pressure are not known here.
    let absolute = !source.gauge;
    for other in fitting_units(channel, written_low, written_high).into_iter().filter(|_| absolute) {
        let shown = shown_unit(kind_of(channel));
        let at = |value: f64| {
            short(shown.map_or(other.to_inside(value), |shown| shown.from_inside(other.to_inside(value))))
        };
        let symbol = shown.map_or(channel.unit(), Unit::symbol);
        right.push(format!(
            "as {} they would be {} to {} {symbol}: write `unit: {}`",
            other.symbol(),
            at(written_low),
            at(written_high),
            other.symbol()
        ));
    }
    if right.is_empty() {
        return;
    }
    let has_unit = source.unit.is_some();
    let place = steps!["channels", channel.symbol(), if has_unit { "unit" } else { "field" }];
    let over = if source.gauge { " with the ambient pressure" } else { "" };
    let message = format!(
        "the readings of `{}` lie between {} and {} {}{over}, which is impossible for {channel}, {}",
        source.field,
        short(written_low),
        short(written_high),
        unit_used.symbol(),
        channel.info().description
    );
    let remedy = format!("{}; or leave {channel} out", right.join("; "));
    complaints.add(FindingKind::Implausible, &place, message, remedy);
}

/// A unit in which people know such values.
fn shown_unit(kind: Kind) -> Option<&'static Unit> {
    let symbol = match kind {
        Kind::Temperature => "degC",
        Kind::Pressure => "kPa",
        Kind::MassFlow => "g/s",
        Kind::Speed => "rpm",
        _ => return None,
    };
    unit(kind, symbol).ok()
}

fn short(value: f64) -> String {
    if value.abs() >= 100.0 { format!("{value:.0}") } else { format!("{value:.3}") }
}
