//! `guards:`

use crate::checking::Check;
use crate::elements::rig::redundant_sensors::SensorDeclaration;
use crate::si_values::{element, value_or};
use crate::units::{
    Duration, Fraction, Kind, Pressure, PressureDifference, Quantity, Speed, Temperature,
    TemperatureDifference,
};
use mapper_core::{
    COARSE_REPEAT_S, Channel, FrozenLimit, GuardName, GuardSet, LargestChange, Limits, Reaction,
    SURGE_ALLOWED_S, SignalGuard, SpeedBand, SurgeVariation,
};
use mapper_yaml::{FindingKind, steps};
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Guards that end a run, or a step, before damage is done. Each guard is active by default, at the limit of the same name; an entry here tightens it or changes its reaction. None can be switched off.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct GuardsFile {
    /// Shaft speed; by default trips above `limits.speed` and locks the rig.
    #[serde(default)]
    overspeed: OverspeedFile,
    /// T2; by default trips above `limits.compressor_outlet_temperature`.
    #[serde(default)]
    compressor_outlet_temperature: TemperatureFile,
    /// T3; by default trips above `limits.turbine_inlet_temperature`.
    #[serde(default)]
    turbine_inlet_temperature: TemperatureFile,
    /// P3; by default trips above the highest `limits.turbine_inlet_pressure`.
    #[serde(default)]
    turbine_inlet_pressure: PressureFile,
    /// Oil inlet temperature; not guarded by default.
    oil_temperature: Option<OilFile>,
    /// Change of the compressor housing; by default noted beyond `limits.housing_gradient` within a dwell.
    housing_gradient: Option<HousingFile>,
    /// Variation of flow and pressure from one tenth of a second to the next.
    #[serde(default)]
    surge: SurgeFile,
    /// The target speed of a step.
    #[serde(default)]
    speed: SpeedFile,
    /// The flow through the back-pressure valve against its command.
    #[serde(default)]
    valve: ValveFile,
    /// Settings of every guarded signal.
    #[serde(default)]
    signals: SignalsFile,
}

element! {
    /// The guard over the shaft speed.
    OverspeedFile for SignalGuard {
        /// Trips above this speed, at most `limits.speed`.
        above => above: Quantity<Speed> [extend("x-above" = "0 rpm", "x-max" = "1000 krpm"), example = &"180 krpm"];
        /// Hysteresis: the trip ends when the speed is this far below; 0 rpm if none is given.
        hysteresis => hysteresis: Quantity<Speed> [extend("x-min" = "0 rpm", "x-max" = "100 krpm"), example = &"500 rpm"];
        /// Trips after this time; 0.2 s if none is given, so that one noisy sample does not.
        dwell => dwell_s: Quantity<Duration> [extend("x-min" = "0 s", "x-max" = "10 s"), example = &"0.2 s"];
        /// Reaction; `latch` if none is given.
        reaction => reaction: Reaction [example = &"latch"];
    }
}

element! {
    /// A guard over a temperature.
    TemperatureFile for SignalGuard {
        /// Trips above this temperature, at most the limit of the same name.
        above => above: Quantity<Temperature> [extend("x-min" = "250 K", "x-max" = "1400 K"), example = &"250 degC"];
        /// Trips if it changes by more than this within `within`.
        change: Quantity<TemperatureDifference> [extend("x-above" = "0 K", "x-max" = "1000 K"), example = &"60 K"];
        /// Time of `change`; 10 s if none is given.
        within: Quantity<Duration> [extend("x-above" = "0 s", "x-max" = "10 min"), example = &"10 s"];
        /// Hysteresis: the trip ends when the temperature is this far below; 0 K if none is given.
        hysteresis => hysteresis: Quantity<TemperatureDifference> [extend("x-min" = "0 K", "x-max" = "200 K"), example = &"2 K"];
        /// Trips after this time; 0.2 s if none is given.
        dwell => dwell_s: Quantity<Duration> [extend("x-min" = "0 s", "x-max" = "10 min"), example = &"0.2 s"];
        /// Reaction; `safe` if none is given.
        reaction => reaction: Reaction [example = &"safe"];
    }
}

