//! Which jumps are repeated, and whether that is enough to judge.

use crate::blocks::CampaignStep;
use crate::request::RecordedRun;
use mapper_core::{Channel, Recording};
use std::collections::BTreeMap;

/// Visits of one jump that are needed: two show a difference, only a third shows that it stays or grows.
const VISITS_NEEDED: usize = 3;
/// Silence of a channel within the steps that is taken for a gap, s.
const GAP_S: f64 = 3.0;

/// All visits of each jump that is made more than once, by position among the steps; most visits first.
pub(crate) fn groups(steps: &[CampaignStep]) -> Vec<Vec<usize>> {
    let mut by_jump: BTreeMap<(usize, usize), Vec<usize>> = BTreeMap::new();
    for (position, step) in steps.iter().enumerate() {
        // A change too small to tell from staying is not a jump.
        if let Some(from) = step.from.filter(|from| *from != step.condition) {
            by_jump.entry((from, step.condition)).or_default().push(position);
        }
    }
    let mut groups: Vec<Vec<usize>> = by_jump.into_values().filter(|visits| visits.len() > 1).collect();
    groups.sort_by_key(|visits| (std::cmp::Reverse(visits.len()), visits.first().copied()));
    groups
}

/// Why nothing can be said; `None` where something can.
pub(crate) fn refusal(
    runs: &[RecordedRun<'_>],
    steps: &[CampaignStep],
    groups: &[Vec<usize>],
) -> Option<String> {
    if let Some(first) = runs.first()
        && let Some(other) = runs.iter().position(|run| run.fingerprint != first.fingerprint)
    {
        return Some(format!(
            "No verdict: recording {} was made with another campaign or machine than recording 1 (their fingerprints \
             differ), so differences between them need not be drift. Compare runs of one campaign on one machine.",
            other + 1
        ));
    }
    for (index, run) in runs.iter().enumerate() {
        if let Some((channel, from_s, to_s)) = gap(run.recording) {
            return Some(format!(
                "No verdict: recording {} has a gap, {} is silent from {from_s:.1} s to {to_s:.1} s. What happened to the \
                 machine meanwhile is not known; give the parts before and after it as recordings of their own.",
                index + 1,
                channel.symbol()
            ));
        }
    }
    let most = groups.first().map_or(0, Vec::len);
    if most >= VISITS_NEEDED {
        return None;
    }
    if most == 2 {
        return Some(
            "No verdict: only one repeat. A jump that is made twice shows a difference, but not whether it is chance, a \
             step or a steady change; repeat the reference jump at least twice more."
                .to_owned(),
        );
    }
    let mut visits: BTreeMap<usize, usize> = BTreeMap::new();
    for step in steps {
        *visits.entry(step.condition).or_default() += 1;
    }
    Some(if visits.values().any(|count| *count > 1) {
        "No verdict: points are visited again, but by different jumps. Each transient carries what came before it, so that \
         only visits by the same jump can be compared; repeat the jump, not only the point."
            .to_owned()
    } else {
        "No verdict: no repeats. No jump of this campaign is made twice; plan some (`repeats` in the campaign).".to_owned()
    })
}

/// A channel that falls silent within the steps, with begin and end of the silence.
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
        let mut all = inner.chain([(start_s, *first), (*last, end_s)]);
        // A slow logger is not a gap: silence counts against the channel's own usual distance.
        let usual_s = (last - first) / times.len().max(2) as f64;
        if let Some((from_s, to_s)) = all.find(|(from_s, to_s)| to_s - from_s > GAP_S.max(20.0 * usual_s)) {
            return Some((*channel, from_s, to_s));
        }
    }
    None
}
