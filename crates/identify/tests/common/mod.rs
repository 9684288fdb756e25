//! Recordings made from eqs. 1-3 with known efficiency and heat-transfer coefficient.
#![allow(dead_code, reason = "each test file uses its own part")]

use mapper_core::{Channel, Recording, Series, StepKind, StepMarker};
use mapper_physics::gas::air::Air;
use mapper_physics::laws::compression::{CompressionInputs, compress, isentropic_rise_ratio};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

/// A transient with a changing housing temperature and everything else constant.
#[derive(Debug, Clone, Copy)]
pub struct Transient {
    pub t1_k: f64,
    pub pressure_ratio: f64,
    pub flow_kg_s: f64,
    pub tc_start_k: f64,
    pub tc_end_k: f64,
    pub time_constant_s: f64,
    pub eta: f64,
    pub h_w_m2k: f64,
    pub alpha_area_ratio: f64,
}

impl Default for Transient {
    /// Like 50 -> 110 krpm on the nominal machine at opening 0.7.
    fn default() -> Self {
        Transient {
            t1_k: 298.15,
            pressure_ratio: 1.7,
            flow_kg_s: 0.06,
            tc_start_k: 335.0,
            tc_end_k: 372.0,
            time_constant_s: 60.0,
            eta: 0.72,
            h_w_m2k: 1200.0,
            alpha_area_ratio: 0.0,
        }
    }
}

pub const INTERNAL_AREA_M2: f64 = 29e-3;
pub const STEP_S: f64 = 120.0;

impl Transient {
    pub fn t2_k(&self, tc_k: f64) -> f64 {
        let inputs = CompressionInputs {
            air: Air::PAPER,
            t1_k: self.t1_k,
            tc_k,
            flow_kg_s: self.flow_kg_s,
            isentropic_rise_ratio: isentropic_rise_ratio(self.pressure_ratio, self.t1_k, Air::PAPER),
            efficiency: self.eta,
            h_w_m2k: self.h_w_m2k,
            inlet_h_ratio: 1.0,
            alpha_area_ratio: self.alpha_area_ratio,
            internal_area_m2: INTERNAL_AREA_M2,
        };
        compress(&inputs, None).t2_k
    }

    /// 30 s of hold as step 0, then the transient of 120 s as step 1, at 10 Hz.
    pub fn recording(&self) -> Recording {
        let mut recording = Recording::default();
        for i in 0..1500 {
            let t_s = f64::from(i) * 0.1;
            let since_s = (t_s - 30.0).max(0.0);
            let tc_k =
                self.tc_end_k + (self.tc_start_k - self.tc_end_k) * (-since_s / self.time_constant_s).exp();
            for (channel, value) in [
                (Channel::ShaftSpeed, 110e3),
                (Channel::CompressorFlow, self.flow_kg_s),
                (Channel::P1, 100e3),
                (Channel::T1, self.t1_k),
                (Channel::P2, 100e3 * self.pressure_ratio),
                (Channel::T2, self.t2_k(tc_k)),
                (Channel::Tc, tc_k),
            ] {
                let series = recording.series.entry(channel).or_default();
                series.t_s.push(t_s);
                series.values.push(value);
            }
        }
        let step = |index, start_s, end_s, p3_pa| StepMarker {
            index,
            kind: StepKind::Point,
            start_s,
            end_s,
            from: None,
            to: None,
            p3_pa,
            valve_opening_ratio: 0.7,
        };
        recording.steps = vec![step(0, 0.0, 30.0, 120e3), step(1, 30.0, 150.0, 170e3)];
        recording
    }
}

/// One-sigma noise at 10 Hz and fixed offsets of a good rig, SI units.
pub const RIG: [(Channel, f64, f64); 7] = [
    (Channel::ShaftSpeed, 30.0, 0.0),
    (Channel::CompressorFlow, 1.5e-4, 0.0),
    (Channel::P1, 20.0, 50.0),
    (Channel::P2, 60.0, 100.0),
    (Channel::T1, 0.1, 0.25),
    (Channel::T2, 0.1, 0.25),
    (Channel::Tc, 0.15, 0.3),
];

/// Adds noise: white with 0.8 of the sigma and first-order, 2 s, with 0.6 of it.
pub fn add_noise(series: &mut Series, sigma: f64, rng: &mut impl Rng) {
    let mut normal = || -> f64 { StandardNormal.sample(rng) };
    let mut coloured = normal();
    let mut last_s = series.t_s.first().copied().unwrap_or(0.0);
    for (t_s, value) in series.t_s.iter().zip(&mut series.values) {
        let decay = ((last_s - t_s) / 2.0).exp();
        coloured = decay * coloured + (1.0 - decay * decay).sqrt() * normal();
        *value += sigma * (0.8 * normal() + 0.6 * coloured);
        last_s = *t_s;
    }
}
