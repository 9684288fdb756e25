//! A rig with auxiliary instruments: the virtual lab, and instruments that deliver, delay or lose their readings.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use mapper_backends::virtual_lab::{LabSettings, VirtualLab};
use mapper_core::{
    Backend, BackendError, Channel, ChannelColumn, RigDescription, RigMode, SafeTrajectory, SampleBatch,
    Setpoints,
};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::model::Model;
use mapper_runner::{AuxiliaryInstrument, RigWithInstruments};
use std::time::Duration;

/// Returns its own time as T_amb at this rate, with a delay, until its loss at a given time.
struct Instrument {
    rate_hz: f64,
    late_s: f64,
    lost_s: f64,
    simulated_time: bool,
    next: u64,
}

impl Backend for Instrument {
    fn describe(&self) -> RigDescription {
        RigDescription {
            backend: "instrument".to_owned(),
            version: "1".to_owned(),
            channels: vec![Channel::TAmb, Channel::T1],
            sample_rate_hz: self.rate_hz,
            simulated_time: self.simulated_time,
            controls: false,
            exclusive: None,
            reached_at: None,
            needs_guarded: Vec::new(),
            accepts: None,
            safe: SafeTrajectory::default(),
        }
    }
    fn arm(&mut self) -> Result<(), BackendError> {
        self.next = 0;
        Ok(())
    }
    fn set(&mut self, _: &Setpoints) -> Result<(), BackendError> {
        panic!("a reader gets no commands")
    }
    fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
        if until_s >= self.lost_s {
            return Err(BackendError::Lost { t_s: until_s, source: "unplugged".into() });
        }
        let first_sequence = self.next;
        let mut t_s = Vec::new();
        while self.next as f64 / self.rate_hz <= until_s - self.late_s {
            t_s.push(self.next as f64 / self.rate_hz);
            self.next += 1;
        }
        let column = |channel| ChannelColumn { channel, values: t_s.clone() };
        let columns = vec![column(Channel::TAmb), column(Channel::T1)];
        Ok(SampleBatch { first_sequence, columns, t_s, ..SampleBatch::default() })
    }
    fn make_safe(&mut self) -> Result<(), BackendError> {
        panic!("a reader gets no commands")
    }
    fn disarm(&mut self) -> Result<(), BackendError> {
        Ok(())
    }
}

fn rig(instrument: Instrument) -> RigWithInstruments {
    let lab = VirtualLab::new(LabSettings::ideal(Model::nominal(), BoundaryConditions::default()));
    let reader = AuxiliaryInstrument {
        name: "cell".to_owned(),
        backend: Box::new(instrument),
        channels: vec![Channel::TAmb],
    };
    let mut rig = RigWithInstruments::new(Box::new(lab), vec![reader], Duration::from_secs(5)).unwrap();
    rig.arm().unwrap();
    rig.set(&Setpoints {
        mode: RigMode::Running,
        p3_pa: 150e3,
        t3_k: 600.0,
        valve_opening_ratio: 1.0,
        oil_temperature_k: 330.0,
    })
    .unwrap();
    rig
}

fn instrument(rate_hz: f64) -> Instrument {
    Instrument { rate_hz, late_s: 0.0, lost_s: f64::INFINITY, simulated_time: true, next: 0 }
}

/// Finite readings of a channel with their times.
fn readings(batches: &[SampleBatch], channel: Channel) -> Vec<(f64, f64)> {
    let of = |batch: &SampleBatch| -> Vec<(f64, f64)> {
        let column = batch.column(channel).unwrap();
        assert_eq!(column.len(), batch.t_s.len());
        batch.t_s.iter().copied().zip(column.iter().copied()).filter(|(_, v)| v.is_finite()).collect()
    };
    batches.iter().flat_map(of).collect()
}

/// A faster and a slower instrument keep their own rates and times. No reading is lost, and polling does not change them.
#[test]
fn each_channel_keeps_the_times_of_its_source() {
    for rate_hz in [2.5, 10.0, 1000.0] {
        let polled = |untils: &[f64]| {
            let mut rig = rig(instrument(rate_hz));
            assert_eq!(rig.describe().channels.len(), 19);
            let batches: Vec<SampleBatch> =
                untils.iter().map(|until_s| rig.poll(*until_s).unwrap()).collect();
            let mut next = 0;
            for batch in &batches {
                assert_eq!(batch.first_sequence, next);
                next += batch.t_s.len() as u64;
            }
            rig.make_safe().unwrap();
            rig.disarm().unwrap();
            // The lab's solver steps end with a poll: values differ in the last bits, times do not.
            let t2 = readings(&batches, Channel::T2).into_iter().map(|(t_s, _)| t_s).collect::<Vec<f64>>();
            (readings(&batches, Channel::TAmb), t2)
        };
        let (air, t2) = polled(&[1.0, 1.04, 3.0]);
        assert_eq!((air.clone(), t2.clone()), polled(&[3.0]), "{rate_hz} Hz");
        assert!(air.iter().all(|(t_s, value)| t_s == value), "{rate_hz} Hz");
        // Readings beyond the rig's last sample wait for the next one.
        let last_s = *t2.last().unwrap();
        assert_eq!(air.len(), (last_s * rate_hz).floor() as usize + 1, "{rate_hz} Hz");
    }
}