element! {
    /// The guard over the turbine inlet pressure.
    PressureFile for SignalGuard {
        /// Trips above this pressure, at most the highest of `limits.turbine_inlet_pressure`.
        above => above: Quantity<Pressure> [extend("x-above" = "0 kPa", "x-max" = "2 MPa"), example = &"400 kPa"];
        /// Hysteresis: the trip ends when the pressure is this far below; 0 Pa if none is given.
        hysteresis => hysteresis: Quantity<PressureDifference> [extend("x-min" = "0 Pa", "x-max" = "200 kPa"), example = &"1 kPa"];
        /// Trips after this time; 0.2 s if none is given.
        dwell => dwell_s: Quantity<Duration> [extend("x-min" = "0 s", "x-max" = "10 min"), example = &"0.2 s"];
        /// Reaction; `safe` if none is given.
        reaction => reaction: Reaction [example = &"safe"];
    }
}

element! {
    /// The guard over the oil.
    OilFile for SignalGuard {
        /// Trips above this temperature.
        above => above: Quantity<Temperature> [extend("x-min" = "250 K", "x-max" = "500 K"), example = &"130 degC"];
        /// Trips below this temperature while gas flows.
        below => below: Quantity<Temperature> [extend("x-min" = "250 K", "x-max" = "500 K"), example = &"20 degC"];
        /// Hysteresis: the trip ends when the temperature is this far inside; 0 K if none is given.
        hysteresis => hysteresis: Quantity<TemperatureDifference> [extend("x-min" = "0 K", "x-max" = "200 K"), example = &"2 K"];
        /// Trips after this time; 1 s if none is given.
        dwell => dwell_s: Quantity<Duration> [extend("x-min" = "0 s", "x-max" = "10 min"), example = &"1 s"];
        /// Reaction; `safe` if none is given.
        reaction => reaction: Reaction [example = &"safe"];
    }
}

/// The guard over the housing's change.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct HousingFile {
    /// Trips if the housing changes by more than this within `within`.
    #[schemars(extend("x-above" = "0 K", "x-max" = "500 K"), example = &"30 K")]
    change: Quantity<TemperatureDifference>,
    /// Time of `change`; the dwell if none is given.
    #[schemars(extend("x-above" = "0 s", "x-max" = "1 h"), example = &"120 s")]
    within: Option<Quantity<Duration>>,
    /// Reaction; `note` if none is given.
    #[schemars(example = &"note")]
    reaction: Option<Reaction>,
}

element! {
    /// The guard against surge.
    SurgeFile for SurgeVariation {
        /// Variation of the flow from which surge is suspected, one standard deviation; 5 % if none is given.
        flow => flow_ratio: Quantity<Fraction> [extend("x-above" = "0 %", "x-max" = "50 %"), example = &"5 %"];
        /// Variation of P2 or P1 that must occur together with that of the flow; 1 % if none is given.
        pressure => pressure_ratio: Quantity<Fraction> [extend("x-above" = "0 %", "x-max" = "50 %"), example = &"1 %"];
        /// Trips after this time: a jump may touch the surge line, a point may not stay beyond it; 5 s if none is given.
        dwell => dwell_s: Quantity<Duration> [extend("x-min" = "0 s", "x-max" = "5 s"), example = &"5 s"];
        /// Reaction; `safe` if none is given.
        reaction => reaction: Reaction [example = &"skip_step"];
    }
}

element! {
    /// The guard over the speed of a step.
    SpeedFile for SpeedBand {
        /// Largest deviation over the last 10 s of a step; 5 % if none is given, 25 % if `speed_control` is off.
        band => band_ratio: Quantity<Fraction> [extend("x-above" = "0 %", "x-max" = "25 %"), example = &"5 %"];
        /// Reaction; `safe` if none is given.
        reaction => reaction: Reaction [example = &"safe"];
    }
}

