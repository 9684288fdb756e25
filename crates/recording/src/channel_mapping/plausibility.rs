//! Checks readings against the units of the channel map, before anything is computed from them.

use crate::channel_mapping::channel_map_yaml::MapMistakes;
use crate::logs::finding::{AMBIENT_RANGE_PA, TRIMMED_SHARE, fitting_units, looks_like_gauge};
use crate::logs::proposal::short;
use crate::{AmbientPressure, ChannelSource};
use mapper_core::unit_factors::PA_PER_KPA;
use mapper_core::{Channel, Series, is_plausible_range};
use mapper_numerics::statistics::quantile;
use mapper_table::{kind_of, unit};
use mapper_yaml::units::{Kind, Unit};
use mapper_yaml::{FindingKind, steps};

pub(crate) struct Readings<'a> {
    pub(crate) channel: Channel,
    pub(crate) source: &'a ChannelSource,
    pub(crate) unit: &'static Unit,
    /// SI, gauge pressures made absolute.
    pub(crate) series: &'a Series,
    /// Typical ambient pressure, Pa; `None` if unknown.
    pub(crate) ambient_pa: Option<f64>,
}

/// Reports a channel whose readings are impossible in their unit and possible in another one. Readings
/// that are impossible in every unit indicate a sensor fault, not a mistake of the map.
pub(crate) fn check(readings: &Readings<'_>, mistakes: &mut MapMistakes) {
    let Readings { channel, source, unit: unit_used, series, ambient_pa } = *readings;
    let Some((low, high)) = trimmed_range(series) else { return };
    if is_plausible_range(channel, low, high) {
        return;
    }
    // Offset added to the readings.
    let over_pa = if source.gauge { ambient_pa.unwrap_or(f64::NAN) } else { 0.0 };
    let written = |inside: f64| unit_used.from_inside(inside - over_pa);
    let (written_low, written_high) = (written(low), written(high));
    let mut right: Vec<String> = Vec::new();
    if looks_like_gauge(channel, low, high) && !source.gauge {
        right.push(
            "as gauge pressures they would be plausible: write `gauge: true` and `ambient_pressure`"
                .to_owned(),
        );
    }
    if source.gauge && is_plausible_range(channel, low - over_pa, high - over_pa) {
        right.push("as absolute pressures they would be plausible: delete `gauge: true`".to_owned());
    }
    for other in fitting_units(channel, written_low, written_high, over_pa) {
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
    let over = if source.gauge { " gauge" } else { "" };
    let message = format!(
        "the readings of `{}` lie between {} and {} {}{over}, which is impossible for {channel}, {}",
        source.field,
        short(written_low),
        short(written_high),
        unit_used.symbol(),
        channel.info().description
    );
    let remedy = format!("{}; or delete the entry of {channel}", right.join("; "));
    mistakes.add(FindingKind::Implausible, &place, message, remedy);
}

/// Reports an ambient pressure that occurs nowhere on earth: gauge pressures are added to it.
pub(crate) fn check_ambient(
    ambient: &AmbientPressure,
    column: Option<&Series>,
    unit_used: Option<&'static Unit>,
    mistakes: &mut MapMistakes,
) {
    let (min_pa, max_pa) = AMBIENT_RANGE_PA;
    let allowed = format!("it lies between {:.0} and {:.0} kPa", min_pa / PA_PER_KPA, max_pa / PA_PER_KPA);
    match (ambient, column.and_then(trimmed_range)) {
        (AmbientPressure::Constant(barometer), _) if !(min_pa..=max_pa).contains(&barometer.pressure_pa) => {
            let message = format!(
                "the ambient pressure is {} kPa, which is impossible",
                short(barometer.pressure_pa / PA_PER_KPA)
            );
            let remedy = format!("{allowed}: write the barometer's reading");
            mistakes.add(FindingKind::Implausible, &steps!["ambient_pressure"], message, remedy);
        }
        (AmbientPressure::Source(source), Some((low, high))) if low < min_pa || high > max_pa => {
            let written = |inside: f64| unit_used.map_or(inside, |unit| unit.from_inside(inside));
            let symbol = unit_used.map_or("Pa", Unit::symbol);
            let message = format!(
                "the readings of `{}` lie between {} and {} {symbol}, which is impossible for the ambient pressure",
                source.field,
                short(written(low)),
                short(written(high))
            );
            let fitting = |unit: &&'static Unit| {
                unit.to_inside(written(low)) >= min_pa && unit.to_inside(written(high)) <= max_pa
            };
            let right: Vec<String> = Kind::Pressure
                .units()
                .iter()
                .filter(fitting)
                .map(|unit| format!("write `unit: {}`", unit.symbol()))
                .collect();
            let or = if right.is_empty() { "" } else { "; or " };
            let remedy = format!(
                "{allowed}: {}{or}name another column, or write the barometer's reading",
                right.join(" or ")
            );
            mistakes.add(FindingKind::Implausible, &steps!["ambient_pressure", "field"], message, remedy);
        }
        _ => {}
    }
}

/// Smallest and largest reading after [`TRIMMED_SHARE`] is removed at each end.
fn trimmed_range(series: &Series) -> Option<(f64, f64)> {
    let values: Vec<f64> = series.values.iter().copied().filter(|value| value.is_finite()).collect();
    Some((quantile(&values, TRIMMED_SHARE)?, quantile(&values, 1.0 - TRIMMED_SHARE)?))
}

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
