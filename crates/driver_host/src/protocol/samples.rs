//! Conversion between samples in columns and batches.

use crate::protocol::convert::InvalidData;
use mapper_core::{
    Channel, ChannelColumn, Element, ElementColumn, Event, EventKind, FastSamples, Provenance, Quality,
    SampleBatch, TruthColumn,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Maximum size of a value in JSON, its comma included, bytes.
const BYTES_PER_VALUE: usize = 26;

/// `samples`: samples of one stream, in order and without gap.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Samples {
    /// Name of the stream; `rig` is the one that is recorded, others are ignored.
    pub stream: String,
    /// Number of the first sample since arming.
    pub sequence: u64,
    /// Time at which each sample arrived at the driver, s since arming, from a monotonic clock; strictly increasing.
    pub t_s: Vec<f64>,
    /// Values of each channel, as long as `t_s`.
    pub columns: Vec<Column>,
    /// Each sensor of the channels that have several.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub elements: Vec<ElementSamples>,
    /// Fast samples of P1 and P2, at 100 Hz or more.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fast: Vec<FastColumn>,
    /// True values of a simulator.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub truth: Vec<TruthSamples>,
    /// Events.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub events: Vec<RigEvent>,
}

/// Values of a channel.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Column {
    /// Symbol of the channel.
    pub channel: String,
    /// SI; `null` without a reading.
    pub values: Vec<Option<f64>>,
    /// Time of each reading at its source, s since arming; the time of arrival if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source_t_s: Option<Vec<f64>>,
    /// `good`, `uncertain` or `bad` of each reading; good if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quality: Option<Vec<String>>,
}

/// Values of one of several sensors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ElementSamples {
    /// Channel and number, e.g. `T2/3`.
    pub element: String,
    /// SI; `null` without a reading.
    pub values: Vec<Option<f64>>,
}

/// Fast samples of a channel, evenly spaced.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct FastColumn {
    /// Symbol of the channel: `P1` or `P2`.
    pub channel: String,
    /// Time of the first, s since arming.
    pub first_s: f64,
    /// Interval, s.
    pub interval_s: f64,
    /// SI; `null` without a reading.
    pub values: Vec<Option<f64>>,
}

/// True values of a simulator.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TruthSamples {
    /// Name with its unit suffix.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Values; `null` without a value.
    pub values: Vec<Option<f64>>,
}

/// An event.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RigEvent {
    /// Run time, s.
    pub t_s: f64,
    /// Kind, e.g. `rig_tripped`; an unknown kind is recorded as a note.
    pub kind: String,
    /// One sentence with values and units.
    pub message: String,
}

fn values_or_nan(values: Vec<Option<f64>>) -> Vec<f64> {
    values.into_iter().map(|value| value.unwrap_or(f64::NAN)).collect()
}

fn parse_quality(word: &str) -> Quality {
    match word {
        "good" => Quality::Good,
        "uncertain" => Quality::Uncertain,
        // An unknown word is not a good quality.
        _ => Quality::Bad,
    }
}

fn quality_name(quality: Quality) -> String {
    match quality {
        Quality::Good => "good",
        Quality::Uncertain => "uncertain",
        Quality::Bad => "bad",
    }
    .to_owned()
}

