//! The guard of the back-pressure valve: flow and pressures against its command, seconds after each change.

use mapper_core::{Channel, GuardName, Reaction, SampleBatch, Trip, is_reading};
use mapper_identify::{ValveCheck, ValveState};
use mapper_numerics::statistics::median;
use mapper_runner::{CommandedState, Guard};
use std::collections::VecDeque;

/// Time over which the readings are judged, s. Judgement: twenty samples at 10 Hz, and short enough to name a valve within seconds.
const JUDGED_S: f64 = 2.0;
/// Time for the plenum and the sensors to follow the valve, s. Judgement: ten times the filling time of a usual plenum.
const SENSORS_S: f64 = 1.0;
/// Largest number of samples that are kept. Bound: the memory; a rig at 1 kHz fills it in two seconds.
const MAX_SAMPLES: usize = 2000;

type Row = [f64; ValveCheck::CHANNELS.len()];

/// Judges the valve once after each of its commands, when it has had its declared time.
pub(crate) struct ValveWatch {
    check: ValveCheck,
    reaction: Reaction,
    /// Time after a command until the valve is judged first, s.
    wait_s: f64,
    recent: VecDeque<(f64, Row)>,
    /// Time of the command that was judged last, s.
    judged_s: Option<f64>,
    /// Whether the valve stood still then.
    stands_still: bool,
}

impl ValveWatch {
    /// `follow_s`: declared time in which the valve follows the end of a command.
    pub(crate) fn new(check: ValveCheck, reaction: Reaction, follow_s: f64) -> Self {
        ValveWatch {
            check,
            reaction,
            wait_s: follow_s + SENSORS_S + JUDGED_S,
            recent: VecDeque::new(),
            judged_s: None,
            stands_still: false,
        }
    }

    fn add(&mut self, batch: &SampleBatch) {
        let columns = ValveCheck::CHANNELS.map(|channel| (channel, batch.column(channel)));
        for (index, t_s) in batch.t_s.iter().enumerate() {
            let reading = |(channel, column): (Channel, Option<&[f64]>)| {
                let value = column.and_then(|values| values.get(index)).copied();
                value.filter(|value| is_reading(channel, *value)).unwrap_or(f64::NAN)
            };
            self.recent.push_back((*t_s, columns.map(reading)));
        }
        let Some((last_s, _)) = self.recent.back().copied() else { return };
        while self
            .recent
            .front()
            .is_some_and(|(t_s, _)| *t_s < last_s - JUDGED_S || self.recent.len() > MAX_SAMPLES)
        {
            self.recent.pop_front();
        }
    }

    /// Medians of the earlier or the later half of the readings.
    fn half(&self, is_later: bool) -> Row {
        let (first, last) = (self.recent.front(), self.recent.back());
        let middle_s = first.zip(last).map_or(0.0, |((first_s, _), (last_s, _))| 0.5 * (first_s + last_s));
        std::array::from_fn(|channel| {
            let rows = self.recent.iter().filter(|(t_s, _)| (*t_s > middle_s) == is_later);
            median(rows.map(|(_, row)| row[channel]).filter(|value| value.is_finite())).unwrap_or(f64::NAN)
        })
    }
}

impl Guard for ValveWatch {
    fn check(&mut self, batch: &SampleBatch, now_s: f64, state: &CommandedState) -> Option<Trip> {
        self.add(batch);
        let (command_ratio, since_s) = state.valve.filter(|_| state.running)?;
        if self.judged_s == Some(since_s) || now_s < since_s + self.wait_s {
            return None;
        }
        let size = (self.recent.len() / 2, 0.5 * JUDGED_S);
        let opening_ratio =
            match self.check.judge(command_ratio, [false, true].map(|is_later| self.half(is_later)), size) {
                ValveState::Unknown => return None,
                ValveState::Follows => None,
                ValveState::StandsStill { opening_ratio } => Some(opening_ratio),
            };
        self.judged_s = Some(since_s);
        let stood_still = std::mem::replace(&mut self.stands_still, opening_ratio.is_some());
        opening_ratio.filter(|_| !stood_still).map(|opening_ratio| Trip {
            t_s: now_s,
            guard: GuardName::Valve,
            reaction: self.reaction,
            reason: format!(
                "the back-pressure valve does not follow: {:.0} % of its area commanded {:.0} s ago, flow and pressures are those of {:.0} %; \
                 check its positioner",
                100.0 * command_ratio,
                now_s - since_s,
                100.0 * opening_ratio
            ),
        })
    }
}
