//! The rules of the interface [`Backend`] that every backend must keep ([`RULES`], `mapper backend check NAME`).

use mapper_core::{Backend, BackendError, RigMode, SampleBatch, Setpoints};
use std::collections::BTreeSet;

/// Success, or the finding of a rule.
pub type CheckResult = Result<(), String>;

/// Creates and drives the backend under test.
pub struct Candidate<'a> {
    /// Its name, from its description.
    pub name: &'a str,
    /// Creates a fresh instance, the same each time.
    pub make: &'a dyn Fn() -> Result<Box<dyn Backend>, BackendError>,
    /// Setpoints that the backend can follow.
    pub setpoints: Setpoints,
    /// Run time at which its data end, s; `None` for a rig that runs without limit.
    pub duration_s: Option<f64>,
}

impl Candidate<'_> {
    /// An unarmed backend.
    pub fn create(&self) -> Result<Box<dyn Backend>, String> {
        (self.make)().map_err(|error| error.to_string())
    }

    /// An armed backend with its first setpoints.
    pub fn create_running(&self) -> Result<Box<dyn Backend>, String> {
        let mut rig = self.create()?;
        require_success("arm", rig.arm())?;
        require_success("set", rig.set(&self.setpoints))?;
        Ok(rig)
    }
}

pub(crate) fn require_success<T>(call: &str, answer: Result<T, BackendError>) -> Result<T, String> {
    answer.map_err(|error| format!("`{call}` failed: {error}"))
}

/// Requires a refusal because the call is out of order in the life cycle.
pub(crate) fn require_out_of_order<T>(call: &str, answer: Result<T, BackendError>) -> CheckResult {
    match answer {
        Err(BackendError::OutOfOrder { .. }) => Ok(()),
        Err(error) => Err(format!("`{call}` in the wrong state returned another error: {error}")),
        Ok(_) => Err(format!("`{call}` in the wrong state was not refused")),
    }
}

/// First sequence number, times, and columns of a batch as bits.
type Bits = (u64, Vec<u64>, Vec<(String, Vec<u64>)>);

/// The content of a batch as bits: NaN equals NaN here.
pub(crate) fn bits(batch: &SampleBatch) -> Bits {
    let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    let columns = batch.columns.iter().map(|column| (column.channel.to_string(), bits(&column.values)));
    (batch.first_sequence, bits(&batch.t_s), columns.collect())
}

/// A rule: its text and its check.
pub type Rule = (&'static str, fn(&Candidate<'_>) -> CheckResult);

/// All rules.
#[rustfmt::skip]
pub const RULES: &[Rule] = &[
    ("it describes itself before it is armed, and the same afterwards", describes_itself),
    ("it measures what its required guards need; its safe shutdown takes a bounded time", can_be_guarded),
    ("calls before arming and after disarming are refused", keeps_the_life_cycle),
    ("a batch has one column of equal length for each described channel, and no other", batches_are_complete),
        ("times and sequence numbers increase without a gap, whatever times are polled", time_increases),
        ("a poll returns all samples up to the requested time, and none beyond it", polls_to_the_requested_time),
        ("the number of polls does not change the samples", polling_does_not_change_samples),
        ("equal seeds and equal calls give identical samples", repeats_itself),
        ("an impossible setpoint is refused with a typed error, and changes nothing", refuses_impossible_setpoints),
    ("after a hold command it keeps its setpoints", keeps_setpoints_on_hold),
        ("it can be made safe at any time after arming, and twice", can_be_made_safe),
    ("a disarmed rig can be armed again, and starts at time 0", can_be_restarted),
    ("at the end of its data it reports the loss of the rig, and can still be made safe", ends_with_its_loss),
];

/// The rig cannot be armed, so no rule can be checked. Without this error, rules that never call the rig would pass.
#[derive(Debug, thiserror::Error)]
#[error("`{name}` cannot be armed, so none of the {} rules was checked: {reason}", RULES.len())]
pub struct NotArmed {
    name: String,
    reason: String,
}

/// Checks all rules, after one trial of arming and disarming.
pub fn check_rules(candidate: &Candidate<'_>) -> Result<Vec<(&'static str, CheckResult)>, NotArmed> {
    let armed = (candidate.make)().and_then(|mut rig| {
        rig.arm()?;
        // The rules check whether it can be disarmed.
        let _ = rig.disarm();
        Ok(())
    });
    let failure = armed.err().map(|error| match error {
        // The rig was never armed, so its error is not a loss.
        BackendError::Lost { source, .. } => source.to_string(),
        other => other.to_string(),
    });
    match failure {
        Some(reason) => Err(NotArmed { name: candidate.name.to_owned(), reason }),
        None => {
            Ok(RULES.iter().map(|(rule, check)| (*rule, check_with_retries(candidate, *check))).collect())
        }
    }
}

