//! Redundant sensors of a channel in the lab: each has its own errors and probe, and may have a fault.

use crate::virtual_lab::sensors::sensor::{Sensor, SensorErrors};
use mapper_core::{Channel, Element, ElementColumn, RedundantSensors};
use mapper_physics::laws::thermocouple;
use mapper_physics::rig::instruments::{ChannelFollower, ChannelPath};
use mapper_physics::simulation::model::Outputs;

/// True properties of a redundant sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LabElement {
    /// Errors.
    pub errors: SensorErrors,
    /// Diameter of its tip, m, if it differs from the machine's T2 probe; for T2 only.
    pub probe_diameter_m: Option<f64>,
    /// Time constant of its own lag, s; 0 without lag.
    pub lag_s: f64,
    /// Run time at which the reading freezes, s; infinite for a fault-free sensor.
    pub stuck_after_s: f64,
}

/// The sensors of one channel.
#[derive(Debug, Clone, PartialEq)]
pub struct LabElements {
    /// Declared sensors, which the rig combines into one reading.
    pub declared: RedundantSensors,
    /// True sensors.
    pub elements: Vec<LabElement>,
}

/// Offset of the random streams of redundant sensors, above those of the channels.
const STREAMS_OF_CHANNELS: u64 = 1000;

/// The stream of random numbers of a redundant sensor.
pub(crate) fn stream(element: Element) -> u64 {
    element.channel as u64 + STREAMS_OF_CHANNELS * element.number as u64
}

/// The sensors of one channel while the lab runs.
#[derive(Debug)]
pub(crate) struct ElementBank {
    pub(crate) channel: Channel,
    declared: RedundantSensors,
    members: Vec<Member>,
    readings: Vec<f64>,
}

#[derive(Debug)]
struct Member {
    properties: LabElement,
    sensor: Sensor,
    follower: ChannelFollower,
    tip: Option<Tip>,
    last: f64,
}

/// A probe tip that follows the gas: time, gas and tip temperature of the last sample.
#[derive(Debug, Clone, Copy)]
struct Tip {
    t_s: f64,
    gas_k: f64,
    tip_k: f64,
}

impl ElementBank {
    pub(crate) fn new(channel: Channel, elements: &LabElements, sample_s: f64, seed: u64) -> Self {
        let member = |(index, element): (usize, &LabElement)| Member {
            properties: *element,
            sensor: Sensor::new(
                element.errors,
                sample_s,
                seed,
                stream(Element { channel, number: index + 1 }),
            ),
            follower: ChannelFollower::new(ChannelPath { lag_s: element.lag_s, ..ChannelPath::default() }),
            tip: None,
            last: f64::NAN,
        };
        ElementBank {
            channel,
            declared: elements.declared.clone(),
            members: elements.elements.iter().enumerate().map(member).collect(),
            readings: vec![f64::NAN; elements.elements.len()],
        }
    }

    /// Columns for one batch.
    pub(crate) fn columns(&self) -> impl Iterator<Item = ElementColumn> + '_ {
        (1..=self.members.len()).map(|number| ElementColumn {
            element: Element { channel: self.channel, number },
            values: Vec::new(),
        })
    }

    /// Reading of each sensor for `truth`, and the rig's combined reading. `outputs`: of a running machine; `drifted` adds drift to a reading.
    pub(crate) fn read(
        &mut self,
        t_s: f64,
        truth: f64,
        outputs: Option<&Outputs>,
        pipe_diameter_m: f64,
        drifted: impl Fn(f64) -> f64,
    ) -> (&[f64], f64) {
        for (member, reading) in self.members.iter_mut().zip(&mut self.readings) {
            let quantity = truth + member.offset_from_probe_k(t_s, outputs, pipe_diameter_m);
            let read = drifted(member.sensor.read(member.follower.read(t_s, quantity)));
            if t_s < member.properties.stuck_after_s || member.last.is_nan() {
                member.last = read;
            }
            *reading = member.last;
        }
        (&self.readings, self.declared.live(&self.readings))
    }
}

impl Member {
    /// Temperature of its tip minus that of the machine's probe, K; 0 except for T2 probes of another diameter.
    fn offset_from_probe_k(&mut self, t_s: f64, outputs: Option<&Outputs>, pipe_diameter_m: f64) -> f64 {
        let Some((diameter_m, outputs)) = self.properties.probe_diameter_m.zip(outputs) else {
            // At rest all tips have the same temperature.
            self.tip = None;
            return 0.0;
        };
        let gas_k = outputs.t2_probe_target_k;
        let tau_s =
            thermocouple::time_constant_s(diameter_m, pipe_diameter_m, outputs.flow_kg_s, outputs.t2_k);
        let tip_k = match self.tip {
            Some(before) if tau_s > 0.0 && tau_s.is_finite() && t_s > before.t_s => {
                // Exact for gas that changes linearly between samples.
                let dt_s = t_s - before.t_s;
                let slope_k_s = (gas_k - before.gas_k) / dt_s;
                let follows_k = gas_k - slope_k_s * tau_s;
                follows_k + (before.tip_k - (before.gas_k - slope_k_s * tau_s)) * (-dt_s / tau_s).exp()
            }
            _ => gas_k,
        };
        self.tip = Some(Tip { t_s, gas_k, tip_k });
        tip_k - outputs.t2_probe_k
    }
}