/// A late reading follows the samples already passed on, and keeps its source time. A lost instrument delays nothing.
#[test]
fn late_readings_keep_the_time_of_their_source_and_a_lost_reader_is_reported() {
    let mut rig = rig(Instrument { late_s: 0.25, lost_s: 2.0, ..instrument(10.0) });
    let batches: Vec<SampleBatch> =
        (1..=30).map(|tenth| rig.poll(f64::from(tenth) * 0.1 + 0.01).unwrap()).collect();
    let air = readings(&batches, Channel::TAmb);
    assert!(air.len() > 15);
    let times: Vec<f64> = batches.iter().flat_map(|batch| batch.t_s.clone()).collect();
    assert!(times.is_sorted_by(|a, b| a < b));
    let (batch, from) = batches.iter().find_map(|b| Some((b, b.provenance_of(Channel::TAmb)?))).unwrap();
    let column = batch.column(Channel::TAmb).unwrap();
    let at = column.iter().position(|value| value.is_finite()).unwrap();
    assert_eq!(from.source_t_s[at], column[at]);
    assert!(batch.t_s[at] > from.source_t_s[at]);
    assert!(air.iter().all(|(t_s, source_s)| t_s - source_s < 0.45), "{air:?}");
    let messages: Vec<&str> =
        batches.iter().flat_map(|batch| &batch.events).map(|event| event.message.as_str()).collect();
    assert_eq!(messages.len(), 1, "{messages:?}");
    assert!(messages[0].contains("`cell`") && messages[0].contains("unplugged"), "{messages:?}");
    assert_eq!(readings(&batches, Channel::T2).len(), 31, "the rig goes on");
}

/// In real time a hanging instrument does not delay the polling of the rig.
#[test]
fn a_run_in_real_time_does_not_wait_for_a_reader() {
    struct Hangs(std::sync::mpsc::Receiver<()>, Instrument);
    impl Backend for Hangs {
        fn describe(&self) -> RigDescription {
            self.1.describe()
        }
        fn arm(&mut self) -> Result<(), BackendError> {
            self.1.arm()
        }
        fn set(&mut self, setpoints: &Setpoints) -> Result<(), BackendError> {
            self.1.set(setpoints)
        }
        fn poll(&mut self, until_s: f64) -> Result<SampleBatch, BackendError> {
            // Blocks until the test is over.
            let _ = self.0.recv();
            self.1.poll(until_s)
        }
        fn make_safe(&mut self) -> Result<(), BackendError> {
            self.1.make_safe()
        }
        fn disarm(&mut self) -> Result<(), BackendError> {
            self.1.disarm()
        }
    }
    let (release, held) = std::sync::mpsc::channel::<()>();
    let lab = VirtualLab::new(LabSettings::ideal(Model::nominal(), BoundaryConditions::default()));
    let hangs = Hangs(held, Instrument { simulated_time: false, ..instrument(10.0) });
    let reader = AuxiliaryInstrument {
        name: "cell".to_owned(),
        backend: Box::new(hangs),
        channels: vec![Channel::TAmb],
    };
    // Time to connect, on a machine that is busy with other tests; disconnecting waits for it twice.
    let mut rig = RigWithInstruments::new(Box::new(lab), vec![reader], Duration::from_secs(1)).unwrap();
    assert!(!rig.describe().simulated_time);
    rig.arm().unwrap();
    rig.set(&Setpoints {
        mode: RigMode::Running,
        p3_pa: 150e3,
        t3_k: 600.0,
        valve_opening_ratio: 1.0,
        oil_temperature_k: 330.0,
    })
    .unwrap();
    let batch = rig.poll(2.0).unwrap();
    assert_eq!(batch.column(Channel::T2).unwrap().len(), 21);
    assert!(batch.column(Channel::TAmb).unwrap().iter().all(|value| value.is_nan()));
    rig.make_safe().unwrap();
    rig.disarm().unwrap();
    drop(release);
}
