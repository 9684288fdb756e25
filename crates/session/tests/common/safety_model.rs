//! All states of two runners, an operator, a driver and one rig, with the transitions of the program itself: files and locks are those of
//! [`RigStates`], signals those of [`RunStop`], reactions, stops, stated ends and lockouts the functions that a run calls.
//!
//! Its own are the order of a run's calls and the lease of the driver, which `mapper-driver` tests.

use crate::rig::rig_state::{Claim, Lockout, Owner, RigLease, RigStates};
use crate::run::prepared_run::lockout_reason;
use crate::run::run_stop::{Phase, RunStop};
use mapper_core::{BackendError, GuardName, Reaction, RunEnding, Trip};
use mapper_runner::{MAX_ATTEMPTS, RunError, TripResponse, stated_end, stop_is_due};
use stateright::{Checker, Model, Property};
use std::collections::HashMap;
use std::path::PathBuf;
use std::sync::Mutex;
use std::sync::atomic::Ordering;

const RIG: &str = "cell";

/// Why a run ends.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Why {
    Completed,
    Stopped,
    /// A guard, with `safe` or `latch`.
    Trip(bool),
    /// The rig did not answer.
    Lost,
    /// The disk failed.
    Disk,
    Panic,
    /// Refused while arming, or without an answer.
    NotArmed {
        answered: bool,
    },
}