/// The guard over a back-pressure valve that does not follow its commands.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct ValveFile {
    /// Reaction; `note` if none is given.
    #[schemars(example = &"safe")]
    reaction: Option<Reaction>,
}

/// Settings of every guarded signal.
#[derive(Debug, Clone, Copy, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SignalsFile {
    /// The run ends if a guarded signal has no good reading for this time; 3 s if none is given.
    #[schemars(extend("x-above" = "0 s", "x-max" = "10 s"), example = &"3 s")]
    age: Option<Quantity<Duration>>,
    /// N, P2 and T2 count as frozen if their readings stay constant for this time after a jump of the setpoints; 20 s if none is given.
    #[schemars(extend("x-min" = "2 s", "x-max" = "10 min"), example = &"20 s")]
    frozen: Option<Quantity<Duration>>,
}

/// Inputs of the guards in addition to their own keys.
pub(crate) struct GuardInputs<'a> {
    pub(crate) limits: &'a Limits,
    pub(crate) sensors: &'a BTreeMap<Channel, SensorDeclaration>,
    pub(crate) dwell_s: f64,
    pub(crate) speed_is_held: bool,
}

/// Default time above a limit before a trip: one noisy sample at 10 Hz does not trip, three in a row do.
const DEFAULT_DWELL_S: f64 = 0.2;
/// Default age of a reading before a trip, s. Judgement: a few samples of an instrument that reads once a second.
pub const DEFAULT_MAX_AGE_S: f64 = 3.0;
/// Default time beyond an oil limit before a trip, s. Judgement: ten samples at 10 Hz.
const DEFAULT_OIL_DWELL_S: f64 = 1.0;
const DEFAULT_CHANGE_WITHIN_S: f64 = 10.0;
const DEFAULT_SURGE_FLOW_RATIO: f64 = 0.05;
const DEFAULT_SURGE_PRESSURE_RATIO: f64 = 0.01;
const DEFAULT_SPEED_BAND_RATIO: f64 = 0.05;
const DEFAULT_OPEN_LOOP_BAND_RATIO: f64 = 0.25;

