//! What happens in one simulation, drawn from its seed.

use super::faulty_backend::Fault;
use mapper_core::Channel::{self, CompressorFlow, P2, P3, ShaftSpeed, T2};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Kind of campaign.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    Grid,
    Soaked,
    /// Steps that depend on what was measured.
    Script,
}

/// Where a run is killed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Kill {
    /// Before a call to rig, clock or observer.
    Call(u64),
    /// Before a write.
    Write(u64),
}

#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Disk {
    Good,
    /// Takes this many bytes.
    Full(u64),
    /// Refuses this write or synchronisation.
    Fails(u64),
    /// Takes a third of each write.
    Short,
    /// A signal interrupts every third write.
    Interrupts,
}

/// What happens to the files after a kill.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Damage {
    /// This share of the newest recording is left.
    Cut(f64),
    /// The newest recording is gone.
    Gone,
    /// This share of the journal is left.
    JournalCut(f64),
    JournalGone,
}

/// One start of the program.
#[derive(Debug, Clone)]
pub struct Life {
    pub is_real_time: bool,
    pub kill: Option<Kill>,
    pub faults: Vec<(f64, Fault)>,
    /// Run time, s, and whether the step is to be finished.
    pub stop: Option<(f64, bool)>,
    pub disk: Disk,
    pub write_takes_s: f64,
    /// The clock jumps at this time by this time, s.
    pub wall_jump: Option<(f64, f64)>,
    /// Arming fails: without an answer, or with an error.
    pub arm_fails: Option<bool>,
    /// The release fails: with the link, or with an error.
    pub disarm_fails: Option<bool>,
    /// Another runner, and someone who acknowledges, try the rig at this call.
    pub intruder_at: Option<u64>,
    pub damage: Option<Damage>,
}

impl Life {
    pub fn undisturbed(is_real_time: bool) -> Life {
        Life {
            is_real_time,
            kill: None,
            faults: Vec::new(),
            stop: None,
            disk: Disk::Good,
            write_takes_s: 0.0,
            wall_jump: None,
            arm_fails: None,
            disarm_fails: None,
            intruder_at: None,
            damage: None,
        }
    }

    /// Whether nothing happens that may end the run early.
    pub fn is_undisturbed(&self) -> bool {
        self.kill.is_none()
            && self.faults.is_empty()
            && self.stop.is_none()
            && self.arm_fails.is_none()
            && self.disarm_fails.is_none()
            && !matches!(self.disk, Disk::Full(_) | Disk::Fails(_))
    }
}

#[derive(Debug, Clone)]
pub struct Scenario {
    pub kind: Kind,
    pub is_real_time: bool,
    pub is_exclusive: bool,
    /// Starts, the last of which is not killed.
    pub lives: Vec<Life>,
}

/// Length of an undisturbed run.
#[derive(Debug, Clone, Copy)]
pub struct Extent {
    pub calls: u64,
    pub writes: u64,
    pub bytes: u64,
    pub duration_s: f64,
}

impl Scenario {
    /// `extent`: of an undisturbed run of this kind, by whether it is in real time.
    pub fn draw(seed: u64, extent: impl Fn(Kind, bool) -> Extent) -> Scenario {
        let mut random = Pcg64::seed_from_u64(seed);
        let kind = [Kind::Grid, Kind::Grid, Kind::Soaked, Kind::Script][random.random_range(0..4)];
        let is_real_time = random.random_bool(0.4);
        let extent = extent(kind, is_real_time);
        let kills = [0, 0, 1, 1, 2, 3][random.random_range(0..6)];
        let lives = (0..=kills).map(|life| Life::draw(&mut random, is_real_time, life < kills, &extent));
        let lives = lives.collect();
        Scenario { kind, is_real_time, is_exclusive: random.random_bool(0.7), lives }
    }
}

fn any_of<T: Clone>(random: &mut Pcg64, of: &[T]) -> T {
    of[random.random_range(0..of.len())].clone()
}

fn fault(random: &mut Pcg64) -> Fault {
    let guarded: Channel = any_of(random, &[ShaftSpeed, P2, P3, T2]);
    let frozen = any_of(random, &[ShaftSpeed, P2, T2, CompressorFlow]);
    let short_s = random.random_range(0.1..6.0);
    let count = random.random_range(1..6);
    any_of(
        random,
        &[
            Fault::Frozen(frozen),
            Fault::Nan(guarded),
            Fault::Reads(T2, 700.0),
            Fault::Reads(ShaftSpeed, 190e3),
            Fault::Scaled(P2, 1e-3),
            Fault::Shifted(T2, -273.15),
            Fault::Absent(guarded),
            Fault::Bad(guarded),
            Fault::Old(guarded),
            Fault::Mute(short_s),
            Fault::Mute(1e9),
            Fault::Late(short_s),
            Fault::Doubled,
            Fault::Reordered,
            Fault::Backward(10.0 * short_s),
            Fault::Torn(guarded),
            Fault::Refuses,
            Fault::Ignores,
            Fault::Trips { is_reported: true },
            Fault::Trips { is_reported: false },
            Fault::Lost,
            Fault::LostFor(0.3 * short_s),
            Fault::Silent,
            Fault::Panics,
            Fault::NotSafe(count),
            Fault::NotMadeSafe,
        ],
    )
}

impl Life {
    fn draw(random: &mut Pcg64, is_real_time: bool, is_killed: bool, extent: &Extent) -> Life {
        let mut life = Life::undisturbed(is_real_time);
        if is_killed {
            life.kill = Some(match random.random_bool(0.5) {
                true => Kill::Call(random.random_range(1..=extent.calls)),
                false => Kill::Write(random.random_range(1..=extent.writes)),
            });
            life.damage = random.random_bool(0.25).then(|| {
                let share = random.random_range(0.0..1.0);
                any_of(
                    random,
                    &[Damage::Cut(share), Damage::Gone, Damage::JournalCut(share), Damage::JournalGone],
                )
            });
        }
        let faults = if is_killed { any_of(random, &[0, 0, 1]) } else { any_of(random, &[0, 1, 1, 2]) };
        for _ in 0..faults {
            let fault = fault(random);
            // Only later calls show that the safe state fails.
            let begin_s = match fault {
                Fault::NotSafe(_) => 0.0,
                _ => random.random_range(0.0..extent.duration_s),
            };
            life.faults.push((begin_s, fault));
        }
        if random.random_bool(0.25) {
            life.stop = Some((random.random_range(0.0..extent.duration_s), random.random_bool(0.5)));
        }
        life.disk = match random.random_range(0..10) {
            0 => Disk::Full(random.random_range(0..extent.bytes)),
            1 => Disk::Fails(random.random_range(1..=extent.writes)),
            2 => Disk::Short,
            3 => Disk::Interrupts,
            _ => Disk::Good,
        };
        if random.random_bool(0.1) {
            life.write_takes_s = random.random_range(0.0..2.0);
        }
        if random.random_bool(0.1) {
            let by_s = any_of(random, &[0.5, 30.0, 86400.0]);
            life.wall_jump = Some((random.random_range(0.0..extent.duration_s), by_s));
        }
        if random.random_bool(0.03) {
            life.arm_fails = Some(random.random_bool(0.5));
        }
        if random.random_bool(0.05) {
            life.disarm_fails = Some(random.random_bool(0.5));
        }
        if random.random_bool(0.3) {
            life.intruder_at = Some(random.random_range(1..=extent.calls));
        }
        life
    }
}
