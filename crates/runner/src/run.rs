//! The run itself: warm-up, steps, cool-down, and the way out when something is wrong.

use crate::guard::{Guard, Trip};
use crate::observer::{ObserverError, RunObserver};
use crate::source::{StepSource, StepSourceError};
use crate::speed_control::SpeedControl;
use mapper_core::{
    Backend, BackendError, Clock, Event, EventKind, PlanStep, RigMode, Setpoints, Soak, StepMarker,
};
use std::sync::atomic::{AtomicBool, Ordering};

/// How often the backend is asked for samples, s of run time.
const POLL_INTERVAL_S: f64 = 1.0;
/// How long the rig is still watched after it was made safe, s: the recording shows that it got there.
const SAFE_WATCH_S: f64 = 5.0;

/// How a run ended without a fault of the program.
#[derive(Debug, Clone, PartialEq)]
pub enum RunEnd {
    /// Every step was run.
    Completed,
    /// The operator stopped it; the rig is safe.
    Interrupted {
        /// Run time, s.
        t_s: f64,
    },
    /// A guard tripped; the rig is safe.
    Tripped(Trip),
}

/// Why a run could not go on. The rig was asked to become safe before this is returned.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The rig failed.
    #[error("the rig failed: {0}")]
    Backend(#[from] BackendError),
    /// Recording or another observer failed.
    #[error("{0}")]
    Observer(#[from] ObserverError),
    /// What yields the steps failed.
    #[error("{0}")]
    Source(#[from] StepSourceError),
}

/// Steps, a rig and everything around them.
pub struct Runner<'a> {
    /// What to do: [`PlanSteps`](crate::PlanSteps) for a plan.
    pub steps: &'a mut dyn StepSource,
    /// Where to do it.
    pub backend: &'a mut dyn Backend,
    /// Paces the polls; see [`mapper_core::UnpacedClock`].
    pub clock: &'a mut dyn Clock,
    /// What may end the run.
    pub guards: Vec<Box<dyn Guard>>,
    /// Who looks on.
    pub observer: &'a mut dyn RunObserver,
    /// Holds the speed of each step; `None`: P3 stays as the steps have it.
    pub speed: Option<SpeedControl<'a>>,
    /// Set from outside to stop at the next poll.
    pub stop: &'a AtomicBool,
}

/// Why the way forward ended.
enum Halt {
    Interrupted,
    Tripped(Trip),
    Failed(RunError),
}

impl<E: Into<RunError>> From<E> for Halt {
    fn from(error: E) -> Self {
        Halt::Failed(error.into())
    }
}

impl Runner<'_> {
    /// Runs all steps from arming to disarming.
    ///
    /// Whatever ends it, the rig has been told to become safe and has been disarmed when this returns.
    ///
    /// # Errors
    /// [`RunError`] where the rig or an observer failed.
    pub fn run(mut self) -> Result<RunEnd, RunError> {
        self.backend.arm()?;
        let mut now_s = 0.0;
        let end = match self.forward(&mut now_s) {
            Ok(()) => Ok(RunEnd::Completed),
            Err(halt) => self.way_out(halt, now_s),
        };
        let disarmed = self.backend.disarm();
        let end = end?;
        disarmed?;
        Ok(end)
    }

    fn forward(&mut self, now_s: &mut f64) -> Result<(), Halt> {
        self.observer.on_start(&self.backend.describe())?;
        let mut next = self.steps.next_step()?;
        self.pass_notes(*now_s)?;
        if let Some(first) = &next {
            if let Some(soak) = self.steps.soak() {
                self.rest(first, soak, now_s)?;
            }
            let warm_s = *now_s + self.steps.warm_up_s();
            if warm_s > *now_s {
                let mut told = self.begin(first, *now_s);
                self.backend.set(&told)?;
                self.watch(now_s, warm_s, false, Some(&mut told))?;
                // The first step itself tells whether its speed was reached.
                let _ = self.speed.as_mut().map(|speed| speed.end(*now_s));
            }
        }
        while let Some(step) = next {
            let mut told = self.begin(&step, *now_s);
            let mut marker = StepMarker {
                index: step.index,
                kind: step.kind,
                start_s: *now_s,
                end_s: *now_s + step.dwell_s,
                from: step.from,
                to: Some(step.to),
                p3_pa: told.p3_pa,
                valve_opening_ratio: step.to.valve_opening_ratio,
            };
            self.backend.set(&told)?;
            self.observer.on_step_start(&marker)?;
            let watched = self.watch(now_s, marker.end_s, true, Some(&mut told));
            if watched.is_ok() {
                self.end(*now_s)?;
            }
            marker.end_s = *now_s;
            // What ended the step early outranks a marker that could not be written.
            let told = self.observer.on_step_end(&marker);
            watched?;
            told?;
            self.steps.after_step(&marker)?;
            next = self.steps.next_step()?;
            self.pass_notes(*now_s)?;
        }
        self.backend.make_safe()?;
        let end_s = *now_s + self.steps.cool_down_s();
        self.watch(now_s, end_s, false, None)
    }

    /// What the rig is told at the start of a step.
    fn begin(&mut self, step: &PlanStep, now_s: f64) -> Setpoints {
        let p3_pa = self.speed.as_mut().map_or(step.p3_pa, |speed| speed.begin(step, now_s));
        Setpoints { p3_pa, ..setpoints(step) }
    }

    /// Tells of a step whose speed was not reached.
    fn end(&mut self, now_s: f64) -> Result<(), ObserverError> {
        let event = self.speed.as_mut().and_then(|speed| speed.end(now_s));
        event.map_or(Ok(()), |event| self.observer.on_event(&event))
    }

    /// Keeps the machine at rest for as long as the soak asks; events mark both ends.
    fn rest(&mut self, first: &PlanStep, soak: Soak, now_s: &mut f64) -> Result<(), Halt> {
        let at_rest = Setpoints {
            mode: RigMode::Standstill,
            oil_temperature_k: soak.oil_temperature_k,
            ..setpoints(first)
        };
        self.backend.set(&at_rest)?;
        let message =
            format!("soak for {:.0} s: air off, oil at {:.2} K", soak.duration_s, soak.oil_temperature_k);
        self.observer.on_event(&Event { t_s: *now_s, kind: EventKind::SoakStarted, message })?;
        let end_s = *now_s + soak.duration_s;
        self.watch(now_s, end_s, false, None)?;
        let message = "the soak is over, air on".to_owned();
        self.observer.on_event(&Event { t_s: *now_s, kind: EventKind::SoakEnded, message })?;
        Ok(())
    }

    /// Hands the source's notes to the observer.
    fn pass_notes(&mut self, t_s: f64) -> Result<(), ObserverError> {
        let mut notes = self.steps.take_notes().into_iter();
        notes.try_for_each(|message| self.observer.on_event(&Event { t_s, kind: EventKind::Note, message }))
    }

    /// Lets the rig run to `until_s` under the eyes of guards, observer and source, which may end a step early. `told` is what
    /// the rig was told last, where its speed may be held.
    fn watch(
        &mut self,
        now_s: &mut f64,
        until_s: f64,
        may_end_early: bool,
        mut told: Option<&mut Setpoints>,
    ) -> Result<(), Halt> {
        while *now_s < until_s {
            if self.stop.load(Ordering::Relaxed) {
                return Err(Halt::Interrupted);
            }
            let next_s = (*now_s + POLL_INTERVAL_S).min(until_s);
            self.clock.wait_until(next_s);
            let batch = self.backend.poll(next_s)?;
            *now_s = next_s;
            let trip = self.guards.iter_mut().find_map(|guard| guard.check(&batch));
            self.observer.on_batch(&batch)?;
            if let Some(trip) = trip {
                return Err(Halt::Tripped(trip));
            }
            let ends = self.steps.on_batch(&batch);
            if ends && may_end_early {
                break;
            }
            if let (Some(speed), Some(told)) = (&mut self.speed, &mut told) {
                let (p3_pa, event) = speed.on_batch(&batch);
                event.map_or(Ok(()), |event| self.observer.on_event(&event))?;
                // At the end of a step the next one has the say.
                if let Some(p3_pa) = p3_pa.filter(|_| *now_s < until_s) {
                    told.p3_pa = p3_pa;
                    self.backend.set(told)?;
                }
            }
        }
        Ok(())
    }

    /// Safe state first, then the records of why.
    fn way_out(&mut self, halt: Halt, now_s: f64) -> Result<RunEnd, RunError> {
        let safe = self.backend.make_safe();
        let (end, kind, message) = match halt {
            Halt::Interrupted => (
                Ok(RunEnd::Interrupted { t_s: now_s }),
                EventKind::Interrupted,
                "stopped by the operator".to_owned(),
            ),
            Halt::Tripped(trip) => {
                let reason = trip.reason.clone();
                (Ok(RunEnd::Tripped(trip)), EventKind::GuardTripped, reason)
            }
            Halt::Failed(error) => {
                let message = error.to_string();
                (Err(error), EventKind::Note, message)
            }
        };
        // The error that ended the run outranks any that telling of it may meet.
        let told = self.tell_the_end(now_s, kind, message, safe.is_ok());
        let end = end?;
        safe?;
        told?;
        Ok(end)
    }

    fn tell_the_end(
        &mut self,
        now_s: f64,
        kind: EventKind,
        message: String,
        safe: bool,
    ) -> Result<(), RunError> {
        self.observer.on_event(&Event { t_s: now_s, kind, message })?;
        self.pass_notes(now_s)?;
        if safe {
            let message = "air off, valve open".to_owned();
            self.observer.on_event(&Event { t_s: now_s, kind: EventKind::SafeState, message })?;
            let batch = self.backend.poll(now_s + SAFE_WATCH_S)?;
            self.observer.on_batch(&batch)?;
        }
        Ok(())
    }
}

fn setpoints(step: &PlanStep) -> Setpoints {
    Setpoints {
        mode: RigMode::Running,
        p3_pa: step.p3_pa,
        t3_k: step.t3_k,
        valve_opening_ratio: step.to.valve_opening_ratio,
        oil_temperature_k: step.oil_temperature_k,
    }
}
