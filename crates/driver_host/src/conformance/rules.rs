//! The rules of the interface `Backend`, one function each.

use crate::conformance::candidate::{Candidate, Checked, bits, fine, out_of_order};
use mapper_core::{BackendError, RigMode, Setpoints};
use std::collections::BTreeSet;

/// A rule: its text and its check.
pub type Rule = (&'static str, fn(&Candidate<'_>) -> Checked);

/// All rules.
#[rustfmt::skip]
pub const RULES: &[Rule] = &[
    ("it describes itself before it is armed, and the same afterwards", describes_itself),
    ("what it must have guarded, it measures; its safe way takes a bounded time", can_be_guarded),
    ("calls before arming and after disarming are refused", keeps_the_life_cycle),
    ("a batch is whole: columns of one length, of described channels alone, each once", batches_are_whole),
    ("time and sequence go on without gap or step back, whatever it is polled for", time_goes_forward),
    ("nothing is delivered from beyond the time asked for, and all that is due", polls_to_the_time_asked_for),
    ("how often it is polled changes nothing but the cut", polling_changes_nothing),
    ("equal seeds, equal calls: equal samples to the bit", repeats_itself),
    ("a setpoint that means nothing is refused by a typed error, and changes nothing", refuses_wild_setpoints),
    ("after a hold command it keeps the setpoints that it received", holds),
    ("it may be made safe at any time after arming, and twice", is_made_safe),
    ("a disarmed rig can be armed again, and starts at time 0", can_be_restarted),
    ("the end of what it has is the loss of the rig, after which it can be made safe", ends_with_its_loss),
];

/// The rig cannot be armed, so that no rule can be judged. Rules without a call to the rig would otherwise seem to be met.
#[derive(Debug, thiserror::Error)]
#[error("`{name}` cannot be armed, so that none of its {} rules was judged: {why}", RULES.len())]
pub struct NotArmed {
    name: String,
    why: String,
}

/// Checks all rules, after one trial of arming and disarming.
///
/// # Errors
/// [`NotArmed`] with the rig's error.
pub fn judge(candidate: &Candidate<'_>) -> Result<Vec<(&'static str, Checked)>, NotArmed> {
    let armed = (candidate.make)().and_then(|mut rig| {
        rig.arm()?;
        // Whether it can be disarmed is checked by the rules.
        let _ = rig.disarm();
        Ok(())
    });
    let failure = armed.err().map(|error| match error {
        // The rig was never armed, so its error is not a loss.
        BackendError::Lost { source, .. } => source.to_string(),
        other => other.to_string(),
    });
    match failure {
        Some(why) => Err(NotArmed { name: candidate.name.to_owned(), why }),
        None => Ok(RULES.iter().map(|(rule, check)| (*rule, settled(candidate, *check))).collect()),
    }
}

/// Number of attempts for a rule that fails on a rig in real time.
const LOOKS: usize = 3;

/// A busy computer may delay a rig in real time by chance; a real violation fails every attempt.
fn settled(candidate: &Candidate<'_>, check: fn(&Candidate<'_>) -> Checked) -> Checked {
    let looks = if in_real_time(candidate).unwrap_or(false) { LOOKS } else { 1 };
    (1..looks).find_map(|_| check(candidate).ok()).map_or_else(|| check(candidate), Ok)
}

macro_rules! ensure {
    ($condition:expr, $($message:tt)+) => {
        match $condition {
            true => {}
            false => return Err(format!($($message)+)),
        }
    };
}

