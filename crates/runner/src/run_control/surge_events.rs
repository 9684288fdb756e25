//! Surge events with hysteresis: a compressor in surge crosses the surge line many times a second, and each surge is one event.

use mapper_core::{Channel, Event, EventKind, SampleBatch};

/// Time without surge after which it has ended, s. Judgement: longer than the cycle of the slowest surge, 1 s.
const QUIET_S: f64 = 2.0;

/// Joins the crossings that a rig reports to one event at the start of each surge and one at its end.
#[derive(Debug, Clone, Default)]
pub(crate) struct SurgeEvents {
    surge: Option<Surge>,
}

/// A surge under way.
#[derive(Debug, Clone, Copy)]
struct Surge {
    since_s: f64,
    /// Time of the last crossing back; `None` while the compressor surges.
    left_s: Option<f64>,
    lowest_flow_kg_s: f64,
}

impl SurgeEvents {
    /// Replaces the crossings in the events of a batch, whose samples end at `now_s`.
    pub(crate) fn join(&mut self, batch: &mut SampleBatch, now_s: f64) {
        let events = std::mem::take(&mut batch.events);
        for event in events {
            match event.kind {
                EventKind::SurgeEntered => {
                    batch.events.extend(self.end_before(event.t_s));
                    match &mut self.surge {
                        Some(surge) => surge.left_s = None,
                        None => {
                            self.surge = Some(Surge {
                                since_s: event.t_s,
                                left_s: None,
                                lowest_flow_kg_s: f64::INFINITY,
                            });
                            batch.events.push(event);
                        }
                    }
                }
                EventKind::SurgeLeft => match &mut self.surge {
                    Some(surge) => surge.left_s = Some(event.t_s),
                    None => batch.events.push(event),
                },
                _ => batch.events.push(event),
            }
        }
        if let Some(surge) = &mut self.surge {
            let flows = batch.column(Channel::CompressorFlow).unwrap_or_default();
            let rows = batch.t_s.iter().zip(flows);
            let during = rows.filter(|(t_s, flow)| **t_s >= surge.since_s && flow.is_finite());
            surge.lowest_flow_kg_s = during.map(|(_, flow)| *flow).fold(surge.lowest_flow_kg_s, f64::min);
        }
        batch.events.extend(self.end_before(now_s));
    }

    /// The event of a surge that has ended by `now_s`.
    fn end_before(&mut self, now_s: f64) -> Option<Event> {
        let Surge { since_s, left_s, lowest_flow_kg_s } = self.surge?;
        let left_s = left_s.filter(|left_s| now_s - left_s >= QUIET_S)?;
        self.surge = None;
        let flow = match lowest_flow_kg_s.is_finite() {
            true => format!(", lowest flow {:.2} g/s", 1e3 * lowest_flow_kg_s),
            false => String::new(),
        };
        let message = format!(
            "surge ended: it lasted {:.2} s from {since_s:.2} s to {left_s:.2} s{flow}",
            left_s - since_s
        );
        Some(Event { t_s: now_s, kind: EventKind::SurgeLeft, message })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::ChannelColumn;

    /// Seven crossings a second for three seconds, and another surge later.
    #[test]
    fn each_surge_is_one_event_with_its_duration_and_lowest_flow() {
        let mut events = SurgeEvents::default();
        let mut found: Vec<Event> = Vec::new();
        let is_surge = |t_s: f64| (3.0..6.0).contains(&t_s) || (12.0..12.55).contains(&t_s);
        for second in 0..20 {
            let from_s = f64::from(second);
            let t_s: Vec<f64> = (0..10).map(|i| from_s + 0.1 * f64::from(i)).collect();
            let values = t_s.iter().map(|t_s| if is_surge(*t_s) { 0.03 } else { 0.05 }).collect();
            let columns = vec![ChannelColumn { channel: Channel::CompressorFlow, values }];
            let crossing = |i: u32| {
                let kind = if i.is_multiple_of(2) { EventKind::SurgeEntered } else { EventKind::SurgeLeft };
                Event { t_s: from_s + f64::from(i) / 14.0, kind, message: String::new() }
            };
            let crossings = (0..14).map(crossing).filter(|event| is_surge(event.t_s)).collect();
            let mut batch = SampleBatch { t_s, columns, events: crossings, ..SampleBatch::default() };
            events.join(&mut batch, from_s + 1.0);
            found.extend(batch.events);
        }
        let kinds: Vec<EventKind> = found.iter().map(|event| event.kind).collect();
        use EventKind::{SurgeEntered, SurgeLeft};
        assert_eq!(kinds, [SurgeEntered, SurgeLeft, SurgeEntered, SurgeLeft]);
        assert!(found[1].message.contains("30.00 g/s") && found[1].message.contains("2.93 s"), "{found:?}");
        assert!(found.windows(2).all(|pair| pair[0].t_s <= pair[1].t_s));
    }
}
