//! Joins and splits batches of samples.

use crate::{ChannelColumn, ElementColumn, Provenance, Quality, SampleBatch, TruthColumn};

impl SampleBatch {
    /// Appends the samples and events of `more`. A column that only one of them has is NaN in the other.
    pub fn append(&mut self, more: SampleBatch) {
        let before = self.t_s.len();
        let after = before + more.t_s.len();
        if before == 0 && after > 0 {
            self.first_sequence = more.first_sequence;
        }
        let missing = |values: Vec<f64>| -> Vec<f64> {
            let mut all = vec![f64::NAN; before];
            all.extend(values);
            all
        };
        for column in more.columns {
            match self.columns.iter_mut().find(|known| known.channel == column.channel) {
                Some(known) => known.values.extend(column.values),
                None => self.columns.push(ChannelColumn { values: missing(column.values), ..column }),
            }
        }
        for column in more.elements {
            match self.elements.iter_mut().find(|known| known.element == column.element) {
                Some(known) => known.values.extend(column.values),
                None => self.elements.push(ElementColumn { values: missing(column.values), ..column }),
            }
        }
        for column in more.truth {
            match self.truth.iter_mut().find(|known| known.name == column.name) {
                Some(known) => known.values.extend(column.values),
                None => self.truth.push(TruthColumn { values: missing(column.values), ..column }),
            }
        }
        for from in more.provenance {
            let known = match self.provenance.iter_mut().position(|known| known.channel == from.channel) {
                Some(known) => known,
                None => {
                    let (source_t_s, quality) = (self.t_s.clone(), vec![Quality::Good; before]);
                    self.provenance.push(Provenance { channel: from.channel, source_t_s, quality });
                    self.provenance.len() - 1
                }
            };
            if let Some(known) = self.provenance.get_mut(known) {
                known.source_t_s.extend(from.source_t_s);
                known.quality.extend(from.quality);
            }
        }
        self.t_s.extend(more.t_s);
        self.events.extend(more.events);
        for from in &mut self.provenance {
            // A sample without source time was taken when it arrived.
            let known = from.source_t_s.len().min(after);
            from.source_t_s.extend(self.t_s.get(known..).unwrap_or_default());
            from.quality.resize(after, Quality::Good);
        }
        let columns = self.columns.iter_mut().map(|column| &mut column.values);
        let elements = self.elements.iter_mut().map(|column| &mut column.values);
        let truth = self.truth.iter_mut().map(|column| &mut column.values);
        columns.chain(elements).chain(truth).for_each(|values| values.resize(after, f64::NAN));
    }

    /// Splits off and returns the samples after the first `at`. The events stay.
    pub fn split_off(&mut self, at: usize) -> SampleBatch {
        fn cut<T>(values: &mut Vec<T>, at: usize) -> Vec<T> {
            values.split_off(at.min(values.len()))
        }
        SampleBatch {
            first_sequence: self.first_sequence + at as u64,
            t_s: cut(&mut self.t_s, at),
            columns: self
                .columns
                .iter_mut()
                .map(|column| ChannelColumn { channel: column.channel, values: cut(&mut column.values, at) })
                .collect(),
            elements: self
                .elements
                .iter_mut()
                .map(|column| ElementColumn { element: column.element, values: cut(&mut column.values, at) })
                .collect(),
            provenance: self
                .provenance
                .iter_mut()
                .map(|column| Provenance {
                    channel: column.channel,
                    source_t_s: cut(&mut column.source_t_s, at),
                    quality: cut(&mut column.quality, at),
                })
                .collect(),
            truth: self
                .truth
                .iter_mut()
                .map(|column| TruthColumn {
                    name: column.name.clone(),
                    unit: column.unit.clone(),
                    values: cut(&mut column.values, at),
                })
                .collect(),
            events: Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Channel;

    #[test]
    fn pieces_become_the_whole_and_what_is_missing_is_nan() {
        let piece = |first: u64, t_s: &[f64], columns: &[(Channel, &[f64])]| SampleBatch {
            first_sequence: first,
            t_s: t_s.to_vec(),
            columns: columns
                .iter()
                .map(|(channel, values)| ChannelColumn { channel: *channel, values: values.to_vec() })
                .collect(),
            ..SampleBatch::default()
        };
        let mut whole = piece(0, &[], &[]);
        whole.append(piece(0, &[0.0, 0.1], &[(Channel::T2, &[1.0, 2.0]), (Channel::P2, &[5.0, 6.0])]));
        whole.append(piece(2, &[0.2], &[(Channel::P2, &[7.0]), (Channel::T1, &[9.0])]));
        assert_eq!(whole.t_s, [0.0, 0.1, 0.2]);
        assert_eq!(whole.column(Channel::P2).unwrap(), [5.0, 6.0, 7.0]);
        assert_eq!(whole.column(Channel::T2).unwrap()[..2], [1.0, 2.0]);
        assert!(whole.column(Channel::T2).unwrap()[2].is_nan());
        let t1 = whole.column(Channel::T1).unwrap();
        assert!(t1[0].is_nan() && t1[1].is_nan() && t1[2] == 9.0);
    }

    #[test]
    fn what_is_cut_and_appended_again_is_the_same() {
        let whole = SampleBatch {
            first_sequence: 7,
            t_s: vec![0.0, 0.1, 0.2],
            columns: vec![ChannelColumn { channel: Channel::T2, values: vec![1.0, 2.0, 3.0] }],
            provenance: vec![Provenance {
                channel: Channel::T2,
                source_t_s: vec![0.0, 0.0, 0.1],
                quality: vec![Quality::Good, Quality::Bad, Quality::Good],
            }],
            ..SampleBatch::default()
        };
        for at in 0..=3 {
            let mut first = whole.clone();
            let rest = first.split_off(at);
            assert_eq!((first.t_s.len(), rest.first_sequence), (at, 7 + at as u64));
            first.append(rest);
            assert_eq!(first, whole, "cut after {at}");
        }
    }
}
