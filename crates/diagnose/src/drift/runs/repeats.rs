//! Finds repeated jumps, and checks whether they suffice for a verdict.

use crate::drift::runs::request::RecordedRun;
use crate::drift::runs::time_axis::CampaignStep;
use mapper_core::{Channel, Recording, step_number};
use mapper_identify::LONGEST_BRIDGE_S;
use std::collections::BTreeMap;

/// Minimum number of visits by one jump: two show a difference, a third shows whether it persists or grows.
const VISITS_NEEDED: usize = 3;
/// Longest total time of all steps, s: beyond it a time in the log is wrong.
const LONGEST_S: f64 = 30.0 * 86_400.0;

/// All visits of each repeated jump, by position among the steps; most visits first.
pub(crate) fn groups(steps: &[CampaignStep]) -> Vec<Vec<usize>> {
    let mut by_jump: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (position, step) in steps.iter().enumerate() {
        // A change within one operating point is not a jump.
        if let Some(from) = step.from.filter(|from| *from != step.condition) {
            by_jump.entry((from, step.condition)).or_default().push(position);
        }
    }
    let mut groups: Vec<Vec<usize>> = by_jump.into_values().filter(|visits| visits.len() > 1).collect();
    groups.sort_by_key(|visits| (std::cmp::Reverse(visits.len()), visits.first().copied()));
    groups
}

/// Why no verdict is possible; `None` if one is.
pub(crate) fn refusal(
    runs: &[RecordedRun<'_>],
    steps: &[CampaignStep],
    groups: &[Vec<usize>],
) -> Option<String> {
    if let Some(first) = runs.first()
        && let Some(other) = runs.iter().position(|run| run.fingerprint != first.fingerprint)
    {
        return Some(format!(
            "No verdict: the campaign or machine of recording {} differs from that of recording 1 (other fingerprint), so \
             their differences need not be drift. Compare runs of one campaign on one machine.",
            other + 1
        ));
    }
    if let Some(step) = steps.iter().find(|step| !step.valve_opening_ratio.is_finite()) {
        return Some(format!(
            "No verdict: recording {} has no valve opening, which drives the model. Map the commanded or measured opening as \
             `valve_command`, or give it among `constants`.",
            step.run + 1
        ));
    }
    let length_s = |step: &CampaignStep| step.end_s - step.start_s;
    let whole_s: f64 = steps.iter().map(length_s).sum();
    let longest = steps.iter().max_by(|a, b| length_s(a).total_cmp(&length_s(b)));
    if let Some(step) = longest.filter(|_| whole_s > LONGEST_S) {
        return Some(format!(
            "No verdict: step {} of recording {} lasts {:.1} h of {:.1} h in total; a campaign lasts at most {:.0} h. Look for a \
             wrong time in the log.",
            step_number(step.index),
            step.run + 1,
            length_s(step) / 3600.0,
            whole_s / 3600.0,
            LONGEST_S / 3600.0,
        ));
    }
    for (index, run) in runs.iter().enumerate() {
        if let Some((channel, from_s, to_s)) = gap(run.recording) {
            return Some(format!(
                "No verdict: recording {} has a gap: {} has no samples from {from_s:.1} s to {to_s:.1} s, so the state of the \
                 machine there is unknown. Give the parts before and after the gap as separate recordings.",
                index + 1,
                channel.symbol()
            ));
        }
    }
    let max_visits = groups.first().map_or(0, Vec::len);
    if max_visits >= VISITS_NEEDED {
        return None;
    }
    if max_visits == 2 {
        return Some(
            "No verdict: only one repeat. Two visits show a difference, but not whether it is chance, a step or a steady \
             change; repeat the reference jump at least once more."
                .to_owned(),
        );
    }
    let mut visits: BTreeMap<usize, usize> = BTreeMap::new();
    for step in steps {
        *visits.entry(step.condition).or_default() += 1;
    }
    Some(if visits.values().any(|count| *count > 1) {
        "No verdict: points are repeated, but by different jumps. A transient depends on the point before it, so only visits \
         by the same jump can be compared; repeat the jump, not only the point."
            .to_owned()
    } else {
        "No verdict: no repeats. No jump of this campaign is made twice; plan some (`repeats` in the campaign).".to_owned()
    })
}

/// A channel with a gap within the steps; start and end of the gap, s.
fn gap(recording: &Recording) -> Option<(Channel, f64, f64)> {
    let (start_s, end_s) = (recording.steps.first()?.start_s, recording.steps.last()?.end_s);
    let measured = |channel: &Channel| {
        !matches!(
            channel,
            Channel::P3Command
                | Channel::T3Command
                | Channel::ValveCommand
                | Channel::TOilCommand
                | Channel::TAmb
        )
    };
    for (channel, series) in recording.series.iter().filter(|(channel, _)| measured(channel)) {
        let times = series.slice(start_s, end_s).0;
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            return Some((*channel, start_s, end_s));
        };
        let inner = times.windows(2).map(|pair| (pair[0], pair[1]));
        let mut intervals = inner.chain([(start_s, *first), (*last, end_s)]);
        // A long sample interval is not a gap.
        let interval_s = (last - first) / times.len().max(2) as f64;
        let longest_s = LONGEST_BRIDGE_S.max(20.0 * interval_s);
        if let Some((from_s, to_s)) = intervals.find(|(from_s, to_s)| to_s - from_s > longest_s) {
            return Some((*channel, from_s, to_s));
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step(end_s: f64, valve_opening_ratio: f64) -> CampaignStep {
        CampaignStep {
            run: 0,
            index: 0,
            start_s: 0.0,
            end_s,
            offset_s: 0.0,
            condition: 0,
            from: None,
            valve_opening_ratio,
            p3_pa: 2e5,
        }
    }

    #[test]
    fn a_log_without_a_valve_and_one_with_a_wrong_time_are_refused_by_name() {
        let message = |steps: &[CampaignStep]| refusal(&[], steps, &[]).unwrap();
        assert!(message(&[step(60.0, f64::NAN)]).contains("`valve_command`"));
        // The last step reaches to a time of 1e9 s; or many steps together last for years.
        assert!(message(&[step(60.0, 0.7), step(1e9, 0.7)]).contains("lasts 277777.8 h"));
        assert!(message(&vec![step(8e4, 0.7); 100]).contains("2222.2 h in total"));
        assert!(message(&[step(60.0, 0.7)]).contains("no repeats"));
    }
}
