//! Numbers, durations and values in the display units of a campaign, as text.

use mapper_campaign::campaign::DisplayUnits;
use mapper_campaign::units::Kind;
use mapper_core::{Channel, Margins, OperatingPoint};
use mapper_numerics::statistics::range;
use mapper_recording::logs::kind_of;

/// Progress of a run: `step` counts from 1 and is 0 before the first step.
pub fn progress_text(step: usize, steps: usize, t_s: f64, duration_s: f64, left_s: f64) -> String {
    let place = match step {
        0 => "before step 1".to_owned(),
        step => format!("step {step} of {}", steps.max(step)),
    };
    // Inserted steps make a run longer than planned.
    let whole_s = duration_s.max(t_s);
    format!(
        "{place}, {} of {} of rig time, {} left",
        short_duration(t_s),
        short_duration(whole_s),
        short_duration(left_s)
    )
}

/// A short form of a duration: 1.4 s, 43 s, 22 min, 2 h 04 min.
pub fn short_duration(duration_s: f64) -> String {
    let duration_s = duration_s.max(0.0);
    let minutes = (duration_s / 60.0).round() as u64;
    match duration_s {
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 99.5 => format!("{s:.0} s"),
        _ if minutes < 60 => format!("{minutes} min"),
        _ => format!("{} h {:02} min", minutes / 60, minutes % 60),
    }
}

/// Formatter of values in the display units.
#[derive(Debug, Clone, Default)]
pub struct Display {
    units: DisplayUnits,
}

impl Display {
    /// The campaign's display units.
    pub fn new(units: &DisplayUnits) -> Self {
        Display { units: units.clone() }
    }

    /// The units.
    pub fn units(&self) -> &DisplayUnits {
        &self.units
    }

    /// The display unit of a kind; empty for a kind that is shown as it is.
    fn unit(&self, kind: Kind) -> &str {
        match kind {
            Kind::Speed => &self.units.speed,
            Kind::Pressure => &self.units.pressure,
            Kind::MassFlow => &self.units.flow,
            Kind::Temperature => &self.units.temperature,
            _ => "",
        }
    }

    /// A value converted from the internal to the display unit, for drawing.
    pub fn number(&self, kind: Kind, inside: f64) -> f64 {
        match self.unit(kind) {
            "" => inside,
            // A checked campaign names only existing units; anything else is shown in SI.
            symbol => kind.unit(symbol).map_or(inside, |unit| unit.from_inside(inside)),
        }
    }

    /// A value in its display unit, without the unit.
    fn shown(&self, kind: Kind, inside: f64) -> String {
        let decimals = match (kind, self.unit(kind)) {
            (Kind::Speed, "krpm") => 2,
            (Kind::Speed, _) | (Kind::Pressure, "Pa") => 0,
            (Kind::MassFlow, "kg/s") => 5,
            (Kind::Pressure, "bar") => 4,
            (Kind::MassFlow | Kind::Pressure, _) => 2,
            (Kind::Temperature, _) => 1,
            _ => 3,
        };
        format!("{:.decimals$}", self.number(kind, inside))
    }

    /// A reading of a channel converted to the display unit, for drawing.
    pub fn reading(&self, channel: Channel, inside: f64) -> f64 {
        self.number(kind_of(channel), inside)
    }

    /// The display unit of a channel's readings; empty for a ratio.
    pub fn unit_of(&self, channel: Channel) -> &str {
        self.unit(kind_of(channel))
    }

    /// A reading of a channel in its display unit, without the unit.
    pub fn shown_reading(&self, channel: Channel, inside: f64) -> String {
        self.shown(kind_of(channel), inside)
    }

    /// The display unit of differences between readings of a channel: K for temperatures.
    pub fn difference_unit(&self, channel: Channel) -> &str {
        if kind_of(channel) == Kind::Temperature { "K" } else { self.unit_of(channel) }
    }

    /// A difference between readings of a channel in that unit; `None` for none.
    pub fn difference(&self, channel: Channel, inside: f64) -> Option<f64> {
        let shown = match kind_of(channel) {
            Kind::Temperature => inside,
            kind => self.number(kind, inside) - self.number(kind, 0.0),
        };
        Some(shown).filter(|shown| shown.is_finite() && *shown != 0.0)
    }

    /// Column head: name, and the unit of speeds.
    pub fn speed_head(&self, name: &str) -> String {
        format!("{name} {}", self.units.speed)
    }

    /// A shaft speed.
    pub fn speed(&self, speed_rpm: f64) -> String {
        self.shown(Kind::Speed, speed_rpm)
    }

    /// The name of a speed line: its corrected speed in three figures.
    pub fn line_name(&self, speed_corrected_rpm: f64) -> String {
        let speed = self.number(Kind::Speed, speed_corrected_rpm);
        let exponent = if speed == 0.0 { 0 } else { speed.abs().log10().floor() as i32 };
        let last = 10f64.powi(exponent - 2);
        let text = format!("{:.*}", (2 - exponent).max(0) as usize, (speed / last).round() * last);
        // Without zeros at the end.
        text.parse::<f64>().map_or(text, |speed| speed.to_string())
    }

    /// An operating point in words: speed with its unit, opening.
    pub fn place_in_words(&self, point: OperatingPoint) -> String {
        format!("{} {}, opening {}", self.speed(point.speed_rpm), self.units.speed, point.shown().1)
    }

    /// An operating point: speed and opening.
    pub fn place(&self, point: OperatingPoint) -> String {
        format!("{} @ {}", self.speed(point.speed_rpm), point.shown().1)
    }