impl GuardsFile {
    /// All guards of a campaign, with defaults filled in.
    pub(crate) fn guards(self, by: &GuardInputs<'_>) -> GuardSet {
        let GuardInputs { limits, sensors, dwell_s, speed_is_held } = *by;
        let age_s = value_or(self.signals.age, DEFAULT_MAX_AGE_S);
        let frozen_s = value_or(self.signals.frozen, COARSE_REPEAT_S);
        let frozen = |channel| {
            let noise =
                sensors.get(&channel).map(|sensor: &SensorDeclaration| sensor.declared.noise_sigma)?;
            FrozenLimit::of_noise(noise, frozen_s)
        };
        let guard = |name, channel: Channel, reaction: Reaction| SignalGuard {
            name,
            channel,
            above: None,
            below: None,
            change: None,
            hysteresis: 0.0,
            dwell_s: DEFAULT_DWELL_S,
            age_s,
            frozen: [Channel::ShaftSpeed, Channel::P2, Channel::T2]
                .contains(&channel)
                .then(|| frozen(channel))
                .flatten(),
            reaction,
        };
        let mut overspeed = SignalGuard {
            above: Some(limits.speed_max_rpm),
            ..guard(GuardName::Overspeed, Channel::ShaftSpeed, Reaction::Latch)
        };
        self.overspeed.apply(&mut overspeed);
        let mut p3 = SignalGuard {
            above: Some(limits.p3_max_pa),
            ..guard(GuardName::TurbineInletPressure, Channel::P3, Reaction::Safe)
        };
        self.turbine_inlet_pressure.apply(&mut p3);
        let mut signals = vec![overspeed, p3];
        let (t2, t3) = (GuardName::CompressorOutletTemperature, GuardName::TurbineInletTemperature);
        for (name, channel, file, above) in [
            (t2, Channel::T2, self.compressor_outlet_temperature, limits.t2_max_k),
            (t3, Channel::T3, self.turbine_inlet_temperature, limits.t3_max_k),
        ] {
            let change = file.change.map(|change| LargestChange {
                change: change.value,
                within_s: value_or(file.within, DEFAULT_CHANGE_WITHIN_S),
            });
            let mut temperature = SignalGuard { above, change, ..guard(name, channel, Reaction::Safe) };
            file.apply(&mut temperature);
            // T2 is monitored for valid readings even without a limit.
            if temperature.above.is_some() || temperature.change.is_some() || channel == Channel::T2 {
                signals.push(temperature);
            }
        }
        // P2 is monitored too, since the surge guard needs it.
        signals.push(guard(GuardName::Signals, Channel::P2, Reaction::Safe));
        if let Some(file) = self.oil_temperature {
            let guard = guard(GuardName::OilTemperature, Channel::TOil, Reaction::Safe);
            let mut oil = SignalGuard { dwell_s: DEFAULT_OIL_DWELL_S, ..guard };
            file.apply(&mut oil);
            signals.push(oil);
        }
        let housing = self.housing_gradient;
        let change_k = housing.map(|file| file.change.value).or(limits.housing_gradient_max_k);
        if let Some(change) = change_k {
            let within_s = value_or(housing.and_then(|file| file.within), dwell_s);
            let reaction = housing.and_then(|file| file.reaction).unwrap_or(Reaction::Note);
            signals.push(SignalGuard {
                change: Some(LargestChange { change, within_s }),
                ..guard(GuardName::HousingGradient, Channel::Tc, reaction)
            });
        }
        let mut surge = SurgeVariation {
            flow_ratio: DEFAULT_SURGE_FLOW_RATIO,
            pressure_ratio: DEFAULT_SURGE_PRESSURE_RATIO,
            dwell_s: SURGE_ALLOWED_S,
            reaction: Reaction::Safe,
        };
        self.surge.apply(&mut surge);
        let band_ratio = if speed_is_held { DEFAULT_SPEED_BAND_RATIO } else { DEFAULT_OPEN_LOOP_BAND_RATIO };
        let mut speed = SpeedBand { band_ratio, reaction: Reaction::Safe };
        self.speed.apply(&mut speed);
        GuardSet {
            signals,
            surge: Some(surge),
            speed: Some(speed),
            valve: Some(self.valve.reaction.unwrap_or(Reaction::Note)),
            frozen_flow: frozen(Channel::CompressorFlow),
        }
    }
}

