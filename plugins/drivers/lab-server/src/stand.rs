//! The lab as a PLC sees it: readings, setpoints, a heartbeat, and interlocks that no client can bypass. Time is an argument.

use mapper_core::{
    Backend, BackendError, CHANNELS, Channel, EventKind, MODELLED_CHANNELS, RigMode, SetpointRange,
    SetpointRanges, Setpoints,
};
use std::collections::BTreeMap;

/// Without a heartbeat for this time the air is cut, s of wall time.
const WATCHDOG_S: f64 = 2.0;
/// Factor on the campaign's speed limit above which the air is cut.
const OVERSPEED: f64 = 1.05;

pub fn measured() -> Vec<Channel> {
    let is_command = |channel: Channel| channel.symbol().ends_with("_command");
    CHANNELS[..MODELLED_CHANNELS]
        .iter()
        .map(|row| row.channel)
        .filter(|channel| !is_command(*channel))
        .collect()
}

/// The setpoints, in the order of registers.
pub const SETPOINTS: [Target; 4] = [Target::P3, Target::T3, Target::Valve, Target::OilTemperature];

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Target {
    /// Pa.
    P3,
    /// K.
    T3,
    /// Ratio.
    Valve,
    /// K.
    OilTemperature,
    /// 1 on, 0 off.
    Air,
    /// Any number; it must change at least every 2 s.
    Heartbeat,
    /// 1: acknowledges a trip; only without air.
    Acknowledge,
}

#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{value} is outside {low} to {high}")]
pub struct RefusedValue {
    value: f64,
    low: f64,
    high: f64,
}

pub struct Stand {
    lab: Box<dyn Backend>,
    accepts: SetpointRanges,
    trip_rpm: f64,
    setpoints: Setpoints,
    sent: Option<Setpoints>,
    heartbeat: f64,
    /// Time of its last change, s of wall time.
    last_heartbeat_s: f64,
    tripped: Option<String>,
    readings: BTreeMap<Channel, f64>,
    speed: f64,
    wall_s: f64,
}

impl Stand {
    /// A stand at rest. `speed`: seconds of the lab per second of wall time.
    pub fn new(mut lab: Box<dyn Backend>, speed_max_rpm: f64, speed: f64) -> Result<Stand, BackendError> {
        let any = SetpointRange { low: f64::MIN, high: f64::MAX };
        let all = SetpointRanges { p3_pa: any, t3_k: any, valve_opening_ratio: any, oil_temperature_k: any };
        let accepts = lab.describe().accepts.unwrap_or(all);
        lab.arm()?;
        let setpoints = Setpoints {
            mode: RigMode::Standstill,
            p3_pa: 110e3,
            t3_k: 298.15,
            valve_opening_ratio: 1.0,
            oil_temperature_k: 323.15,
        };
        Ok(Stand {
            lab,
            accepts,
            trip_rpm: OVERSPEED * speed_max_rpm,
            setpoints,
            sent: None,
            heartbeat: 0.0,
            last_heartbeat_s: 0.0,
            tripped: None,
            readings: BTreeMap::new(),
            speed,
            wall_s: 0.0,
        })
    }

    pub fn write(&mut self, target: Target, value: f64) -> Result<(), RefusedValue> {
        let switch = SetpointRange { low: 0.0, high: 1.0 };
        let range = match target {
            Target::P3 => self.accepts.p3_pa,
            Target::T3 => self.accepts.t3_k,
            Target::Valve => self.accepts.valve_opening_ratio,
            Target::OilTemperature => self.accepts.oil_temperature_k,
            Target::Air | Target::Acknowledge => switch,
            Target::Heartbeat => SetpointRange { low: 0.0, high: f64::MAX },
        };
        if !(range.low..=range.high).contains(&value) {
            return Err(RefusedValue { value, low: range.low, high: range.high });
        }
        match target {
            Target::P3 => self.setpoints.p3_pa = value,
            Target::T3 => self.setpoints.t3_k = value,
            Target::Valve => self.setpoints.valve_opening_ratio = value,
            Target::OilTemperature => self.setpoints.oil_temperature_k = value,
            // A tripped stand refuses air.
            Target::Air if value >= 0.5 && self.tripped.is_none() => {
                self.setpoints.mode = RigMode::Running;
                self.last_heartbeat_s = self.wall_s;
            }
            Target::Air => self.setpoints.mode = RigMode::Standstill,
            Target::Heartbeat if value != self.heartbeat => {
                (self.heartbeat, self.last_heartbeat_s) = (value, self.wall_s);
            }
            Target::Heartbeat => {}
            Target::Acknowledge if value >= 0.5 && self.setpoints.mode == RigMode::Standstill => {
                self.tripped = None
            }
            Target::Acknowledge => {}
        }
        Ok(())
    }

