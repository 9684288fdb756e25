//! Merges the batches of one second.

use mapper_core::{Provenance, Quality, SampleBatch};

/// Appends the samples of `more`. A channel that is missing in one of them is NaN there.
pub(crate) fn append(whole: &mut SampleBatch, more: SampleBatch) {
    if whole.t_s.is_empty() {
        let events = std::mem::take(&mut whole.events);
        *whole = more;
        whole.events.splice(0..0, events);
        return;
    }
    let before = whole.t_s.len();
    let after = before + more.t_s.len();
    for column in more.columns {
        match whole.columns.iter_mut().find(|known| known.channel == column.channel) {
            Some(known) => known.values.extend(column.values),
            None => {
                let mut values = vec![f64::NAN; before];
                values.extend(&column.values);
                whole.columns.push(mapper_core::ChannelColumn { values, ..column });
            }
        }
    }
    for column in more.elements {
        match whole.elements.iter_mut().find(|known| known.element == column.element) {
            Some(known) => known.values.extend(column.values),
            None => {
                let mut values = vec![f64::NAN; before];
                values.extend(&column.values);
                whole.elements.push(mapper_core::ElementColumn { values, ..column });
            }
        }
    }
    for column in more.truth {
        if let Some(known) = whole.truth.iter_mut().find(|known| known.name == column.name) {
            known.values.extend(column.values);
        }
    }
    for from in more.provenance {
        match whole.provenance.iter_mut().find(|known| known.channel == from.channel) {
            Some(known) => {
                known.source_t_s.extend(from.source_t_s);
                known.quality.extend(from.quality);
            }
            None => {
                let mut source_t_s = whole.t_s.clone();
                let mut quality = vec![Quality::Good; before];
                source_t_s.extend(from.source_t_s);
                quality.extend(from.quality);
                whole.provenance.push(Provenance { channel: from.channel, source_t_s, quality });
            }
        }
    }
    whole.t_s.extend(more.t_s);
    whole.events.extend(more.events);
    for from in &mut whole.provenance {
        // A sample without source time was taken when it arrived.
        let known = from.source_t_s.len().min(after);
        from.source_t_s.extend(whole.t_s.get(known..).unwrap_or_default());
        from.quality.resize(after, Quality::Good);
    }
    let columns = whole.columns.iter_mut().map(|column| &mut column.values);
    let elements = whole.elements.iter_mut().map(|column| &mut column.values);
    let truth = whole.truth.iter_mut().map(|column| &mut column.values);
    columns.chain(elements).chain(truth).for_each(|values| values.resize(after, f64::NAN));
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::{Channel, ChannelColumn};

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
        append(&mut whole, piece(0, &[0.0, 0.1], &[(Channel::T2, &[1.0, 2.0]), (Channel::P2, &[5.0, 6.0])]));
        append(&mut whole, piece(2, &[0.2], &[(Channel::P2, &[7.0]), (Channel::T1, &[9.0])]));
        assert_eq!(whole.t_s, [0.0, 0.1, 0.2]);
        assert_eq!(whole.column(Channel::P2).unwrap(), [5.0, 6.0, 7.0]);
        assert_eq!(whole.column(Channel::T2).unwrap()[..2], [1.0, 2.0]);
        assert!(whole.column(Channel::T2).unwrap()[2].is_nan());
        let t1 = whole.column(Channel::T1).unwrap();
        assert!(t1[0].is_nan() && t1[1].is_nan() && t1[2] == 9.0);
    }
}
