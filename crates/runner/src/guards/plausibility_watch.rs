//! Judges every sample against physics: the range of each sensor, jumps faster than its lag, and readings that contradict each other.
//!
//! Impossible readings are marked [`Quality::Bad`] in the recording. If they persist, the run ends, because guards cannot rely on such a
//! channel. Guards still receive every raw value, so a mark never hides a value above a limit.
//!
//! | rule | why |
//! |---|---|
//! | range | [`plausible`]: no machine of any size reads beyond it |
//! | jump | a sensor with a first-order lag covers at most `1 - exp(-dt/lag)` of the distance to the end of its range |
//! | T2 | compression heats the gas at least isentropically; the housing cools it by at most half of the difference to its own temperature |
//! | P2 | a driven compressor does not expand its gas |
//! | N | a wheel transfers at most the square of its tip speed as specific work (Euler, without pre-swirl) |
//! | m_c | a compressor at a pressure ratio delivers flow; backflow in surge is shorter than a surge cycle |
//! | P3, T3 | expansion lowers pressure and temperature; only the housing heats the gas |
//!
//! If a channel has several sensors, each is checked separately. An impossible sensor is recorded as missing and noted; the run
//! continues with the others.
//!
//! Pressures, flow and shaft speed have no lag that limits a jump between two samples, so only rules that combine channels apply to
//! them. A pressure wave changes a pressure by `rho a du`, 20 kPa for 50 m/s, within milliseconds, and the pressure in the plenum of a
//! turbocharger (1 l) rises by up to 20 MPa/s. Flow in a pipe of 0.5 m changes by 200 kg/s2 at 100 kPa. A power of 30 kW accelerates the
//! shaft (16e-6 kg m2) at 95 krpm by 1.8 Mrpm/s. At 10 Hz, each of these exceeds the measuring range within one sample.

use crate::guards::guard::CommandedState;
use crate::guards::rig_watch::REQUIRED_CHANNELS;
use mapper_core::{
    Channel, Element, FaultKind, GuardName, Provenance, Quality, Reaction, SampleBatch, Trip, is_possible,
    plausible, readable,
};
use std::collections::{BTreeMap, VecDeque};

/// Duration of a contradiction that ends the run, s: longer than surge cycles and electrical interference, shorter than the default age
/// limit of a guarded signal (3 s).
const MIN_DURATION_S: f64 = 2.0;
/// Maximum age of a reading that is compared with others, s: slow instruments deliver one reading per second.
const MAX_AGE_S: f64 = 1.5;
/// Maximum delay of outlet pressure and temperature behind the shaft, s: a volume of 100 l empties through the valve of a large machine in
/// about 0.7 s.
const OUTLET_DELAY_S: f64 = 2.0;
/// Number of lags after which a probe has reached the gas temperature (within 0.7 %).
const SETTLING_LAGS: f64 = 5.0;
/// Maximum delay of the turbine outlet probe behind the inlet, s: the sheathed probes of gas stands have lags of seconds.
const TURBINE_DELAY_S: f64 = 30.0;
/// Minimum lag of a housing, s: the smallest one (0.2 kg of aluminium, 180 J/K) at its largest conductance (about 20 W/K) has 9 s.
const HOUSING_LAG_S: f64 = 5.0;
/// Pressure ratio above which a compressor certainly compresses: larger than offsets and dynamic pressures at its taps.
const MIN_WORKING_PR: f64 = 1.05;
/// Divisor of the measured pressure ratio that gives a safe lower bound: with static taps at Mach 0.35 in the pipes, the ratio is up to
/// 9 % higher than that of total pressures.
const TAP_RATIO: f64 = 1.1;
/// `(k - 1)/k` of hot moist air (k = 1.37): lower than that of cold dry air, so the isentropic rise is a lower bound.
const ISENTROPIC_EXPONENT: f64 = 0.27;
/// Heat capacity of air, J/(kg K).
const CP_J_KGK: f64 = 1005.0;
/// Largest cooling by the housing: `1 - exp(-NTU)` with the NTU of 0.7 of a small compressor at idle.
const MAX_COOLING_RATIO: f64 = 0.5;
/// Combined offset of two temperature sensors, K.
const SENSOR_OFFSETS_K: f64 = 3.0;
/// Maximum isentropic work over the square of the tip speed. Physics allows 1; an error of 20 % in the wheel diameter allows 1.5.
const HEAD_MAX_RATIO: f64 = 1.5;
/// Maximum duration of backflow in surge, s: surge cycles of turbochargers are shorter.
const MAX_BACKFLOW_S: f64 = 1.0;
/// Minimum ratio of P3 to P4 and of P2 to P1, offsets and taps included.
const MIN_EXPANSION_RATIO: f64 = 0.9;
/// Noise that a jump must exceed: two readings with six standard deviations each, and the resolution of a logger, K.
const NOISE_SIGMAS: f64 = 12.0;
const RESOLUTION_K: f64 = 1.0;