/// Number of attempts for a rule that fails on a rig in real time.
const ATTEMPTS: usize = 3;

/// Checks a rule, on a rig in real time with retries: a busy computer may delay it by chance, but a real violation fails every time.
fn check_with_retries(candidate: &Candidate<'_>, check: fn(&Candidate<'_>) -> CheckResult) -> CheckResult {
    let attempts = if is_real_time(candidate).unwrap_or(false) { ATTEMPTS } else { 1 };
    (1..attempts).find_map(|_| check(candidate).ok()).map_or_else(|| check(candidate), Ok)
}

macro_rules! ensure {
    ($condition:expr, $($message:tt)+) => {
        if $condition {} else { return Err(format!($($message)+)) }
    };
}

fn describes_itself(candidate: &Candidate<'_>) -> CheckResult {
    let mut rig = candidate.create()?;
    let description = rig.describe();
    ensure!(description.backend == candidate.name, "it calls itself `{}`", description.backend);
    ensure!(!description.version.is_empty(), "it has no version");
    ensure!(!description.channels.is_empty(), "it has no channels");
    let rate_hz = description.sample_rate_hz;
    ensure!(rate_hz > 0.0 && rate_hz.is_finite(), "its sample rate is {rate_hz} Hz");
    let different: BTreeSet<_> = description.channels.iter().collect();
    ensure!(different.len() == description.channels.len(), "a channel is described twice");
    require_success("arm", rig.arm())?;
    require_success("set", rig.set(&candidate.setpoints))?;
    require_success("poll", rig.poll(1.0))?;
    ensure!(rig.describe() == description, "its description changes after arming");
    Ok(())
}

fn can_be_guarded(candidate: &Candidate<'_>) -> CheckResult {
    use mapper_core::{Channel, GuardName};
    let description = candidate.create()?.describe();
    for name in &description.needs_guarded {
        let channel = match name {
            GuardName::Overspeed | GuardName::Speed | GuardName::AvoidedSpeed => Channel::ShaftSpeed,
            GuardName::CompressorOutletTemperature => Channel::T2,
            GuardName::TurbineInletTemperature => Channel::T3,
            GuardName::TurbineInletPressure => Channel::P3,
            GuardName::OilTemperature => Channel::TOil,
            GuardName::HousingGradient => Channel::Tc,
            GuardName::Surge | GuardName::Valve => Channel::CompressorFlow,
            GuardName::Signals | GuardName::Rig => continue,
        };
        ensure!(
            description.channels.contains(&channel),
            "it requires the guard `{name}`, but does not measure {channel}"
        );
    }
    let within_s = description.safe.within_s;
    ensure!(
        within_s > 0.0 && within_s <= 120.0,
        "its safe shutdown takes up to {within_s} s; 120 s are allowed"
    );
    if let Some(accepts) = description.accepts {
        require_success("check of the accepted setpoints", accepts.check(&candidate.setpoints))?;
    }
    Ok(())
}

fn keeps_the_life_cycle(candidate: &Candidate<'_>) -> CheckResult {
    let mut rig = candidate.create()?;
    for disarmed in [false, true] {
        if disarmed {
            require_success("arm", rig.arm())?;
            require_out_of_order("arm", rig.arm())?;
            require_success("set", rig.set(&candidate.setpoints))?;
            require_success("poll", rig.poll(1.0))?;
            require_success("disarm", rig.disarm())?;
        }
        // In particular, no samples after disarming.
        require_out_of_order("poll", rig.poll(2.0))?;
        require_out_of_order("set", rig.set(&candidate.setpoints))?;
        require_out_of_order("hold", rig.hold())?;
        require_out_of_order("make_safe", rig.make_safe())?;
        require_out_of_order("disarm", rig.disarm())?;
    }
    Ok(())
}

fn batches_are_complete(candidate: &Candidate<'_>) -> CheckResult {
    let mut rig = candidate.create_running()?;
    let described: BTreeSet<_> = rig.describe().channels.into_iter().collect();
    for until_s in [0.0, 0.55, 0.55, 3.0, 3.01] {
        let batch = require_success("poll", rig.poll(until_s))?;
        let delivered: BTreeSet<_> = batch.columns.iter().map(|column| column.channel).collect();
        ensure!(delivered == described, "other channels than described at {until_s} s: {delivered:?}");
        ensure!(batch.columns.len() == described.len(), "a channel has two columns");
        let samples = batch.t_s.len();
        let columns = batch.columns.iter().map(|column| (column.channel.to_string(), column.values.len()));
        let truth = batch.truth.iter().map(|column| (column.name.clone(), column.values.len()));
        let provenance = batch.provenance.iter().flat_map(|from| {
            [from.source_t_s.len(), from.quality.len()].map(|length| (from.channel.to_string(), length))
        });
        for (name, length) in columns.chain(truth).chain(provenance) {
            ensure!(length == samples, "{name} has {length} values for {samples} times");
        }
    }
    Ok(())
}

