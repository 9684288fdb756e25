//! T2 against what any compressor can do.
//!
//! The gas leaves between what isentropic compression makes of it and some three times that: turbocharger compressors have 0.3
//! to 0.85. A housing that is far from the gas moves this apparent efficiency, but at 20 K of rise and more never beyond 0.2
//! to 1.3 (docs/physics.md: the housing exchanges at most half of the capacity flow times its distance). And turbine inlet gas is the
//! hottest of all.

use crate::findings::code;
use crate::objections::ends::Ends;
use crate::objections::objection::Objection;
use mapper_numerics::statistics::median;

/// Isentropic rise from which heat no longer hides the work, K.
const LEAST_RISE_K: f64 = 20.0;
/// Apparent efficiency of the middle point, and of any point.
const MIDDLE: std::ops::RangeInclusive<f64> = 0.35..=1.0;
const ANY: std::ops::RangeInclusive<f64> = 0.2..=1.6;
/// Points of which a share can be told.
const FEWEST: usize = 3;
/// Share of points with P2 below P1 at which it is no longer the point's own affair.
const BELOW_SHARE: f64 = 1.0 / 3.0;

pub(crate) fn objections(ends: &[Option<Ends>]) -> Vec<Objection> {
    let known: Vec<&Ends> = ends.iter().flatten().collect();
    let all = || (0..ends.len()).collect::<Vec<usize>>();
    let mut found = Vec::new();
    let below = known.iter().filter(|end| end.p2_pa < end.p1_pa).count();
    if known.len() >= FEWEST && below as f64 > BELOW_SHARE * known.len() as f64 {
        let middle =
            |read: fn(&Ends) -> f64| median(known.iter().map(|end| read(end))).unwrap_or(f64::NAN) / 1e3;
        let message = format!(
            "P2 lies below P1 at {below} of {} points (medians {:.1} and {:.1} kPa): the channels are exchanged, P2 is a gauge \
             pressure, or one of them is dead; correct the channel map",
            known.len(),
            middle(|end| end.p2_pa),
            middle(|end| end.p1_pa),
        );
        found.push(Objection::new(code::SWAPPED_CHANNELS, message, all()));
        return found;
    }
    let hotter: Vec<usize> = known
        .iter()
        .filter(|end| end.t3_k.is_some_and(|t3_k| end.t2_k > t3_k))
        .map(|end| end.position)
        .collect();
    if 2 * hotter.len() > known.len() {
        let message = "T2 is hotter than T3 at most points: the channels are exchanged, or T3 is dead; correct the channel map";
        found.push(Objection::new(code::SWAPPED_CHANNELS, message.to_owned(), all()));
    }
    let apparent = |end: &Ends| end.isentropic_rise_k() / (end.t2_k - end.t1_k);
    let judged: Vec<&&Ends> = known.iter().filter(|end| end.isentropic_rise_k() > LEAST_RISE_K).collect();
    // T2 that does not rise at all has no efficiency, and more than any.
    let value = |end: &Ends| if end.t2_k > end.t1_k { apparent(end) } else { f64::INFINITY };
    let Some(middle) = median(judged.iter().map(|end| value(end))) else { return found };
    let impossible: Vec<usize> =
        judged.iter().filter(|end| !ANY.contains(&value(end))).map(|end| end.position).collect();
    if !MIDDLE.contains(&middle) || 2 * impossible.len() > judged.len() {
        let of = |read: fn(&Ends) -> f64| median(judged.iter().map(|end| read(end))).unwrap_or(f64::NAN);
        let message = format!(
            "T2 - T1 is {:.1} K where compression from {:.1} K by a pressure ratio of {:.3} takes {:.1} K without losses (medians): an \
             apparent efficiency of {middle:.2}, and compressors have 0.3 to 0.85. T1, T2, P1 or P2 is scaled, exchanged or in \
             another unit",
            of(|end| end.t2_k - end.t1_k),
            of(|end| end.t1_k),
            of(|end| end.p2_pa / end.p1_pa),
            of(Ends::isentropic_rise_k),
        );
        found.push(Objection::new(code::SCALED_CHANNEL, message, all()));
    } else if !impossible.is_empty() {
        let message = "T2 - T1 is not what any compressor makes of the pressure ratio (apparent efficiency outside 0.2 to 1.6): T1, T2, \
                       P1 or P2 failed there";
        found.push(Objection::new(code::SCALED_CHANNEL, message.to_owned(), impossible));
    }
    found
}