/// Properties of machine and sensors that the rules use, as declared in the campaign.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ReadingBounds {
    /// Diameter of the compressor wheel, m; `None`: not declared.
    pub wheel_diameter_m: Option<f64>,
    /// Minimum lag of T2 (thinnest probe, highest flow) and maximum lag (thickest probe, lowest flow), s; 0: a probe without inertia.
    pub t2_lag_s: (f64, f64),
    /// Noise of the noisiest sensor of T2, Tc and Tt, K, one standard deviation.
    pub noise_k: [f64; 3],
}

/// A channel as a whole (number 0), or one of its redundant sensors (numbers from 1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Sensor {
    channel: Channel,
    number: usize,
}

impl Sensor {
    /// A channel as a whole.
    fn of(channel: Channel) -> Sensor {
        Sensor { channel, number: 0 }
    }

    fn name(self) -> String {
        let Sensor { channel, number } = self;
        if number == 0 { channel.to_string() } else { Element { channel, number }.to_string() }
    }
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Track {
    /// Time and value of the last reading that is in its range.
    last: (f64, f64),
    /// Time and value before an impossible jump.
    jumped: Option<(f64, f64)>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Rule {
    /// An impossible reading or jump of one sensor.
    Fault(FaultKind, Sensor),
    /// One of several T2 sensors.
    OutletProbe(Sensor),
    OutletTemperature,
    OutletPressure,
    Head,
    Flow,
    TurbinePressure,
    TurbineTemperature,
}

impl Rule {
    /// The readings that the rule combines, of which at least one is wrong.
    fn sensors(self) -> Vec<Sensor> {
        use Channel as C;
        let channels = match self {
            Rule::Fault(_, sensor) | Rule::OutletProbe(sensor) => return vec![sensor],
            Rule::OutletTemperature => vec![C::P1, C::T1, C::P2, C::T2],
            Rule::OutletPressure => vec![C::P1, C::P2],
            Rule::Head => vec![C::ShaftSpeed, C::P1, C::T1, C::P2],
            Rule::Flow => vec![C::CompressorFlow],
            Rule::TurbinePressure => vec![C::P3, C::P4],
            Rule::TurbineTemperature => vec![C::T3, C::T4],
        };
        channels.into_iter().map(Sensor::of).collect()
    }

    /// Whether the run depends on one of the readings, because identification needs the channel or a limit of the rig uses it. A single
    /// sensor of several can fail, because the others replace it.
    fn ends_the_run(self) -> bool {
        self.sensors().iter().any(|Sensor { channel, number }| {
            *number == 0
                && (REQUIRED_CHANNELS.contains(channel) || matches!(channel, Channel::P3 | Channel::T3))
        })
    }
}

#[derive(Debug, Clone, PartialEq)]
struct Violation {
    rule: Rule,
    since_s: f64,
    reason: String,
    reported: bool,
}

/// Marks impossible readings, and trips if they persist.
#[derive(Debug, Clone)]
pub struct PlausibilityWatch {
    bounds: ReadingBounds,
    tracks: BTreeMap<Sensor, Track>,
    violations: Vec<Violation>,
    /// Minimum isentropic outlet temperature over the delay of the probe, K.
    isentropic_k: RecentMinimum,
    /// Minimum isentropic work over the delay of the outlet, J/kg.
    work_j_kg: RecentMinimum,
    /// Minima of -P3, Pa, and -T3, K, over the delay of the outlet: the negative values turn minima into maxima.
    p3_pa: RecentMinimum,
    t3_k: RecentMinimum,
    /// Start of the period in which a compressing machine shows no flow, s.
    no_flow_since_s: Option<f64>,
}

impl PlausibilityWatch {
    /// Creates the rules for a machine.
    pub fn new(bounds: ReadingBounds) -> Self {
        PlausibilityWatch {
            bounds,
            tracks: BTreeMap::new(),
            violations: Vec::new(),
            isentropic_k: RecentMinimum::default(),
            work_j_kg: RecentMinimum::default(),
            p3_pa: RecentMinimum::default(),
            t3_k: RecentMinimum::default(),
            no_flow_since_s: None,
        }
    }

    /// Marks the impossible readings of a batch. Trips on a violation that has lasted too long.
    pub fn judge(&mut self, batch: &mut SampleBatch, state: &CommandedState) -> Option<Trip> {
        let mut marks: Vec<(Sensor, usize)> = Vec::new();
        let mut trip: Option<Trip> = None;
        for index in 0..batch.t_s.len() {
            let Some(t_s) = batch.t_s.get(index).copied().filter(|t_s| t_s.is_finite()) else { continue };
            let found = self.check_sample(batch, index, t_s, state);
            let sensors = found.iter().flat_map(|(rule, _)| rule.sensors());
            marks.extend(sensors.map(|sensor| (sensor, index)));
            trip = trip.or(self.update_violations(t_s, found));
        }
        marks.into_iter().for_each(|(sensor, index)| mark_bad(batch, sensor, index));
        trip
    }

    fn check_sample(
        &mut self,
        batch: &SampleBatch,
        index: usize,
        t_s: f64,
        state: &CommandedState,
    ) -> Vec<(Rule, String)> {
        let mut found: Vec<(Rule, String)> = Vec::new();
        let is_bad = |channel| {
            batch.provenance_of(channel).is_some_and(|from| from.quality.get(index) == Some(&Quality::Bad))
        };
        let per_channel = batch.columns.iter().map(|column| (Sensor::of(column.channel), &column.values));
        let elements = batch.elements.iter().map(|column| {
            let Element { channel, number } = column.element;
            (Sensor { channel, number }, &column.values)
        });
        for (sensor, values) in per_channel.chain(elements) {
            let channel = sensor.channel;
            let value = values.get(index).copied().filter(|value| value.is_finite() && !is_bad(channel));
            let Some(value) = value else { continue };
            if !is_possible(channel, value, state.running) {
                found.push((
                    Rule::Fault(FaultKind::OutOfRange, sensor),
                    format!("{} reads {}", sensor.name(), format_value(channel, value)),
                ));
                continue;
            }
            let jumped = self.find_jump(sensor, t_s, value);
            if let Some((_, from)) = jumped {
                let reason = format!(
                    "{} jumped from {} to {}, faster than its sensor can follow",
                    sensor.name(),
                    format_value(channel, from),
                    format_value(channel, value)
                );
                found.push((Rule::Fault(FaultKind::Jump, sensor), reason));
            }
            self.tracks.insert(sensor, Track { last: (t_s, value), jumped });
        }
        if state.running {
            found.extend(self.check_compressor(t_s));
            found.extend(self.check_turbine(t_s));
        } else {
            self.no_flow_since_s = None;
        }
        found
    }

    /// Time and value before a jump that the sensor's lag excludes, until the reading is back.
    fn find_jump(&self, sensor: Sensor, t_s: f64, value: f64) -> Option<(f64, f64)> {
        let (lag_s, noise_k) = match sensor.channel {
            Channel::T2 => (self.bounds.t2_lag_s.0, self.bounds.noise_k[0]),
            Channel::Tc => (HOUSING_LAG_S, self.bounds.noise_k[1]),
            Channel::Tt => (HOUSING_LAG_S, self.bounds.noise_k[2]),
            _ => return None,
        };
        let Track { last: (then_s, then), jumped } = *self.tracks.get(&sensor)?;
        let range = plausible(sensor.channel).running;
        let reaches = |from: f64, duration_s: f64| {
            let end = if value > from { *range.end() } else { *range.start() };
            let share = if lag_s > 0.0 { 1.0 - (-duration_s.max(0.0) / lag_s).exp() } else { 1.0 };
            let noise_k = NOISE_SIGMAS * noise_k + RESOLUTION_K;
            (value - from).abs() <= noise_k + share * (end - from).abs()
        };
        let step_s = t_s - then_s;
        let is_jump = !reaches(then, step_s);
        match jumped {
            None if is_jump => Some((then_s, then)),
            None => None,
            // The jump is over if a second jump leads to a temperature that the sensor may have reached since, or back to the first value.
            Some((since_s, from)) if is_jump && reaches(from, t_s - since_s) => None,
            Some((_, from)) if reaches(from, step_s) => None,
            still => still,
        }
    }

    /// A recent possible reading.
    fn latest(&self, channel: Channel, t_s: f64) -> Option<f64> {
        self.latest_of(Sensor::of(channel), t_s)
    }

    fn latest_of(&self, sensor: Sensor, t_s: f64) -> Option<f64> {
        let (then_s, value) = self.tracks.get(&sensor)?.last;
        (t_s - then_s <= MAX_AGE_S).then_some(value)
    }

    fn check_compressor(&mut self, t_s: f64) -> Vec<(Rule, String)> {
        use Channel as C;
        let mut found = Vec::new();
        let read = (self.latest(C::P1, t_s), self.latest(C::T1, t_s), self.latest(C::P2, t_s));
        let (Some(p1_pa), Some(t1_k), Some(p2_pa)) = read else { return found };
        let pr = p2_pa / p1_pa;
        if pr < MIN_EXPANSION_RATIO {
            let (p1, p2) = (format_value(C::P1, p1_pa), format_value(C::P2, p2_pa));
            let reason = format!("P2 reads {p2} and P1 {p1}, although a compressor does not expand its gas");
            found.push((Rule::OutletPressure, reason));
        }
        let min_pr = (pr / TAP_RATIO).max(1.0);
        let isentropic_k = t1_k * min_pr.powf(ISENTROPIC_EXPONENT);
        let at = || format!("P2/P1 = {pr:.2} and T1 = {}", format_value(C::T1, t1_k));
        let delay_s = OUTLET_DELAY_S + SETTLING_LAGS * self.bounds.t2_lag_s.1;
        let lowest_k = self.isentropic_k.update(t_s, isentropic_k, delay_s);
        // Without Tc, the housing is assumed to be as cold as the inlet.
        let housing_k = self.latest(C::Tc, t_s).unwrap_or(t1_k).min(lowest_k);
        let bound_k = lowest_k - MAX_COOLING_RATIO * (lowest_k - housing_k) - SENSOR_OFFSETS_K;
        for sensor in self.tracks.keys().copied().filter(|sensor| sensor.channel == C::T2) {
            let Some(t2_k) = self.latest_of(sensor, t_s).filter(|t2_k| *t2_k < bound_k) else { continue };
            let (t2, bound) = (format_value(C::T2, t2_k), format_value(C::T2, bound_k));
            let name = sensor.name();
            let reason = format!("{name} reads {t2}, although {} heat the air to {bound} at least", at());
            let all = sensor.number == 0;
            found.push((if all { Rule::OutletTemperature } else { Rule::OutletProbe(sensor) }, reason));
        }
        let work_j_kg = self.work_j_kg.update(t_s, CP_J_KGK * (isentropic_k - t1_k), OUTLET_DELAY_S);
        if let (Some(speed_rpm), Some(diameter_m)) =
            (self.latest(C::ShaftSpeed, t_s), self.bounds.wheel_diameter_m)
        {
            let tip_m_s = std::f64::consts::PI * diameter_m * speed_rpm / 60.0;
            if work_j_kg > HEAD_MAX_RATIO * tip_m_s * tip_m_s && min_pr > 1.0 {
                let speed = format_value(C::ShaftSpeed, speed_rpm);
                let reason = format!(
                    "N reads {speed}, at which a wheel of {:.0} mm cannot compress to {}",
                    1e3 * diameter_m,
                    at()
                );
                found.push((Rule::Head, reason));
            }
        }
        let flow = self.latest(C::CompressorFlow, t_s);
        let has_flow = flow.is_none_or(|flow| flow >= *plausible(C::CompressorFlow).running.start());
        match self.no_flow_since_s {
            _ if has_flow || pr < MIN_WORKING_PR => self.no_flow_since_s = None,
            None => self.no_flow_since_s = Some(t_s),
            Some(since_s) if t_s - since_s > MAX_BACKFLOW_S => {
                let flow = format_value(C::CompressorFlow, flow.unwrap_or(f64::NAN));
                found.push((Rule::Flow, format!("m_c reads {flow}, although the compressor holds {}", at())));
            }
            Some(_) => {}
        }
        found
    }

    fn check_turbine(&mut self, t_s: f64) -> Vec<(Rule, String)> {
        use Channel as C;
        let mut found = Vec::new();
        if let (Some(p3_pa), Some(p4_pa)) = (self.latest(C::P3, t_s), self.latest(C::P4, t_s)) {
            let highest_pa = -self.p3_pa.update(t_s, -p3_pa, OUTLET_DELAY_S);
            if highest_pa < MIN_EXPANSION_RATIO * p4_pa {
                let (p3, p4) = (format_value(C::P3, p3_pa), format_value(C::P4, p4_pa));
                let reason = format!("P3 reads {p3} and P4 {p4}, although a turbine expands");
                found.push((Rule::TurbinePressure, reason));
            }
        }
        let read = (self.latest(C::T3, t_s), self.latest(C::T4, t_s), self.latest(C::Tt, t_s));
        if let (Some(t3_k), Some(t4_k), Some(tt_k)) = read {
            let highest_k = -self.t3_k.update(t_s, -t3_k, TURBINE_DELAY_S);
            if t4_k > highest_k.max(tt_k) + 2.0 * SENSOR_OFFSETS_K {
                let (t3, t4) = (format_value(C::T3, t3_k), format_value(C::T4, t4_k));
                let reason = format!("T4 reads {t4} and T3 {t3}, although a turbine cools its gas");
                found.push((Rule::TurbineTemperature, reason));
            }
        }
        found
    }

    /// Updates the duration of each violation, and reports each violation once.
    fn update_violations(&mut self, t_s: f64, found: Vec<(Rule, String)>) -> Option<Trip> {
        self.violations.retain(|known| found.iter().any(|(rule, _)| *rule == known.rule));
        for (rule, reason) in found {
            match self.violations.iter_mut().find(|known| known.rule == rule) {
                Some(known) => known.reason = reason,
                None => self.violations.push(Violation { rule, since_s: t_s, reason, reported: false }),
            }
        }
        let mut worst: Option<Trip> = None;
        for violation in self.violations.iter_mut().filter(|column| !column.reported) {
            // One microsecond covers the rounding of accumulated sample times.
            if t_s - violation.since_s < MIN_DURATION_S - 1e-6 {
                continue;
            }
            violation.reported = true;
            let reaction = if violation.rule.ends_the_run() { Reaction::Safe } else { Reaction::Note };
            let reason = format!(
                "{} since {:.1} s: such readings are impossible and are recorded as bad; check the sensors",
                violation.reason, violation.since_s
            );
            if worst.as_ref().is_none_or(|before| before.reaction < reaction) {
                worst = Some(Trip { t_s, guard: GuardName::Signals, reaction, reason });
            }
        }
        worst
    }
}

fn format_value(channel: Channel, value: f64) -> String {
    readable(value, channel.unit())
}

/// Marks one reading as bad. A single sensor of several has no quality flag, so its reading is removed.
fn mark_bad(batch: &mut SampleBatch, Sensor { channel, number }: Sensor, index: usize) {
    let element = batch.elements.iter_mut().find(|column| column.element == Element { channel, number });
    if let Some(value) = element.and_then(|column| column.values.get_mut(index)) {
        *value = f64::NAN;
        return;
    }
    if batch.column(channel).is_none() {
        return;
    }
    let index_of = batch.provenance.iter().position(|from| from.channel == channel).unwrap_or_else(|| {
        let source_t_s = batch.t_s.clone();
        let quality = vec![Quality::Good; source_t_s.len()];
        batch.provenance.push(Provenance { channel, source_t_s, quality });
        batch.provenance.len() - 1
    });
    let quality = batch.provenance.get_mut(index_of).and_then(|from| from.quality.get_mut(index));
    if let Some(quality) = quality {
        *quality = Quality::Bad;
    }
}

/// Longest window, s. It limits the memory.
const WINDOW_MAX_S: f64 = 600.0;
/// Minimum spacing of the stored values, s. It limits the memory for fast rigs; a lower value is always stored.
const SPACING_S: f64 = 0.05;

/// Candidates for the minimum: each value is lower than all later ones.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct RecentMinimum {
    increasing: VecDeque<(f64, f64)>,
}

impl RecentMinimum {
    /// Adds a value, and returns the lowest one of the last `window_s`, this one included.
    pub(crate) fn update(&mut self, t_s: f64, value: f64, window_s: f64) -> f64 {
        let mut kept_since_s = t_s;
        while let Some((then_s, _)) = self.increasing.back().filter(|(_, earlier)| *earlier >= value) {
            kept_since_s = *then_s;
            self.increasing.pop_back();
        }
        let is_close = self.increasing.back().is_some_and(|(then_s, _)| t_s - then_s < SPACING_S);
        if !is_close || kept_since_s < t_s {
            self.increasing.push_back((t_s, value));
        }
        let window_s = window_s.min(WINDOW_MAX_S);
        while self.increasing.front().is_some_and(|(then_s, _)| t_s - then_s > window_s) {
            self.increasing.pop_front();
        }
        self.increasing.front().map_or(value, |(_, lowest)| lowest.min(value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compared with a search through all values.
    #[test]
    fn it_returns_the_minimum_of_the_window() {
        let value = |i: u32| f64::from(i * 7919 % 101);
        let mut fast = RecentMinimum::default();
        for i in 0..500_u32 {
            let expected = (i.saturating_sub(20)..=i).map(value).fold(f64::INFINITY, f64::min);
            assert_eq!(fast.update(0.1 * f64::from(i), value(i), 2.0 + 1e-9), expected, "{i}");
        }
    }
}