fn describes_itself(candidate: &Candidate<'_>) -> Checked {
    let mut rig = candidate.new_one()?;
    let description = rig.describe();
    ensure!(description.backend == candidate.name, "it calls itself `{}`", description.backend);
    ensure!(!description.version.is_empty(), "it has no version");
    ensure!(!description.channels.is_empty(), "it has no channels");
    let rate_hz = description.sample_rate_hz;
    ensure!(rate_hz > 0.0 && rate_hz.is_finite(), "its sample rate is {rate_hz} Hz");
    let different: BTreeSet<_> = description.channels.iter().collect();
    ensure!(different.len() == description.channels.len(), "a channel is described twice");
    fine("arm", rig.arm())?;
    fine("set", rig.set(&candidate.setpoints))?;
    fine("poll", rig.poll(1.0))?;
    ensure!(rig.describe() == description, "armed, it describes itself otherwise");
    Ok(())
}

fn can_be_guarded(candidate: &Candidate<'_>) -> Checked {
    use mapper_core::{Channel, GuardName};
    let description = candidate.new_one()?.describe();
    for name in &description.needs_guarded {
        let channel = match name {
            GuardName::Overspeed | GuardName::Speed => Channel::ShaftSpeed,
            GuardName::CompressorOutletTemperature => Channel::T2,
            GuardName::TurbineInletTemperature => Channel::T3,
            GuardName::TurbineInletPressure => Channel::P3,
            GuardName::OilTemperature => Channel::TOil,
            GuardName::HousingGradient => Channel::Tc,
            GuardName::Surge => Channel::CompressorFlow,
            GuardName::Signals | GuardName::Rig => continue,
        };
        ensure!(description.channels.contains(&channel), "it needs `{name}`, and does not measure {channel}");
    }
    let within_s = description.safe.within_s;
    ensure!(within_s > 0.0 && within_s <= 120.0, "its way into the safe state takes up to {within_s} s");
    if let Some(accepts) = description.accepts {
        fine("what it accepts", accepts.check(&candidate.setpoints))?;
    }
    Ok(())
}

fn keeps_the_life_cycle(candidate: &Candidate<'_>) -> Checked {
    let mut rig = candidate.new_one()?;
    for disarmed in [false, true] {
        if disarmed {
            fine("arm", rig.arm())?;
            out_of_order("arm", rig.arm())?;
            fine("set", rig.set(&candidate.setpoints))?;
            fine("poll", rig.poll(1.0))?;
            fine("disarm", rig.disarm())?;
        }
        // In particular, no samples after disarming.
        out_of_order("poll", rig.poll(2.0))?;
        out_of_order("set", rig.set(&candidate.setpoints))?;
        out_of_order("hold", rig.hold())?;
        out_of_order("make_safe", rig.make_safe())?;
        out_of_order("disarm", rig.disarm())?;
    }
    Ok(())
}