fn time_increases(candidate: &Candidate<'_>) -> CheckResult {
    let mut rig = candidate.create_running()?;
    let (mut last_s, mut next) = (f64::NEG_INFINITY, 0);
    // Also polls times in the past and invalid times.
    for until_s in [-1.0, 0.0, 2.0, 1.0, -1.0, 2.0, f64::NAN, 2.05, 6.0] {
        let batch = require_success("poll", rig.poll(until_s))?;
        let first = batch.first_sequence;
        ensure!(first == next, "at {until_s} s the first sample is number {first}, not {next}");
        for t_s in &batch.t_s {
            ensure!(*t_s > last_s && *t_s >= 0.0, "a sample at {t_s} s after one at {last_s} s");
            last_s = *t_s;
        }
        next += batch.t_s.len() as u64;
    }
    ensure!(last_s > 5.5, "polled to 6 s, its last sample is at {last_s} s");
    Ok(())
}

fn polls_to_the_requested_time(candidate: &Candidate<'_>) -> CheckResult {
    let mut rig = candidate.create_running()?;
    let sample_s = 1.0 / rig.describe().sample_rate_hz;
    for until_s in [1.0, 1.04, 2.37, 7.0] {
        let batch = require_success("poll", rig.poll(until_s))?;
        let Some(last_s) = batch.t_s.last() else { continue };
        ensure!(*last_s <= until_s, "a sample at {last_s} s, polled to {until_s} s");
        // The next sample would lie beyond the requested time.
        ensure!(
            until_s - last_s < 1.001 * sample_s,
            "polled to {until_s} s, the last sample is at {last_s} s"
        );
        let in_time = batch.events.iter().all(|event| event.t_s <= until_s);
        ensure!(in_time, "an event later than {until_s} s: {:?}", batch.events);
    }
    Ok(())
}

/// Whether the rig runs in real time: its readings do not repeat, and only one instance may exist.
fn is_real_time(candidate: &Candidate<'_>) -> Result<bool, String> {
    Ok(!candidate.create()?.describe().simulated_time)
}

fn polling_does_not_change_samples(candidate: &Candidate<'_>) -> CheckResult {
    if is_real_time(candidate)? {
        return Ok(());
    }
    let full_batch = require_success("poll", candidate.create_running()?.poll(6.0))?;
    let mut rig = candidate.create_running()?;
    let mut pieces = Vec::new();
    for until_s in [0.3, 0.3, 1.0, 5.95, 6.0] {
        pieces.push(require_success("poll", rig.poll(until_s))?);
    }
    let times: Vec<f64> = pieces.iter().flat_map(|batch| batch.t_s.clone()).collect();
    ensure!(times == full_batch.t_s, "more frequent polls give other sample times");
    for column in &full_batch.columns {
        let of_piece = |piece: &mapper_core::SampleBatch| piece.column(column.channel).map(<[f64]>::to_vec);
        let cut = pieces.iter().flat_map(|piece| of_piece(piece).unwrap_or_default());
        let scale = column.values.iter().map(|value| value.abs()).fold(0.0, f64::max);
        for ((t_s, cut), value) in times.iter().zip(cut).zip(&column.values) {
            // A solver step ends at each poll: agreement to about 1e-6; near standstill flows differ some hundred times as much.
            let agrees = (cut - value).abs() <= 3e-4 * scale || (cut.is_nan() && value.is_nan());
            ensure!(agrees, "{} at {t_s} s: {cut} in pieces, {value} in one", column.channel);
        }
    }
    Ok(())
}

fn repeats_itself(candidate: &Candidate<'_>) -> CheckResult {
    if is_real_time(candidate)? {
        return Ok(());
    }
    let (mut first, mut second) = (candidate.create_running()?, candidate.create_running()?);
    for until_s in [0.5, 2.0, 2.01, 8.0] {
        let batches =
            [require_success("poll", first.poll(until_s))?, require_success("poll", second.poll(until_s))?];
        ensure!(bits(&batches[0]) == bits(&batches[1]), "two equal instances differ before {until_s} s");
    }
    Ok(())
}

