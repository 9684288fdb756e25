//! A recording compared with the model of its machine: what differs, why, and what to do about it.
//!
//! [`gap()`] explains one recording. It goes through these stages, which `docs/explanation/gap.md` describes in the same order:
//!
//! 1. The drift of sensors between repeats is found ([`drift`]) and subtracted, and so are the offsets that a soak shows ([`gap::RigRecording`]).
//! 2. The recorded inputs drive the nominal model through all steps. With a [baseline](gap::BaselineRecording), only changes since it count.
//! 3. Declared offsets and tolerances are fitted again with every hypothesis: what they explain is no gap.
//! 4. The effects of the library are searched for the most probable set, also of effects that begin later; scores become
//!    [probabilities](gap::Calibration).
//! 5. Steps that were held out of the fits show how much of the [gap](gap::Gap) the cause removes.
//! 6. If a part of the gap is left, [closure terms](gap::ClosureTerm) of a library of physical terms are tried, in each balance of the machine.
//! 7. The [verdict](gap::Verdict) follows from stages 1, 4 and 5. It is made once.
//! 8. All explanations together locate the gap (`locations`), and the most informative [experiment](gap::Suggestion) is proposed; if nothing
//!    is beyond tolerance, the [smallest cause](gap::SmallestSeen) that would have been named.
//!
//! The result, [`gap::Diagnosed`], is the source of what follows: the [map without the causes](gap::Diagnosed::correct), the
//! [calibrated model](gap::Found), which [`gap::ForecastCheck`] compares with a later recording.
//!
//! [`drift::diagnose`] answers which sensor or part changed between repeats, and [`driven::diagnose`] explains logs without steps, of which one side
//! is driven by its measured neighbours.

#![warn(unreachable_pub)]
#![cfg_attr(test, allow(clippy::unwrap_used, clippy::expect_used, clippy::panic))]

mod closure;
pub mod drift;
pub mod driven;
pub mod gap;

pub use gap::diagnose::gap;

#[cfg(test)]
#[path = "../tests/inside/mod.rs"]
mod inside;