/// Converts samples of a driver to a batch. Channels that are not described are ignored.
pub fn batch(samples: Samples, described: &[Channel]) -> Result<SampleBatch, InvalidData> {
    let count = samples.t_s.len();
    let check_length = |name: &str, length: usize| {
        if length == count {
            Ok(())
        } else {
            Err(InvalidData::ColumnLength { name: name.to_owned(), length, count })
        }
    };
    if let Some(t_s) = samples.t_s.iter().find(|t_s| !t_s.is_finite()) {
        return Err(InvalidData::Time { before_s: *t_s, t_s: *t_s });
    }
    if let Some(pair) = samples.t_s.windows(2).find(|pair| pair[1] <= pair[0]) {
        return Err(InvalidData::Time { before_s: pair[0], t_s: pair[1] });
    }
    let (mut columns, mut provenance) = (Vec::<ChannelColumn>::new(), Vec::new());
    for column in samples.columns {
        check_length(&column.channel, column.values.len())?;
        let Ok(channel) = column.channel.parse::<Channel>() else { continue };
        if !described.contains(&channel) {
            continue;
        }
        if columns.iter().any(|known| known.channel == channel) {
            return Err(InvalidData::Duplicate(column.channel));
        }
        if column.source_t_s.is_some() || column.quality.is_some() {
            let source_t_s = column.source_t_s.unwrap_or_else(|| samples.t_s.clone());
            let good = || vec![Quality::Good; count];
            let of_words = |words: Vec<String>| words.iter().map(|word| parse_quality(word)).collect();
            let quality: Vec<Quality> = column.quality.map_or_else(good, of_words);
            check_length(&column.channel, source_t_s.len())?;
            check_length(&column.channel, quality.len())?;
            provenance.push(Provenance { channel, source_t_s, quality });
        }
        columns.push(ChannelColumn { channel, values: values_or_nan(column.values) });
    }
    let mut elements = Vec::new();
    for column in samples.elements {
        check_length(&column.element, column.values.len())?;
        let Ok(element) = Element::try_from(column.element) else { continue };
        elements.push(ElementColumn { element, values: values_or_nan(column.values) });
    }
    let mut truth = Vec::new();
    for column in samples.truth {
        check_length(&column.name, column.values.len())?;
        truth.push(TruthColumn {
            name: column.name,
            unit: column.unit,
            values: values_or_nan(column.values),
        });
    }
    let mut fast = Vec::new();
    for column in samples.fast {
        let FastColumn { channel, first_s, interval_s, values } = column;
        if !(first_s.is_finite() && interval_s > 0.0 && interval_s.is_finite()) {
            return Err(InvalidData::Time { before_s: first_s, t_s: first_s + interval_s });
        }
        let Ok(channel) = channel.parse::<Channel>() else { continue };
        if channel.variation().is_some() {
            fast.push(FastSamples { channel, first_s, interval_s, values: values_or_nan(values) });
        }
    }
    let kind =
        |word: String| serde_json::from_value(serde_json::Value::String(word)).unwrap_or(EventKind::Note);
    let event = |event: RigEvent| Event { t_s: event.t_s, kind: kind(event.kind), message: event.message };
    Ok(SampleBatch {
        first_sequence: samples.sequence,
        t_s: samples.t_s,
        columns,
        elements,
        provenance,
        truth,
        events: samples.events.into_iter().map(event).collect(),
        fast,
    })
}

/// Splits a batch into messages that fit into frames of this size. An empty batch gives no message.
pub fn split_batch(batch: &SampleBatch, frame_limit_bytes: u32) -> Vec<Samples> {
    // Source time and quality are two additional values.
    let width =
        1 + batch.columns.len() + batch.elements.len() + batch.truth.len() + 2 * batch.provenance.len();
    let max_samples = (frame_limit_bytes as usize / 2 / (width * BYTES_PER_VALUE)).max(1);
    let count = batch.t_s.len();
    let mut starts: Vec<usize> = (0..count).step_by(max_samples).collect();
    if starts.is_empty() && !batch.events.is_empty() {
        starts.push(0);
    }
    let max_values = (frame_limit_bytes as usize / 2 / BYTES_PER_VALUE).max(1);
    let fast = batch.fast.iter().flat_map(|fast| {
        fast.values.chunks(max_values).enumerate().map(move |(index, values)| FastColumn {
            channel: fast.channel.to_string(),
            first_s: fast.first_s + (index * max_values) as f64 * fast.interval_s,
            interval_s: fast.interval_s,
            values: values.iter().map(|value| value.is_finite().then_some(*value)).collect(),
        })
    });
    let alone = |fast| Samples { fast: vec![fast], ..cut_batch(batch, 0, 0) };
    let of_times = starts.into_iter().map(|start| cut_batch(batch, start, count.min(start + max_samples)));
    let mut pieces: Vec<Samples> = fast.map(alone).chain(of_times).collect();
    if let Some(last) = pieces.last_mut() {
        let kind = |kind: EventKind| serde_json::to_value(kind).ok()?.as_str().map(str::to_owned);
        let rig_event = |event: &Event| RigEvent {
            t_s: event.t_s,
            kind: kind(event.kind).unwrap_or_default(),
            message: event.message.clone(),
        };
        last.events = batch.events.iter().map(rig_event).collect();
    }
    pieces
}

