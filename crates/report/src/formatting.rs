//! Numbers, durations and values in display units as text; sentences of typed warnings, remarks and findings, as their [`Message`].

use mapper_campaign::campaign::DisplayUnits;
use mapper_campaign::units::Kind;
use mapper_core::{
    Channel, Margins, ModelDoubt, OperatingPoint, PlanRemark, ResultRemark, Warning, valve_area_text,
    with_sentences,
};
use mapper_diagnose::gap::GapWarning;
use mapper_numerics::statistics::range;
use mapper_recording::logs::proposal::ProposalRemark;
use mapper_recording::logs::{LogFinding, kind_of};
use std::any::Any;

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
    /// The display units.
    pub units: DisplayUnits,
}

impl Display {
    /// The campaign's display units.
    pub fn new(units: &DisplayUnits) -> Self {
        Display { units: units.clone() }
    }

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

    /// Column head: name, and the unit of a kind.
    pub fn head(&self, name: &str, kind: Kind) -> String {
        format!("{name} {}", self.unit(kind))
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

    /// An operating point in words: speed with its unit, valve area.
    pub fn place_in_words(&self, point: OperatingPoint) -> String {
        let valve = valve_area_text(point.valve_opening_ratio);
        format!("{} {}, valve area {valve}", self.speed(point.speed_rpm), self.units.speed)
    }

    /// An operating point: speed and valve area.
    pub fn place(&self, point: OperatingPoint) -> String {
        format!("{} @ {}", self.speed(point.speed_rpm), valve_area_text(point.valve_opening_ratio))
    }

    /// A pressure.
    pub fn pressure(&self, pressure_pa: f64) -> String {
        self.shown(Kind::Pressure, pressure_pa)
    }

    /// A mass flow.
    pub fn flow(&self, flow_kg_s: f64) -> String {
        self.shown(Kind::MassFlow, flow_kg_s)
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

/// A value with a sentence for people, with values, units and remedy.
pub trait Message {
    /// The sentence.
    fn message(&self) -> String;
}

/// The sentence of a typed message for JSON; `None` for a value of another type.
pub fn sentence(value: &dyn Any) -> Option<String> {
    fn of<T: Message + 'static>(value: &dyn Any) -> Option<String> {
        value.downcast_ref::<T>().map(Message::message)
    }
    of::<Warning>(value)
        .or_else(|| of::<ResultRemark>(value))
        .or_else(|| of::<PlanRemark>(value))
        .or_else(|| of::<GapWarning>(value))
        .or_else(|| of::<ModelDoubt>(value))
        .or_else(|| value.downcast_ref::<LogFinding>().map(ToString::to_string))
        .or_else(|| value.downcast_ref::<ProposalRemark>().map(ToString::to_string))
}

/// JSON that `work` makes on this thread has the sentence of each typed message.
pub fn with_messages<R>(work: impl FnOnce() -> R) -> R {
    with_sentences(sentence, work)
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

    /// One of each kind, as files have them.
    const ALL: &str = r#"[
        {"code": "dead_channel", "channel": "P2", "reading": 180},
        {"code": "frozen_channel", "channel": "T2", "reading": 300, "from_s": 1, "to_s": 9},
        {"code": "stuck", "channel": "T2", "duration_s": 9},
        {"code": "noisy_channel", "channel": "T2", "noise": 1, "declared_noise": 0.1},
        {"code": "scaled_channel", "kind": "specific_speed", "speed_rpm": 2e3, "flow_kg_s": 0.1, "pressure_ratio": 2, "specific_speed": 0.01},
        {"code": "scaled_channel", "kind": "apparent_efficiency", "rise_k": 1, "t1_k": 300, "pressure_ratio": 2, "isentropic_rise_k": 65, "efficiency": 65},
        {"code": "scaled_channel", "kind": "some_points"},
        {"code": "scaled_channel", "kind": "shaft_power", "compressor_w": 4e3, "turbine_w": 2e3, "power_ratio": 2},
        {"code": "swapped_channels", "kind": "p2_below_p1", "points": 3, "of": 4, "p1_pa": 2e5, "p2_pa": 1e5},
        {"code": "swapped_channels", "kind": "t2_above_t3"},
        {"code": "swapped_channels", "kind": "tc_before_t2", "tc_jump_k": 9, "t2_jump_k": 1},
        {"code": "late_channel", "channel": "T2", "lag_s": -4, "jumps": 7},
        {"code": "contradicted_channel", "faults": [{"fault": "offset of T2", "channels": ["T2"], "value": 2, "sigma": 0.1, "unit": "K",
            "alternatives": ["offset of T1"], "touches_points": true}]},
        {"code": "off_the_nominal_map", "faults": []},
        {"code": "steps_contradict", "kind": "overlap", "first": 1, "first_start_s": 0, "first_end_s": 9, "second": 2, "second_start_s": 5,
            "second_end_s": 20},
        {"code": "steps_contradict", "kind": "shared_number", "number": 3, "steps": 2},
        {"code": "lost_samples", "lost": 3, "samples": 90},
        {"code": "outliers", "count": 2},
        {"code": "calibration", "channel": "T2", "sensor": "T2", "defect": {"kind": "missing", "key": "calibration"}},
        {"code": "calibration", "channel": "T2", "sensor": "T2", "defect": {"kind": "missing", "key": "due"}},
        {"code": "calibration", "channel": "T2", "sensor": "T2", "defect": {"kind": "expired", "due": "2026-01-31", "day": "2026-02-01"}},
        {"code": "calibration", "channel": "T2", "sensor": "T2", "defect": {"kind": "range", "reading": 400, "min": 270, "max": 390}},
        {"code": "calibration", "channel": "T2", "sensor": "T2", "defect": {"kind": "uncertainty", "certified": 0.3, "declared": 0.1}},
        {"code": "end_state", "channel": "T2", "lost_before_end_s": 9},
        {"code": "no_transient"},
        {"code": "from_convection_law", "convection_origin": null},
        {"code": "from_convection_law", "convection_origin": "declared in a.yaml"},
        {"code": "too_few_samples", "kind": "short_step", "step_s": 2},
        {"code": "too_few_samples", "kind": "late_commands", "before_end_s": 2},
        {"code": "too_few_samples", "kind": "samples", "complete": 2, "lost": 3, "needed": 10},
        {"code": "window_cut", "requested_end_s": 60, "step_s": 30},
        {"code": "not_stabilised", "quantity": "flow", "settled_s": 3, "needed_s": 9, "used_s": 12},
        {"code": "not_settled", "channel": "Tc", "drift_k_min": 0.4, "limit_k_min": 0.1},
        {"code": "flow_moved", "flow_change_ratio": 0.02, "eta_error": 0.01, "h_error_w_m2k": 9},
        {"code": "speed_not_reached", "requested_rpm": 9e4, "reached_rpm": 8e4},
        {"code": "apparent"},
        {"code": "surge_end", "evidence": "zero_slope"},
        {"code": "choke_end", "evidence": "vertical"},
        {"code": "no_compression", "kind": "no_t2"},
        {"code": "no_compression", "kind": "no_rise", "rise_k": 0, "pressure_ratio": 1.1},
        {"code": "no_compression", "kind": "no_pressure_rise"},
        {"code": "at_bound", "kind": "eta", "eta": 2},
        {"code": "at_bound", "kind": "h", "h_w_m2k": 0},
        {"code": "fit_failed", "kind": "step"},
        {"code": "fit_failed", "kind": "all_steps"},
        {"code": "fit_failed", "kind": "not_finite"},
        {"code": "poor_fit", "kind": "eta", "eta": 1.1},
        {"code": "poor_fit", "kind": "noise_ratio", "residual_ratio": 2},
        {"code": "poor_fit", "kind": "noise", "residual_k": 0.2, "noise_k": 0.1},
        {"code": "poor_fit", "kind": "shape", "residual_k": 0.2, "block_s": 10, "dt2_k": 9},
        {"code": "small_gradient", "dt2_k": 0.2, "needed_dt2_k": 0.5, "eta_sigma": 0.03},
        {"code": "offsets_dominate", "eta_noise_sigma": 0.01, "eta_bias_sigma": 0.05, "dt2_k": 9, "shared": true},
        {"code": "noise_dominates", "eta_noise_sigma": 0.05, "eta_bias_sigma": 0.01, "rise_k": 9},
        {"code": "prior_dominated", "eta_error": 0.02},
        {"code": "assumed_alpha", "alpha_area_ratio": 0, "alpha_area_sigma_ratio": 0.1, "eta_sigma": 0.02},
        {"code": "nothing_declared"},
        {"code": "left_out", "kind": "poor_fit"},
        {"code": "left_out", "kind": "readings"},
        {"code": "left_out", "kind": "region", "region": "choke", "sigmas": 7, "doubts": [{"kind": "scatter", "scatter_ratio": 0.1}]},
        {"code": "off_the_law", "h_deviation_ratio": 0.1},
        {"code": "model_doubted", "kind": "slow_residual", "residual_ratio": 3}
    ]"#;

    #[test]
    fn every_code_has_its_own_sentence() {
        let all: Vec<Warning> = serde_json::from_str(ALL).unwrap();
        let codes: Vec<&str> = all.iter().map(Warning::code).collect();
        assert!(Warning::CODES.iter().all(|code| codes.contains(code)), "{codes:?}");
        let texts: Vec<String> = all.iter().map(Message::message).collect();
        for (index, (warning, text)) in all.iter().zip(&texts).enumerate() {
            assert!(!matches!(warning, Warning::Other { .. }) && text != warning.code(), "{warning:?}");
            assert!(!texts[..index].contains(text), "{text}");
        }
    }

    #[test]
    fn points_in_json_have_the_sentences_of_their_warnings() {
        let all: Vec<Warning> = serde_json::from_str(ALL).unwrap();
        let json = with_messages(|| serde_json::json!(mapper_core::JsonMessages(&all)));
        let messages = json.as_array().unwrap().iter().map(|one| one["message"].as_str().unwrap());
        assert!(messages.eq(all.iter().map(Message::message)));
        assert_eq!(serde_json::from_value::<Vec<Warning>>(json).unwrap(), all, "a reader ignores them");
    }
}