fn batches_are_whole(candidate: &Candidate<'_>) -> Checked {
    let mut rig = candidate.running()?;
    let described: BTreeSet<_> = rig.describe().channels.into_iter().collect();
    for until_s in [0.0, 0.55, 0.55, 3.0, 3.01] {
        let batch = fine("poll", rig.poll(until_s))?;
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

fn time_goes_forward(candidate: &Candidate<'_>) -> Checked {
    let mut rig = candidate.running()?;
    let (mut last_s, mut next) = (f64::NEG_INFINITY, 0);
    // Also polls times in the past and invalid times.
    for until_s in [-1.0, 0.0, 2.0, 1.0, -1.0, 2.0, f64::NAN, 2.05, 6.0] {
        let batch = fine("poll", rig.poll(until_s))?;
        let first = batch.first_sequence;
        ensure!(first == next, "at {until_s} s the first sample is number {first}, not {next}");
        for t_s in &batch.t_s {
            ensure!(*t_s > last_s && *t_s >= 0.0, "a sample at {t_s} s after one at {last_s} s");
            last_s = *t_s;
        }
        next += batch.t_s.len() as u64;
    }
    ensure!(last_s > 5.5, "asked for 6 s, it has come to {last_s} s");
    Ok(())
}

fn polls_to_the_time_asked_for(candidate: &Candidate<'_>) -> Checked {
    let mut rig = candidate.running()?;
    let sample_s = 1.0 / rig.describe().sample_rate_hz;
    for until_s in [1.0, 1.04, 2.37, 7.0] {
        let batch = fine("poll", rig.poll(until_s))?;
        let Some(last_s) = batch.t_s.last() else { continue };
        ensure!(*last_s <= until_s, "a sample at {last_s} s, asked for {until_s} s");
        // The next sample would lie beyond the requested time.
        ensure!(
            until_s - last_s < 1.001 * sample_s,
            "asked for {until_s} s, the last sample is at {last_s} s"
        );
        let early = batch.events.iter().all(|event| event.t_s <= until_s);
        ensure!(early, "an event from beyond {until_s} s: {:?}", batch.events);
    }
    Ok(())
}

/// Whether the rig runs in real time: its readings do not repeat, and only one instance may exist.
fn in_real_time(candidate: &Candidate<'_>) -> Result<bool, String> {
    Ok(!candidate.new_one()?.describe().simulated_time)
}

fn polling_changes_nothing(candidate: &Candidate<'_>) -> Checked {
    if in_real_time(candidate)? {
        return Ok(());
    }
    let whole = fine("poll", candidate.running()?.poll(6.0))?;
    let mut rig = candidate.running()?;
    let mut pieces = Vec::new();
    for until_s in [0.3, 0.3, 1.0, 5.95, 6.0] {
        pieces.push(fine("poll", rig.poll(until_s))?);
    }
    let times: Vec<f64> = pieces.iter().flat_map(|batch| batch.t_s.clone()).collect();
    ensure!(times == whole.t_s, "other times where it is polled more often");
    for column in &whole.columns {
        let of_piece = |piece: &mapper_core::SampleBatch| piece.column(column.channel).map(<[f64]>::to_vec);
        let cut = pieces.iter().flat_map(|piece| of_piece(piece).unwrap_or_default());
        let scale = column.values.iter().map(|value| value.abs()).fold(0.0, f64::max);
        for ((t_s, cut), whole) in times.iter().zip(cut).zip(&column.values) {
            // A solver step ends at each poll, so pressures and speeds agree only to about its relative tolerance of 1e-6.
            // Near standstill a relative change of pressure changes the flow some hundred times as much.
            let agrees = (cut - whole).abs() <= 3e-4 * scale || (cut.is_nan() && whole.is_nan());
            ensure!(agrees, "{} at {t_s} s: {cut} in pieces, {whole} in one", column.channel);
        }
    }
    Ok(())
}

fn repeats_itself(candidate: &Candidate<'_>) -> Checked {
    if in_real_time(candidate)? {
        return Ok(());
    }
    let (mut first, mut second) = (candidate.running()?, candidate.running()?);
    for until_s in [0.5, 2.0, 2.01, 8.0] {
        let (one, other) = (fine("poll", first.poll(until_s))?, fine("poll", second.poll(until_s))?);
        ensure!(bits(&one) == bits(&other), "two equal ones differ up to {until_s} s");
    }
    Ok(())
}

fn refuses_wild_setpoints(candidate: &Candidate<'_>) -> Checked {
    let good = candidate.setpoints;
    let wild = [
        Setpoints { p3_pa: f64::NAN, ..good },
        Setpoints { p3_pa: 1e9, ..good },
        Setpoints { p3_pa: -1e5, ..good },
        Setpoints { t3_k: f64::INFINITY, ..good },
        Setpoints { valve_opening_ratio: -0.1, ..good },
        Setpoints { valve_opening_ratio: 25.0, ..good },
        Setpoints { oil_temperature_k: 0.0, ..good },
    ];
    let mut rig = candidate.running()?;
    for setpoints in wild {
        match rig.set(&setpoints) {
            Err(BackendError::SetpointOutOfRange { value, low, high, .. }) => {
                let outside = !(low..=high).contains(&value) && low < high;
                ensure!(outside, "{value} was refused as outside {low} to {high}");
            }
            Err(error) => return Err(format!("{setpoints:?} gave another error: {error}")),
            Ok(()) => return Err(format!("{setpoints:?} was accepted")),
        }
    }
    let one = fine("poll", rig.poll(2.0))?;
    let same = in_real_time(candidate)? || bits(&one) == bits(&fine("poll", candidate.running()?.poll(2.0))?);
    ensure!(same, "a refused setpoint has changed what it does");
    Ok(())
}

/// A held rig keeps its setpoints, and a simulation continues as without the call.
fn holds(candidate: &Candidate<'_>) -> Checked {
    use mapper_core::Channel;
    const COMMANDS: [Channel; 4] =
        [Channel::P3Command, Channel::T3Command, Channel::ValveCommand, Channel::TOilCommand];
    let mut rig = candidate.running()?;
    let before = fine("poll", rig.poll(1.0))?;
    fine("hold", rig.hold())?;
    fine("hold", rig.hold())?;
    let after = fine("poll", rig.poll(2.0))?;
    let commands = if rig.describe().controls { &COMMANDS[..] } else { &[] };
    for channel in commands.iter().copied() {
        let Some((before, after)) = before.last(channel).zip(after.last(channel)) else { continue };
        ensure!(before == after, "{channel} was {before} and is {after}");
    }
    if in_real_time(candidate)? {
        return Ok(());
    }
    let mut unheld = candidate.running()?;
    fine("poll", unheld.poll(1.0))?;
    ensure!(
        bits(&fine("poll", unheld.poll(2.0))?) == bits(&after),
        "a hold command has changed what it does"
    );
    Ok(())
}

fn is_made_safe(candidate: &Candidate<'_>) -> Checked {
    // Before the first setpoints, and after.
    for running in [false, true] {
        let mut rig = candidate.new_one()?;
        fine("arm", rig.arm())?;
        if running {
            fine("set", rig.set(&candidate.setpoints))?;
            fine("poll", rig.poll(1.0))?;
        }
        fine("make_safe", rig.make_safe())?;
        fine("make_safe", rig.make_safe())?;
        let batch = fine("poll", rig.poll(2.0))?;
        ensure!(!batch.t_s.is_empty(), "made safe, it no longer measures");
        fine("make_safe", rig.make_safe())?;
        fine("disarm", rig.disarm())?;
    }
    Ok(())
}

fn can_be_restarted(candidate: &Candidate<'_>) -> Checked {
    let mut rig = candidate.running()?;
    let first = fine("poll", rig.poll(2.0))?;
    fine("disarm", rig.disarm())?;
    fine("arm", rig.arm())?;
    fine("set", rig.set(&candidate.setpoints))?;
    let again = fine("poll", rig.poll(2.0))?;
    ensure!(again.t_s.first() == first.t_s.first(), "armed again, its time does not begin at 0");
    let same = !rig.describe().simulated_time || bits(&again) == bits(&first);
    ensure!(same, "armed again, it is another");
    Ok(())
}

fn ends_with_its_loss(candidate: &Candidate<'_>) -> Checked {
    let Some(lasts_s) = candidate.lasts_s else { return Ok(()) };
    let mut rig = candidate.running()?;
    // All remaining samples arrive first; then every poll reports the loss.
    let batch = fine("poll", rig.poll(lasts_s + 1.0))?;
    ensure!(batch.t_s.last() == Some(&lasts_s), "its last sample is at {:?} s", batch.t_s.last());
    for _ in 0..2 {
        match rig.poll(lasts_s + 2.0) {
            Err(BackendError::Lost { t_s, .. }) => ensure!(t_s == lasts_s, "it was lost at {t_s} s"),
            Err(error) => return Err(format!("at its end it gave another error: {error}")),
            Ok(_) => return Err("at its end it goes on".to_owned()),
        }
    }
    fine("set", rig.set(&Setpoints { mode: RigMode::Standstill, ..candidate.setpoints }))?;
    fine("make_safe", rig.make_safe())?;
    fine("disarm", rig.disarm())
}