fn cut_batch(batch: &SampleBatch, start: usize, end: usize) -> Samples {
    let cut = |values: &[f64]| values.get(start..end).unwrap_or_default().to_vec();
    let numbers = |values: &[f64]| {
        values
            .get(start..end)
            .unwrap_or_default()
            .iter()
            .map(|value| value.is_finite().then_some(*value))
            .collect()
    };
    let column = |column: &ChannelColumn| {
        let from = batch.provenance_of(column.channel);
        Column {
            channel: column.channel.to_string(),
            values: numbers(&column.values),
            source_t_s: from.map(|from| cut(&from.source_t_s)),
            quality: from.map(|from| {
                from.quality
                    .get(start..end)
                    .unwrap_or_default()
                    .iter()
                    .map(|entry| quality_name(*entry))
                    .collect()
            }),
        }
    };
    Samples {
        stream: "rig".to_owned(),
        sequence: batch.first_sequence + start as u64,
        t_s: cut(&batch.t_s),
        columns: batch.columns.iter().map(column).collect(),
        elements: batch
            .elements
            .iter()
            .map(|entry| ElementSamples {
                element: entry.element.to_string(),
                values: numbers(&entry.values),
            })
            .collect(),
        truth: batch
            .truth
            .iter()
            .map(|entry| TruthSamples {
                name: entry.name.clone(),
                unit: entry.unit.clone(),
                values: numbers(&entry.values),
            })
            .collect(),
        events: Vec::new(),
        fast: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// The messages of a split batch together contain the batch, and each fits its frame in both encodings.
        #[test]
        fn split_batches_contain_the_whole_batch(
            values in prop::collection::vec(prop::option::of(-1e6..1e6f64), 0..200), limit in 2_000u32..20_000,
        ) {
            let t_s: Vec<f64> = (0..values.len()).map(|i| i as f64 / 10.0).collect();
            let column = values_or_nan(values);
            let full = SampleBatch {
                first_sequence: 40,
                columns: vec![ChannelColumn { channel: Channel::T2, values: column.clone() }],
                provenance: vec![Provenance {
                    channel: Channel::T2,
                    source_t_s: t_s.clone(),
                    quality: vec![Quality::Uncertain; t_s.len()],
                }],
                events: vec![Event { t_s: 1.0, kind: EventKind::RigTripped, message: "tripped".to_owned() }],
                fast: vec![FastSamples {
                    channel: Channel::P2,
                    first_s: 0.5,
                    interval_s: 1e-3,
                    values: t_s.iter().map(|t_s| 1e5 + t_s).collect(),
                }],
                t_s,
                ..SampleBatch::default()
            };
            let (mut next, mut values, mut sources) = (40, Vec::new(), Vec::new());
            let mut fast = Vec::new();
            let sent = split_batch(&full, limit);
            prop_assert!(!sent.is_empty());
            for piece in sent {
                let note = crate::protocol::Message::note("samples", serde_json::to_value(&piece).unwrap());
                for encoding in [crate::protocol::Encoding::Json, crate::protocol::Encoding::MessagePack] {
                    let body = crate::protocol::encode(&note, encoding).unwrap();
                    prop_assert!(body.len() <= limit as usize);
                    let back = crate::protocol::decode(&body).unwrap();
                    // JSON is read to the last bit but one.
                    prop_assert!(encoding == crate::protocol::Encoding::Json || back == note);
                }
                let part = batch(piece, &[Channel::T2]).unwrap();
                prop_assert_eq!(part.first_sequence, next);
                for piece in part.fast {
                    let after_s = 1e-3 * fast.len() as f64;
                    prop_assert!((piece.first_s - 0.5 - after_s).abs() < 1e-9, "{piece:?}");
                    fast.extend(piece.values);
                }
                if part.t_s.is_empty() {
                    continue;
                }
                next += part.t_s.len() as u64;
                values.extend(part.columns[0].values.iter().map(|value| value.to_bits()));
                sources.extend(part.provenance[0].source_t_s.clone());
                prop_assert!(part.provenance[0].quality.iter().all(|entry| *entry == Quality::Uncertain));
            }
            prop_assert_eq!(values, column.iter().map(|value| value.to_bits()).collect::<Vec<_>>());
            prop_assert_eq!(sources, full.t_s);
            prop_assert_eq!(&fast, &full.fast.first().map(|fast| fast.values.clone()).unwrap_or_default());
        }
    }

    #[test]
    fn inconsistent_samples_are_refused() {
        let good = || Samples {
            t_s: vec![0.0, 0.1],
            columns: vec![Column {
                channel: "T2".to_owned(),
                values: vec![Some(300.0), None],
                source_t_s: None,
                quality: None,
            }],
            ..Samples::default()
        };
        let read = |change: &dyn Fn(&mut Samples)| {
            let mut samples = good();
            change(&mut samples);
            batch(samples, &[Channel::T2])
        };
        assert!(read(&|_| ()).unwrap().columns[0].values[1].is_nan());
        assert!(matches!(read(&|s| s.t_s.reverse()), Err(InvalidData::Time { .. })));
        assert!(matches!(read(&|s| s.t_s[1] = f64::NAN), Err(InvalidData::Time { .. })));
        assert!(matches!(read(&|s| s.columns[0].values.clear()), Err(InvalidData::ColumnLength { .. })));
        assert!(matches!(
            read(&|s| s.columns[0].quality = Some(vec![])),
            Err(InvalidData::ColumnLength { .. })
        ));
        assert!(matches!(read(&|s| s.columns.push(s.columns[0].clone())), Err(InvalidData::Duplicate(_))));
        // Unknown channels are ignored.
        assert!(read(&|s| s.columns[0].channel = "T9".to_owned()).unwrap().columns.is_empty());
    }
}