/// Checks that a guard lies within its limit; beyond the limit it would have no effect.
pub(crate) fn check(check: &mut Check<'_>) {
    let pairs: [(Kind, &str, &[&str]); 4] = [
        (Kind::Speed, "overspeed", &["limits", "speed"]),
        (Kind::Temperature, "compressor_outlet_temperature", &["limits", "compressor_outlet_temperature"]),
        (Kind::Temperature, "turbine_inlet_temperature", &["limits", "turbine_inlet_temperature"]),
        (Kind::Pressure, "turbine_inlet_pressure", &["limits", "turbine_inlet_pressure", "max"]),
    ];
    for (kind, guard, limit_path) in pairs {
        let guard_path = steps!["guards", guard, "above"];
        let limit_steps: Vec<mapper_yaml::Step> =
            limit_path.iter().map(|key| mapper_yaml::Step::from(*key)).collect();
        let (guarded, limit) = (check.quantity(kind, &guard_path), check.quantity(kind, &limit_steps));
        if let (Some((guarded_si, guarded)), Some((limit_si, limit))) = (guarded, limit)
            && guarded_si > limit_si
        {
            let message = format!("`{guarded}` is above `{}`, `{limit}`", limit_path.join("."));
            let remedy = "lower it: a guard must not be looser than its limit";
            check.note(FindingKind::Conflict, &guard_path, message, remedy);
        }
    }
    let oil = |key| steps!["guards", "oil_temperature", key];
    let (low, high) =
        (check.quantity(Kind::Temperature, &oil("below")), check.quantity(Kind::Temperature, &oil("above")));
    if let (Some((low_k, low)), Some((high_k, _))) = (low, high)
        && low_k >= high_k
    {
        let message = format!("`{low}` is not below `above`");
        check.note(FindingKind::Conflict, &oil("below"), message, "`below` must be below `above`");
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn guards(text: &str) -> GuardSet {
        let limits = Limits {
            speed_max_rpm: 180e3,
            p3_min_pa: 110e3,
            p3_max_pa: 400e3,
            p3_stroke_s: None,
            t3_max_k: Some(823.15),
            t2_max_k: None,
            surge_margin_min_ratio: None,
            housing_gradient_max_k: None,
            overshoot_max_ratio: None,
            avoid: mapper_core::AvoidedSpeeds::NONE,
        };
        let by =
            GuardInputs { limits: &limits, sensors: &BTreeMap::new(), dwell_s: 120.0, speed_is_held: true };
        crate::testing::any::<GuardsFile>(text).unwrap().guards(&by)
    }

    #[test]
    fn without_a_word_the_limits_are_guarded_and_nothing_can_be_switched_off() {
        let usual = guards("{}");
        let of = |set: &GuardSet, name| set.signals.iter().find(|guard| guard.name == name).copied();
        let overspeed = of(&usual, GuardName::Overspeed).unwrap();
        assert_eq!((overspeed.above, overspeed.reaction), (Some(180e3), Reaction::Latch));
        assert_eq!(of(&usual, GuardName::TurbineInletPressure).unwrap().above, Some(400e3));
        // No limit is given: it is only monitored for valid readings, and a rig that needs the guard does not accept that.
        assert_eq!(of(&usual, GuardName::CompressorOutletTemperature).unwrap().above, None);
        assert!(!usual.ends_on(GuardName::CompressorOutletTemperature));
        assert!(usual.ends_on(GuardName::TurbineInletTemperature) && usual.ends_on(GuardName::Surge));
        for text in ["{overspeed: off}", "{overspeed: {reaction: off}}", "{surge: off}", "{overspeeed: {}}"] {
            assert!(crate::testing::any::<GuardsFile>(text).is_err(), "{text}");
        }
    }

    #[test]
    fn every_key_lands_in_its_own_field() {
        let set = guards(
            "{overspeed: {above: 170 krpm, hysteresis: 500 rpm, dwell: 0 s, reaction: safe}, compressor_outlet_temperature: {change: 60 K, within: 5 s, reaction: hold}, oil_temperature: {below: 20 degC, above: 130 degC}, housing_gradient: {change: 30 K, reaction: smaller_steps}, surge: {flow: 4 %, pressure: 2 %, dwell: 2 s, reaction: skip_step}, speed: {band: 1 %}, signals: {age: 1 s}}",
        );
        let of = |name| set.signals.iter().find(|guard| guard.name == name).copied().unwrap();
        let overspeed = of(GuardName::Overspeed);
        assert_eq!((overspeed.above, overspeed.hysteresis, overspeed.dwell_s), (Some(170e3), 500.0, 0.0));
        let t2 = of(GuardName::CompressorOutletTemperature);
        assert_eq!(t2.change, Some(LargestChange { change: 60.0, within_s: 5.0 }));
        assert_eq!((t2.reaction, t2.age_s), (Reaction::Hold, 1.0));
        let oil = of(GuardName::OilTemperature);
        assert!((oil.below.unwrap() - 293.15).abs() < 1e-9 && (oil.above.unwrap() - 403.15).abs() < 1e-9);
        let housing = of(GuardName::HousingGradient);
        assert_eq!(housing.change, Some(LargestChange { change: 30.0, within_s: 120.0 }));
        let surge = set.surge.unwrap();
        assert!((surge.flow_ratio - 0.04).abs() < 1e-12 && (surge.pressure_ratio - 0.02).abs() < 1e-12);
        assert_eq!((surge.dwell_s, surge.reaction), (2.0, Reaction::SkipStep));
        assert!((set.speed.unwrap().band_ratio - 0.01).abs() < 1e-12);
    }
}