    pub fn commanded(&self, target: Target) -> f64 {
        match target {
            Target::P3 => self.setpoints.p3_pa,
            Target::T3 => self.setpoints.t3_k,
            Target::Valve => self.setpoints.valve_opening_ratio,
            Target::OilTemperature => self.setpoints.oil_temperature_k,
            Target::Air => f64::from(u8::from(self.setpoints.mode == RigMode::Running)),
            Target::Heartbeat => self.heartbeat,
            Target::Acknowledge => 0.0,
        }
    }

    /// SI; `None` before the first measurement or if the sensor has no value.
    pub fn reading(&self, channel: Channel) -> Option<f64> {
        self.readings.get(&channel).copied().filter(|value| value.is_finite())
    }

    /// Time of the readings, s of wall time since the beginning.
    pub fn wall_s(&self) -> f64 {
        self.wall_s
    }

    pub fn tripped(&self) -> Option<&str> {
        self.tripped.as_deref()
    }

    fn trip(&mut self, why: String) {
        self.setpoints.mode = RigMode::Standstill;
        self.tripped.get_or_insert(why);
    }

    pub fn advance(&mut self, wall_s: f64) -> Result<(), BackendError> {
        self.wall_s = wall_s;
        let silent_s = wall_s - self.last_heartbeat_s;
        if self.setpoints.mode == RigMode::Running && silent_s > WATCHDOG_S {
            self.trip(format!("no heartbeat for {silent_s:.1} s"));
        }
        if self.sent != Some(self.setpoints) {
            self.lab.set(&self.setpoints)?;
            self.sent = Some(self.setpoints);
        }
        let batch = self.lab.poll(wall_s * self.speed)?;
        for column in &batch.columns {
            if let Some(value) = column.values.last() {
                self.readings.insert(column.channel, *value);
            }
        }
        let rig_trip = batch.events.iter().find(|event| event.kind == EventKind::RigTripped);
        if let Some(event) = rig_trip {
            self.trip(event.message.clone());
        }
        let rpm = self.reading(Channel::ShaftSpeed).unwrap_or(0.0);
        if rpm > self.trip_rpm && self.setpoints.mode == RigMode::Running {
            self.trip(format!("overspeed: {rpm:.0} rpm"));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_backends::BACKENDS;
    use mapper_session::{Registry, nominal_model};

    fn stand() -> Stand {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../campaigns/turbo_a.yaml");
        let campaign = mapper_campaign::load(path.as_ref()).unwrap();
        let registry = Registry { backends: BACKENDS.to_vec(), ..Registry::empty() };
        let lab = registry.make_backend(&campaign, &nominal_model(&campaign).unwrap()).unwrap();
        Stand::new(lab, 120_000.0, 10.0).unwrap()
    }

    /// Ten seconds of the lab per second of wall time.
    fn run(stand: &mut Stand, from_s: f64, to_s: f64, beats: bool) {
        let tenths = ((to_s - from_s) * 10.0).round() as u32;
        for tenth in 1..=tenths {
            if beats {
                stand.write(Target::Heartbeat, f64::from(tenth)).unwrap();
            }
            stand.advance(from_s + f64::from(tenth) / 10.0).unwrap();
        }
    }

    #[test]
    fn the_air_is_cut_without_a_heartbeat_and_above_the_speed_until_it_is_acknowledged() {
        let mut stand = stand();
        for (target, value) in [(Target::P3, 180e3), (Target::T3, 700.0), (Target::Air, 1.0)] {
            stand.write(target, value).unwrap();
        }
        run(&mut stand, 0.0, 4.0, true);
        let rpm = stand.reading(Channel::ShaftSpeed).unwrap();
        assert!(rpm > 50_000.0 && stand.tripped().is_none(), "{rpm}");
        assert!(stand.write(Target::P3, 1e9).is_err());
        assert_eq!(stand.commanded(Target::P3), 180e3);
        run(&mut stand, 4.0, 7.0, false);
        assert!(stand.tripped().unwrap().contains("no heartbeat"));
        stand.write(Target::Air, 1.0).unwrap();
        assert_eq!(stand.commanded(Target::Air), 0.0);
        stand.write(Target::Acknowledge, 1.0).unwrap();
        stand.write(Target::Air, 1.0).unwrap();
        assert_eq!(stand.commanded(Target::Air), 1.0);
        stand.write(Target::P3, 380e3).unwrap();
        run(&mut stand, 7.0, 12.0, true);
        assert!(stand.tripped().unwrap().contains("overspeed"), "{:?}", stand.reading(Channel::ShaftSpeed));
    }
}
