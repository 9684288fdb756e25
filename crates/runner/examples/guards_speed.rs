//! Benchmark of the guards: an hour of 19 channels at 100 Hz, polled sample by sample, and the time from a violation to the safe command.
//!
//! ```text
//! cargo run --release --locked -p mapper-runner --example guards_speed
//! ```
#![allow(clippy::print_stdout, reason = "it is there to print")]

use mapper_core::{
    Backend, BackendError, CHANNELS, Channel, ChannelColumn, GuardName, OperatingPoint, Plan, PlanFigures,
    PlanInputHashes, PlanStep, Predicted, Reaction, RigDescription, SafeTrajectory, SampleBatch, Setpoints,
    SignalGuard, StepKind, SurgeVariation, UnpacedClock,
};
use mapper_runner::{
    BatchWatch, Guard, PlanSteps, Protection, RigWatch, RunObserver, Runner, SignalWatch, SurgeWatch,
};
use std::sync::atomic::AtomicBool;
use std::time::Instant;

const RATE_HZ: f64 = 100.0;
const HOUR_S: f64 = 3600.0;

/// Readings that wander a little; T2 is too high from the end of the hour on.
struct Hour {
    next: u64,
    violated: Option<Instant>,
    safe: Option<Instant>,
}

impl Backend for Hour {
    fn describe(&self) -> RigDescription {
        RigDescription {
            backend: "hour".to_owned(),
            version: "1".to_owned(),
            channels: CHANNELS.iter().map(|row| row.channel).collect(),
            sample_rate_hz: RATE_HZ,
            simulated_time: false,
            controls: true,
            exclusive: None,
            reached_at: None,
            needs_guarded: Vec::new(),
            accepts: None,
            safe: SafeTrajectory::default(),
        }
    }
    fn arm(&mut self) -> Result<(), BackendError> {
        Ok(())
    }
    fn set(&mut self, _: &Setpoints) -> Result<(), BackendError> {
        // The first command of the run-down.
        if self.violated.is_some() {
            self.safe.get_or_insert_with(Instant::now);
        }
        Ok(())
    }
    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        let first_sequence = self.next;
        let t_s: Vec<f64> =
            (self.next..).map(|index| index as f64 / RATE_HZ).take_while(|t| *t <= until_s + 1e-9).collect();
        self.next += t_s.len() as u64;
        let high = until_s > HOUR_S;
        let column = |channel: Channel| {
            let mean = match channel {
                Channel::ShaftSpeed => 1e5,
                Channel::T2 if high => 900.0,
                _ => 300.0,
            };
            let values = t_s.iter().map(|t| mean * (1.0 + 1e-4 * (97.0 * t).sin())).collect();
            ChannelColumn { channel, values }
        };
        let columns = CHANNELS.iter().map(|row| column(row.channel)).collect();
        if high {
            self.violated.get_or_insert_with(Instant::now);
        }
        Ok(SampleBatch { first_sequence, columns, t_s, ..SampleBatch::default() })
    }
    fn make_safe(&mut self) -> Result<(), BackendError> {
        self.safe.get_or_insert_with(Instant::now);
        Ok(())
    }
    fn disarm(&mut self) -> Result<(), BackendError> {
        Ok(())
    }
}

#[derive(Default)]
struct Counts(u64);

impl RunObserver for Counts {
    fn on_batch(&mut self, batch: &SampleBatch) -> Result<(), mapper_runner::ObserverError> {
        self.0 += batch.t_s.len() as u64;
        Ok(())
    }
}

fn plan() -> Plan {
    let step = PlanStep {
        index: 0,
        kind: StepKind::Point,
        from: None,
        to: OperatingPoint { speed_rpm: 1e5, valve_opening_ratio: 1.0 },
        p3_pa: 2e5,
        t3_k: 773.15,
        oil_temperature_k: 323.15,
        dwell_s: HOUR_S + 60.0,
        start_s: 0.0,
        transition: None,
        predicted: Predicted::settled(0.05, 1.5, 350.0, HOUR_S),
    };
    Plan {
        campaign: "hour".to_owned(),
        objective: "listed".to_owned(),
        seed: 1,
        made_from: PlanInputHashes {
            campaign_sha256: String::new(),
            model_sha256: String::new(),
            script_sha256: None,
            rig_sha256: None,
        },
        warm_up_s: 0.0,
        cool_down_s: 0.0,
        steps: vec![step],
        figures: PlanFigures {
            sum_gradient_k: 0.0,
            min_gradient_k: None,
            worst_sigma_eta: None,
            rms_error_eta: None,
            rms_error_reported_eta: None,
            prior_sensitivity_eta: None,
            worst_error_eta: None,
            minutes: 60.0,
        },
        bound: None,
        bound_remark: None,
        surge_search_s: 0.0,
        remarks: Vec::new(),
    }
}

fn guards() -> Vec<Box<dyn Guard>> {
    let signal = |name, channel, above| {
        Box::new(SignalWatch::new(SignalGuard {
            name,
            channel,
            above: Some(above),
            below: None,
            change: None,
            hysteresis: 0.0,
            dwell_s: 0.0,
            age_s: 3.0,
            frozen: Some(mapper_core::FrozenLimit { after_s: 20.0, band: 0.0 }),
            reaction: Reaction::Safe,
        })) as Box<dyn Guard>
    };
    vec![
        Box::new(BatchWatch::default()),
        Box::new(RigWatch::default()),
        Box::new(SurgeWatch::new(SurgeVariation {
            flow_ratio: 0.05,
            pressure_ratio: 0.01,
            dwell_s: 5.0,
            reaction: Reaction::Safe,
        })),
        signal(GuardName::Overspeed, Channel::ShaftSpeed, 180e3),
        signal(GuardName::TurbineInletPressure, Channel::P3, 500e3),
        signal(GuardName::CompressorOutletTemperature, Channel::T2, 573.0),
        signal(GuardName::TurbineInletTemperature, Channel::T3, 823.0),
        signal(GuardName::Signals, Channel::P2, 1e9),
    ]
}

fn run(guards: Vec<Box<dyn Guard>>) -> Result<(f64, u64, Hour), mapper_runner::RunError> {
    let (plan, mut seen) = (plan(), Counts::default());
    let mut rig = Hour { next: 0, violated: None, safe: None };
    let start = Instant::now();
    Runner {
        steps: &mut PlanSteps::new(&plan),
        backend: &mut rig,
        clock: &mut UnpacedClock,
        guards,
        observer: &mut seen,
        speed: None,
        stop: &AtomicBool::new(false),
    }
    .run_under(&Protection { each_sample: true, ..Protection::default() })?;
    Ok((start.elapsed().as_secs_f64(), seen.0, rig))
}

fn main() -> Result<(), mapper_runner::RunError> {
    let (bare_s, _, _) = run(Vec::new())?;
    let (guarded_s, samples, rig) = run(guards())?;
    println!("{samples} samples of {} channels, asked for one by one", CHANNELS.len());
    println!(
        "the hour took {guarded_s:.2} s with guards and {bare_s:.2} s without: {:.3} % of one core",
        100.0 * guarded_s / HOUR_S
    );
    if let (Some(violated), Some(safe)) = (rig.violated, rig.safe) {
        println!(
            "from the violation to the first safe command: {:.1} us",
            1e6 * (safe - violated).as_secs_f64()
        );
    }
    Ok(())
}