    /// Column head: name, and the unit of pressures.
    pub fn pressure_head(&self, name: &str) -> String {
        format!("{name} {}", self.units.pressure)
    }

    /// A pressure.
    pub fn pressure(&self, pressure_pa: f64) -> String {
        self.shown(Kind::Pressure, pressure_pa)
    }

    /// Column head: name, and the unit of flows.
    pub fn flow_head(&self, name: &str) -> String {
        format!("{name} {}", self.units.flow)
    }

    /// A mass flow.
    pub fn flow(&self, flow_kg_s: f64) -> String {
        self.shown(Kind::MassFlow, flow_kg_s)
    }

    /// Column head: name, and the unit of temperatures.
    pub fn temperature_head(&self, name: &str) -> String {
        format!("{name} {}", self.units.temperature)
    }

    /// A temperature.
    pub fn temperature(&self, temperature_k: f64) -> String {
        self.shown(Kind::Temperature, temperature_k)
    }
}

/// Time after the start of the run: `+h:mm`.
pub fn eta(after_s: f64) -> String {
    let minutes = (after_s.max(0.0) / 60.0).round() as u64;
    format!("+{}:{:02}", minutes / 60, minutes % 60)
}

/// A duration as hours and minutes, minutes and seconds, or seconds; rounded, without trailing zeros.
pub fn duration(duration_s: f64) -> String {
    let seconds = duration_s.max(0.0).round() as u64;
    let minutes = (seconds + 30) / 60;
    match (seconds / 60, seconds % 60) {
        (0, seconds) => format!("{seconds} s"),
        (60.., _) => format!("{} h {:02} min", minutes / 60, minutes % 60),
        (minutes, 0) => format!("{minutes} min"),
        (minutes, seconds) => format!("{minutes} min {seconds:02} s"),
    }
}

/// A number, or a dash if there is none.
pub fn number(value: Option<f64>, decimals: usize) -> String {
    value
        .filter(|value| value.is_finite())
        .map_or_else(|| "-".to_owned(), |value| format!("{value:.decimals$}"))
}

/// A fraction in percent (for efficiencies: in points), or a dash.
pub fn percent(fraction: Option<f64>, decimals: usize) -> String {
    number(fraction.map(|fraction| 100.0 * fraction), decimals)
}

/// Distances to the ends of an interval: `0.55`, the farther one, or `-0.20/+0.90` if they differ by more than a half.
pub(crate) fn margins_text(margins: Margins, decimals: usize) -> String {
    if margins.is_symmetric() {
        number(Some(margins.farther()), decimals)
    } else {
        format!("-{:.decimals$}/+{:.decimals$}", margins.below, margins.above)
    }
}

/// A value with its interval: `73.1 +/- 0.5`, or `73.1 -0.2/+0.9`.
pub(crate) fn with_margins(value: f64, margins: Margins, decimals: usize) -> String {
    let sign = if margins.is_symmetric() { "+/- " } else { "" };
    format!("{value:.decimals$} {sign}{}", margins_text(margins, decimals))
}

/// A number with at most this many significant digits, without trailing zeros.
pub fn significant_digits(value: f64, count: usize) -> String {
    let rounded: f64 = format!("{value:.*e}", count.saturating_sub(1)).parse().unwrap_or(value);
    if rounded != 0.0 && rounded.abs() < 1e-3 { format!("{rounded:e}") } else { rounded.to_string() }
}

/// `low to high` of values times a factor, or a dash without values.
pub(crate) fn range_text(values: impl Iterator<Item = f64>, factor: f64, digits: usize) -> String {
    let (low, high) = range(values);
    if low > high {
        number(None, digits)
    } else {
        format!("{:.digits$} to {:.digits$}", factor * low, factor * high)
    }
}

/// A number with four significant figures.
pub fn four_figures(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let exponent = value.abs().log10().floor();
    if !(-3.0..5.0).contains(&exponent) {
        return format!("{value:.3e}");
    }
    let decimals = (3.0 - exponent).max(0.0) as usize;
    format!("{value:.decimals$}")
}

/// Factor to the unit in which residuals are shown, and that unit.
pub(crate) fn display_scale(unit: &str) -> (f64, &str) {
    match unit {
        "Pa" => (1e-3, "kPa"),
        "kg/s" => (1e3, "g/s"),
        unit => (1.0, unit),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_fit_next_to_a_bar_of_80_columns() {
        assert_eq!(
            progress_text(12, 57, 1320.0, 7440.0, 1.4),
            "step 12 of 57, 22 min of 2 h 04 min of rig time, 1.4 s left"
        );
        assert!(
            progress_text(0, 0, 7441.0, 7440.0, 0.0).starts_with("before step 1, 2 h 04 min of 2 h 04 min")
        );
        let longest = progress_text(999, 999, 99.0 * 3600.0, 99.9 * 3600.0, 99.9 * 3600.0);
        assert!(longest.len() <= 78, "{longest}");
        assert_eq!(
            [9.94, 9.96, 99.4, 99.6, 3599.0].map(short_duration),
            ["9.9 s", "10 s", "99 s", "2 min", "1 h 00 min"]
        );
    }

    #[test]
    fn rounded_and_never_sixty_of_anything() {
        for (seconds, phrases) in [
            (0.4, "0 s"),
            (59.6, "1 min"),
            (90.0, "1 min 30 s"),
            (3599.0, "59 min 59 s"),
            (4959.0, "1 h 23 min"),
            (7199.0, "2 h 00 min"),
        ] {
            assert_eq!(duration(seconds), phrases, "{seconds}");
        }
    }
}