fn refuses_impossible_setpoints(candidate: &Candidate<'_>) -> CheckResult {
    let good = candidate.setpoints;
    let impossible = [
        Setpoints { p3_pa: f64::NAN, ..good },
        Setpoints { p3_pa: 1e9, ..good },
        Setpoints { p3_pa: -1e5, ..good },
        Setpoints { t3_k: f64::INFINITY, ..good },
        Setpoints { valve_opening_ratio: -0.1, ..good },
        Setpoints { valve_opening_ratio: 25.0, ..good },
        Setpoints { oil_temperature_k: 0.0, ..good },
    ];
    let mut rig = candidate.create_running()?;
    for setpoints in impossible {
        match rig.set(&setpoints) {
            Err(BackendError::SetpointOutOfRange { value, low, high, .. }) => {
                let outside = !(low..=high).contains(&value) && low < high;
                ensure!(outside, "{value} was refused as outside {low} to {high}");
            }
            Err(error) => return Err(format!("{setpoints:?} gave another error: {error}")),
            Ok(()) => return Err(format!("{setpoints:?} was accepted")),
        }
    }
    let batch = require_success("poll", rig.poll(2.0))?;
    let same = is_real_time(candidate)?
        || bits(&batch) == bits(&require_success("poll", candidate.create_running()?.poll(2.0))?);
    ensure!(same, "a refused setpoint changed the samples");
    Ok(())
}

/// A held rig keeps its setpoints, and a simulation continues as without the call.
fn keeps_setpoints_on_hold(candidate: &Candidate<'_>) -> CheckResult {
    use mapper_core::Channel;
    const COMMANDS: [Channel; 4] =
        [Channel::P3Command, Channel::T3Command, Channel::ValveCommand, Channel::TOilCommand];
    let mut rig = candidate.create_running()?;
    let before = require_success("poll", rig.poll(1.0))?;
    require_success("hold", rig.hold())?;
    require_success("hold", rig.hold())?;
    let after = require_success("poll", rig.poll(2.0))?;
    let commands = if rig.describe().controls { &COMMANDS[..] } else { &[] };
    for channel in commands.iter().copied() {
        let Some((before, after)) = before.last(channel).zip(after.last(channel)) else { continue };
        ensure!(before == after, "{channel} was {before} and is {after}");
    }
    if is_real_time(candidate)? {
        return Ok(());
    }
    let mut unheld = candidate.create_running()?;
    require_success("poll", unheld.poll(1.0))?;
    ensure!(
        bits(&require_success("poll", unheld.poll(2.0))?) == bits(&after),
        "a hold command changed the samples"
    );
    Ok(())
}

fn can_be_made_safe(candidate: &Candidate<'_>) -> CheckResult {
    // Before the first setpoints, and after.
    for running in [false, true] {
        let mut rig = candidate.create()?;
        require_success("arm", rig.arm())?;
        if running {
            require_success("set", rig.set(&candidate.setpoints))?;
            require_success("poll", rig.poll(1.0))?;
        }
        require_success("make_safe", rig.make_safe())?;
        require_success("make_safe", rig.make_safe())?;
        let batch = require_success("poll", rig.poll(2.0))?;
        ensure!(!batch.t_s.is_empty(), "it no longer measures in its safe state");
        require_success("make_safe", rig.make_safe())?;
        require_success("disarm", rig.disarm())?;
    }
    Ok(())
}

fn can_be_restarted(candidate: &Candidate<'_>) -> CheckResult {
    let mut rig = candidate.create_running()?;
    let first = require_success("poll", rig.poll(2.0))?;
    require_success("disarm", rig.disarm())?;
    require_success("arm", rig.arm())?;
    require_success("set", rig.set(&candidate.setpoints))?;
    let restarted = require_success("poll", rig.poll(2.0))?;
    ensure!(restarted.t_s.first() == first.t_s.first(), "after rearming, its time does not start at 0");
    let same = !rig.describe().simulated_time || bits(&restarted) == bits(&first);
    ensure!(same, "after rearming, its samples differ");
    Ok(())
}

fn ends_with_its_loss(candidate: &Candidate<'_>) -> CheckResult {
    let Some(duration_s) = candidate.duration_s else { return Ok(()) };
    let mut rig = candidate.create_running()?;
    // All remaining samples arrive first; then every poll reports the loss.
    let batch = require_success("poll", rig.poll(duration_s + 1.0))?;
    ensure!(batch.t_s.last() == Some(&duration_s), "its last sample is at {:?} s", batch.t_s.last());
    for _ in 0..2 {
        match rig.poll(duration_s + 2.0) {
            Err(BackendError::Lost { t_s, .. }) => ensure!(t_s == duration_s, "it was lost at {t_s} s"),
            Err(error) => return Err(format!("at the end of its data it returned another error: {error}")),
            Ok(_) => return Err("it continues beyond the end of its data".to_owned()),
        }
    }
    require_success("set", rig.set(&Setpoints { mode: RigMode::Standstill, ..candidate.setpoints }))?;
    require_success("make_safe", rig.make_safe())?;
    require_success("disarm", rig.disarm())
}