impl Why {
    /// Whether the rig must be inspected after it.
    fn is_severe(self) -> bool {
        matches!(self, Why::Trip(true) | Why::Lost | Why::Panic)
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum Stage {
    Idle,
    /// It has the lock; the files do not name it yet.
    Claimed,
    Owner,
    /// Armed, without setpoints.
    Armed,
    /// Air on, in a step or between steps.
    Running {
        in_step: bool,
        held: bool,
    },
    /// The safe command was refused this many times.
    Cutting {
        why: Why,
        disk_failed: bool,
        tries: usize,
    },
    /// The safe command was confirmed, or given up.
    Ended {
        why: Why,
        disk_failed: bool,
        confirmed: bool,
    },
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Runner {
    stage: Stage,
    /// The run that it makes or resumes.
    run: u8,
    /// Whether that run had not released the rig.
    took_over: bool,
    /// Suspended from outside: it does nothing, and its driver's lease ends.
    asleep: bool,
    stop_now: bool,
    stop_after_step: bool,
}

/// What the files of the rig say.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
struct Files {
    owner: Option<u8>,
    latch: bool,
}

#[derive(Debug, Clone, PartialEq, Eq, Hash)]
struct State {
    files: Files,
    runners: [Runner; 2],
    runs: u8,
    air_on: bool,
    /// The runner whose session the driver serves.
    driven_by: Option<usize>,
    /// The driver has lost its host and makes the rig safe by itself.
    driver_cuts: bool,
    /// A run has ended so that the rig must be inspected, and that is not acknowledged.
    inspect: bool,
    /// The run that was killed and neither resumed nor acknowledged since.
    abandoned: Option<u8>,
    /// The rig was armed although it had to be inspected.
    armed_uninspected: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Action {
    /// A runner starts; it resumes the named run.
    Claim(usize, Option<u8>),
    RecordOwner(usize),
    Arm(usize, bool),
    FirstSetpoints(usize),
    NextStep(usize),
    Guard(usize, Reaction, bool),
    Released(usize),
    /// Ctrl-C, or another signal.
    Signal(usize, bool),
    Check(usize),
    Fails(usize, Why),
    Complete(usize),
    DiskFails(usize),
    MakeSafe(usize, bool),
    /// Locks out if needed, clears the owner, unlocks.
    Release(usize),
    /// Killed after the lockout and before the owner was cleared.
    KilledInRelease(usize),
    Kill(usize),
    Sleep(usize),
    Wake(usize),
    LeaseEnds,
    DriverCuts,
    Acknowledge,
}

/// What a call does to the files, and whether it is admitted.
type FileChanges = HashMap<(Files, Option<usize>, FileCall), (Files, bool)>;

struct Safety {
    folder: tempfile::TempDir,
    /// What the files become, since few of all states differ in them.
    known: Mutex<FileChanges>,
}

/// A call that reads or writes the files, by the runner with the lock or by anyone.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
enum FileCall {
    Claim(Option<u8>),
    RecordOwner(u8),
    Release {
        locks_out: bool,
    },
    /// Of a run that was not armed; whether it has taken over from a killed one.
    ReleaseUntouched {
        abandoned: bool,
    },
    LockOutOnly,
    Acknowledge,
}

fn run(number: u8) -> PathBuf {
    PathBuf::from(format!("/runs/{number}"))
}

impl Safety {
    /// Makes the files, makes the call, and reads what they say then and whether it succeeded.
    fn call(&self, files: Files, holder: Option<usize>, call: FileCall) -> (Files, bool) {
        let key = (files, holder, call);
        if let Some(known) = self.known.lock().unwrap().get(&key) {
            return *known;
        }
        let number = self.known.lock().unwrap().len();
        let states = RigStates::new(&self.folder.path().join(number.to_string()));
        let mut claim: Claim = states.claim(RIG, None).unwrap();
        let lockout = || Lockout { reason: "overspeed".to_owned(), run: run(0) };
        if files.latch {
            claim.lock_out(&lockout()).unwrap();
        }
        let owner =
            |number| Owner { process: 7, host: String::new(), run: run(number), started: String::new() };
        if let Some(number) = files.owner {
            claim.record_owner(&owner(number)).unwrap();
        }
        let mut claim = holder.map(|_| claim);
        let succeeded = match (call, claim.take()) {
            (FileCall::Claim(resumes), held) => {
                let claimed = states.claim(RIG, resumes.map(run).as_deref());
                claim = held;
                claimed.is_ok()
            }
            (FileCall::Acknowledge, held) => {
                let acknowledged = states.acknowledge(RIG);
                claim = held;
                acknowledged.is_ok()
            }
            (FileCall::RecordOwner(number), Some(mut held)) => {
                let recorded = held.record_owner(&owner(number)).is_ok();
                claim = Some(held);
                recorded
            }
            (FileCall::Release { locks_out }, Some(held)) => {
                let lease = RigLease::of(held);
                lease.release(locks_out.then(|| "overspeed".to_owned()), &run(0)).is_ok()
            }
            (FileCall::ReleaseUntouched { abandoned }, Some(mut held)) => {
                held.is_abandoned = abandoned;
                RigLease::of(held).release_untouched().is_ok()
            }
            (FileCall::LockOutOnly, Some(held)) => held.lock_out(&lockout()).is_ok(),
            (_, None) => panic!("{call:?} without the lock"),
        };
        drop(claim);
        let status = states.status(RIG).unwrap();
        let owner =
            status.owner.map(|owner| owner.run.file_name().unwrap().to_str().unwrap().parse().unwrap());
        let after = (Files { owner, latch: status.latch.is_some() }, succeeded);
        self.known.lock().unwrap().insert(key, after);
        after
    }
}

impl State {
    /// The runner's process ends: its driver, without a host, makes the rig safe.
    fn lose(&mut self, at: usize) {
        if self.runners[at].stage != Stage::Claimed && self.files.owner == Some(self.runners[at].run) {
            self.abandoned = Some(self.runners[at].run);
        }
        self.runners[at] = Runner::idle();
        if self.driven_by == Some(at) {
            (self.driven_by, self.driver_cuts) = (None, self.air_on);
        }
    }

    fn holder(&self) -> Option<usize> {
        self.runners.iter().position(|runner| runner.stage != Stage::Idle)
    }
}

impl Runner {
    fn idle() -> Runner {
        Runner {
            stage: Stage::Idle,
            run: 0,
            took_over: false,
            asleep: false,
            stop_now: false,
            stop_after_step: false,
        }
    }

    /// The lockout that the program derives from its stated end.
    fn locks_out(self) -> bool {
        let Stage::Ended { why, disk_failed, confirmed } = self.stage else { return false };
        let lost = || BackendError::Lost { t_s: 0.0, source: "lost".into() };
        let trip = |reaction| Trip { t_s: 0.0, guard: GuardName::Overspeed, reaction, reason: String::new() };
        let disk = || RunError::Observer(mapper_runner::ObserverError::new(std::io::Error::other("full")));
        let end = match why {
            Why::Completed => Ok(RunEnding::Completed),
            Why::Stopped => Ok(RunEnding::Interrupted { t_s: 0.0 }),
            Why::Trip(true) => Ok(RunEnding::Tripped(trip(Reaction::Latch))),
            Why::Trip(false) => Ok(RunEnding::Tripped(trip(Reaction::Safe))),
            Why::Lost => Err(RunError::Backend(lost())),
            Why::Disk => Err(disk()),
            Why::Panic => Err(RunError::Panicked { message: String::new() }),
            Why::NotArmed { answered: true } => {
                return lockout_reason(&Err(RunError::NotArmed(lost()))).is_some();
            }
            Why::NotArmed { answered: false } => {
                let error = BackendError::Deadline { call: "arm", limit_s: 10.0 };
                return lockout_reason(&Err(RunError::NotArmed(error))).is_some();
            }
        };
        let safe = if confirmed { Ok(()) } else { Err(lost()) };
        let reported = if disk_failed { Err(disk()) } else { Ok(()) };
        lockout_reason(&stated_end(end, safe, String::new(), reported)).is_some()
    }
}

impl Model for Safety {
    type State = State;
    type Action = Action;

    fn init_states(&self) -> Vec<State> {
        vec![State {
            files: Files { owner: None, latch: false },
            runners: [Runner::idle(); 2],
            runs: 0,
            air_on: false,
            driven_by: None,
            driver_cuts: false,
            inspect: false,
            abandoned: None,
            armed_uninspected: false,
        }]
    }

    fn actions(&self, state: &State, actions: &mut Vec<Action>) {
        for (at, runner) in state.runners.iter().enumerate() {
            if runner.stage != Stage::Idle {
                actions.push(Action::Kill(at));
                actions.push(if runner.asleep { Action::Wake(at) } else { Action::Sleep(at) });
            }
            if runner.asleep {
                continue;
            }
            if !matches!(runner.stage, Stage::Idle) && !runner.stop_now {
                actions.extend([Action::Signal(at, true), Action::Signal(at, false)]);
            }
            match runner.stage {
                Stage::Idle => {
                    actions.extend((state.runs < 2).then_some(Action::Claim(at, None)));
                    actions.extend((1..=state.runs).map(|run| Action::Claim(at, Some(run))));
                }
                Stage::Claimed => actions.push(Action::RecordOwner(at)),
                Stage::Owner => actions.extend([Action::Arm(at, true), Action::Arm(at, false)]),
                Stage::Armed => actions.extend([Action::FirstSetpoints(at), Action::Check(at)]),
                Stage::Running { in_step, held } => {
                    actions.extend([Action::Check(at), Action::DiskFails(at)]);
                    actions.extend([Why::Lost, Why::Panic].map(|why| Action::Fails(at, why)));
                    for reaction in [
                        Reaction::Note,
                        Reaction::Hold,
                        Reaction::SmallerSteps,
                        Reaction::SkipStep,
                        Reaction::Safe,
                        Reaction::Latch,
                    ] {
                        actions.extend([true, false].map(|may_hold| Action::Guard(at, reaction, may_hold)));
                    }
                    if held {
                        actions.push(Action::Released(at));
                    } else {
                        actions.push(Action::NextStep(at));
                        actions.extend((!in_step).then_some(Action::Complete(at)));
                    }
                }
                Stage::Cutting { .. } => {
                    actions.extend([
                        Action::MakeSafe(at, true),
                        Action::MakeSafe(at, false),
                        Action::DiskFails(at),
                    ]);
                }
                Stage::Ended { .. } => actions.extend([Action::Release(at), Action::KilledInRelease(at)]),
            }
        }
        if state.driven_by.is_some_and(|host| state.runners[host].asleep) {
            actions.push(Action::LeaseEnds);
        }
        actions.extend(state.driver_cuts.then_some(Action::DriverCuts));
        actions.push(Action::Acknowledge);
    }

    fn next_state(&self, before: &State, action: Action) -> Option<State> {
        let mut state = before.clone();
        let holder = state.holder();
        match action {
            Action::Claim(at, resumes) => {
                let (files, succeeded) = self.call(state.files, holder, FileCall::Claim(resumes));
                state.files = files;
                if !succeeded {
                    return None;
                }
                let (run, took_over) = (resumes.unwrap_or(state.runs + 1), state.files.owner.is_some());
                state.runs = state.runs.max(run);
                state.runners[at] = Runner { stage: Stage::Claimed, run, took_over, ..Runner::idle() };
            }
            Action::RecordOwner(at) => {
                let call = FileCall::RecordOwner(state.runners[at].run);
                state.files = self.call(state.files, holder, call).0;
                state.runners[at].stage = Stage::Owner;
            }
            Action::Arm(at, answers) => {
                // A driver serves one host, and another only when the rig of the first is safe.
                let free = state.driven_by.is_none() && !state.driver_cuts;
                let why = Why::NotArmed { answered: answers };
                state.runners[at].stage = Stage::Ended { why, disk_failed: false, confirmed: true };
                if answers && free {
                    state.runners[at].stage = Stage::Armed;
                    state.driven_by = Some(at);
                    let other = |run| run != state.runners[at].run;
                    state.armed_uninspected |= state.inspect || state.abandoned.is_some_and(other);
                    state.abandoned = None;
                }
            }
            Action::FirstSetpoints(at) => {
                state.runners[at].stage = Stage::Running { in_step: false, held: false };
                // After the end of a lease the driver refuses them.
                if state.driven_by == Some(at) {
                    state.air_on = true;
                } else {
                    state.runners[at].stage = Stage::Cutting { why: Why::Lost, disk_failed: false, tries: 0 };
                }
            }
            Action::NextStep(at) => {
                let Stage::Running { in_step, .. } = state.runners[at].stage else { return None };
                state.runners[at].stage = Stage::Running { in_step: !in_step, held: false };
                if state.driven_by != Some(at) {
                    state.runners[at].stage = Stage::Cutting { why: Why::Lost, disk_failed: false, tries: 0 };
                }
            }
            Action::Guard(at, reaction, may_hold) => {
                let Stage::Running { in_step, held } = state.runners[at].stage else { return None };
                let end = Stage::Cutting {
                    why: Why::Trip(reaction == Reaction::Latch),
                    disk_failed: false,
                    tries: 0,
                };
                state.runners[at].stage = match TripResponse::of(reaction, in_step, may_hold) {
                    TripResponse::Continue => Stage::Running { in_step, held },
                    TripResponse::Hold => Stage::Running { in_step, held: true },
                    TripResponse::EndStep => Stage::Running { in_step: false, held: false },
                    TripResponse::End => end,
                };
            }
            Action::Released(at) => {
                let Stage::Running { in_step, .. } = state.runners[at].stage else { return None };
                state.runners[at].stage = Stage::Running { in_step, held: false };
            }
            Action::Signal(at, gentle) => {
                let runner = &mut state.runners[at];
                let stop = RunStop::default();
                stop.now.store(runner.stop_now, Ordering::SeqCst);
                stop.after_step.store(runner.stop_after_step, Ordering::SeqCst);
                stop.enter(Phase::Rig);
                stop.handle_signal(gentle);
                runner.stop_now = stop.now.load(Ordering::SeqCst);
                runner.stop_after_step = stop.after_step.load(Ordering::SeqCst);
            }
            Action::Check(at) => {
                let runner = &mut state.runners[at];
                let in_step = matches!(runner.stage, Stage::Running { in_step: true, .. });
                if !stop_is_due(runner.stop_now, runner.stop_after_step, in_step) {
                    return None;
                }
                runner.stage = Stage::Cutting { why: Why::Stopped, disk_failed: false, tries: 0 };
            }
            Action::Fails(at, why) => {
                state.runners[at].stage = Stage::Cutting { why, disk_failed: false, tries: 0 };
            }
            Action::Complete(at) => {
                state.runners[at].stage =
                    Stage::Cutting { why: Why::Completed, disk_failed: false, tries: 0 };
            }
            Action::DiskFails(at) => {
                let stage = &mut state.runners[at].stage;
                *stage = match *stage {
                    Stage::Cutting { why, tries, .. } => Stage::Cutting { why, tries, disk_failed: true },
                    _ => Stage::Cutting { why: Why::Disk, disk_failed: false, tries: 0 },
                };
            }
            Action::MakeSafe(at, confirms) => {
                let Stage::Cutting { why, disk_failed, tries } = state.runners[at].stage else { return None };
                let ended = |confirmed| Stage::Ended { why, disk_failed, confirmed };
                state.runners[at].stage = match confirms {
                    true => ended(true),
                    false if tries + 1 < MAX_ATTEMPTS => {
                        Stage::Cutting { why, disk_failed, tries: tries + 1 }
                    }
                    false => ended(false),
                };
                if confirms {
                    state.air_on = false;
                } else if matches!(state.runners[at].stage, Stage::Ended { .. }) {
                    // The driver goes on by itself.
                    state.driver_cuts = state.air_on;
                }
                if matches!(state.runners[at].stage, Stage::Ended { .. }) {
                    state.driven_by = state.driven_by.filter(|host| *host != at);
                }
                // What must be inspected is a matter of what happened, not of what the program derives from it.
                let is_over = matches!(state.runners[at].stage, Stage::Ended { .. });
                state.inspect |= is_over && (why.is_severe() || !confirms);
            }
            Action::Release(at) => {
                let (runner, abandoned) = (state.runners[at], state.runners[at].took_over);
                let locks_out = runner.locks_out();
                // Without an answer the rig may arm later; nothing has told so before.
                state.inspect |=
                    matches!(runner.stage, Stage::Ended { why: Why::NotArmed { answered: false }, .. });
                let call = match runner.stage {
                    Stage::Ended { why: Why::NotArmed { .. }, .. } if !locks_out => {
                        FileCall::ReleaseUntouched { abandoned }
                    }
                    _ => FileCall::Release { locks_out },
                };
                let (files, succeeded) = self.call(state.files, holder, call);
                assert!(succeeded);
                state.files = files;
                state.runners[at] = Runner::idle();
            }
            Action::KilledInRelease(at) => {
                if state.runners[at].locks_out() {
                    state.files = self.call(state.files, holder, FileCall::LockOutOnly).0;
                }
                state.lose(at);
            }
            Action::Kill(at) => state.lose(at),
            Action::Sleep(at) => state.runners[at].asleep = true,
            Action::Wake(at) => state.runners[at].asleep = false,
            Action::LeaseEnds => (state.driven_by, state.driver_cuts) = (None, state.air_on),
            Action::DriverCuts => (state.air_on, state.driver_cuts) = (false, false),
            Action::Acknowledge => {
                let (files, succeeded) = self.call(state.files, holder, FileCall::Acknowledge);
                if !succeeded {
                    return None;
                }
                (state.files, state.inspect, state.abandoned) = (files, false, None);
            }
        }
        // A run that must be inspected locks the rig out before anything tells so.
        for (at, runner) in state.runners.iter().enumerate() {
            let knows = match runner.stage {
                Stage::Cutting { why, .. } => why.is_severe(),
                Stage::Ended { why, confirmed, .. } => {
                    !matches!(why, Why::NotArmed { .. }) && (why.is_severe() || !confirmed)
                }
                _ => false,
            };
            if knows && !state.files.latch && before.runners[at].stage != runner.stage {
                state.files = self.call(state.files, Some(at), FileCall::LockOutOnly).0;
            }
        }
        Some(state)
    }

    fn properties(&self) -> Vec<Property<Self>> {
        vec![
            Property::always(
                "air flows only under guards, a safe shutdown, or the driver's lease",
                |_, state: &State| {
                    let guarded = state.driven_by.is_some_and(|host| {
                        matches!(state.runners[host].stage, Stage::Running { .. } | Stage::Cutting { .. })
                    });
                    !state.air_on || guarded || state.driver_cuts
                },
            ),
            Property::always("a rig has one runner", |_, state: &State| {
                state.runners.iter().filter(|runner| runner.stage != Stage::Idle).count() <= 1
            }),
            Property::always("a rig that must be inspected is not armed before", |_, state: &State| {
                !state.armed_uninspected
            }),
            Property::always("a run that has ended leaves its lockout", |_, state: &State| {
                !state.inspect || state.files.latch || state.files.owner.is_some() || state.holder().is_some()
            }),
            // Otherwise the model says nothing.
            Property::sometimes("a run completes", |_, state: &State| {
                state.runs > 0
                    && state.files == Files { owner: None, latch: false }
                    && state.holder().is_none()
            }),
            Property::sometimes("a lockout", |_, state: &State| {
                state.files.latch && state.holder().is_none()
            }),
            Property::sometimes("a resumed run", |_, state: &State| {
                state.files.owner.is_some_and(|run| run < state.runs) && state.air_on
            }),
        ]
    }
}

#[test]
fn no_state_has_air_without_a_guard_a_lost_lockout_or_two_runners() {
    let model = Safety { folder: tempfile::tempdir().unwrap(), known: Mutex::default() };
    let checker = model.checker().spawn_bfs().join();
    eprintln!("{} states", checker.unique_state_count());
    checker.assert_properties();
}
