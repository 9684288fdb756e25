//! Visits of a repeated jump: readings, identified values, and their differences from the first visit.

use crate::drift::correction::corrected::{end_speed_rpm, point_of};
use crate::drift::report::{RepeatGroup, Visit, VisitChannel};
use crate::drift::runs::request::DriftRequest;
use crate::drift::runs::time_axis::{CampaignStep, mean_variance_ratio};
use crate::drift::sensitivity::readings::Readings;
use mapper_core::{Channel, IdentifiedPoint, Recording};
use mapper_observe::channels::OUTPUTS;
use std::collections::BTreeMap;

pub(crate) fn group(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    readings: &Readings,
    points: &[Vec<IdentifiedPoint>],
    visits: &[usize],
) -> RepeatGroup {
    let describe = |step: Option<&CampaignStep>| {
        let speed = |step: &CampaignStep| end_speed_rpm(request, recordings[step.run], step);
        step.map_or_else(String::new, |step| {
            let speed =
                speed(step).map_or_else(|| "-".to_owned(), |speed_rpm| format!("{:.1}", speed_rpm / 1e3));
            format!("{speed} krpm at opening {} (P3 {:.1} kPa)", step.valve_opening_ratio, step.p3_pa / 1e3)
        })
    };
    let first = visits.first().copied();
    let before =
        first.and_then(|position| position.checked_sub(1)).and_then(|position| readings.steps.get(position));
    let mut group = RepeatGroup {
        from: describe(before),
        to: describe(first.and_then(|position| readings.steps.get(position))),
        visits: Vec::new(),
    };
    for position in visits {
        let Some(step) = readings.steps.get(*position) else { continue };
        let point = point_of(points, step);
        let eta = point.and_then(|point| point.eta);
        let h_w_m2k = point.and_then(|point| point.h_w_m2k);
        let since = |now: Option<f64>, first: Option<Option<f64>>| Some(now? - first.unwrap_or(now)?);
        let first = group.visits.first();
        group.visits.push(Visit {
            run: step.run,
            step: step.index,
            t_s: step.start_s + step.offset_s,
            eta,
            sigma_eta: point.and_then(|point| Some(point.eta_uncertainty?.noise_standard_error)),
            change_eta: since(eta, first.map(|visit| visit.eta)),
            h_w_m2k,
            sigma_h_w_m2k: point.and_then(|point| Some(point.h_uncertainty?.noise_standard_error)),
            change_h_w_m2k: since(h_w_m2k, first.map(|visit| visit.h_w_m2k)),
            channels: visit_channels(request, recordings, readings, *position),
        });
    }
    group
}

fn visit_channels(
    request: &DriftRequest<'_>,
    recordings: &[&Recording],
    readings: &Readings,
    position: usize,
) -> BTreeMap<&'static str, VisitChannel> {
    let own: Vec<_> = readings.all.iter().filter(|means| means.segment.step == position).collect();
    let (Some(transient), Some(end)) = (own.first(), own.last()) else { return BTreeMap::new() };
    let recording = recordings[readings.steps[position].run];
    let declared = request.declared();
    let entry = |(column, channel): (usize, &Channel)| {
        let value = end.measured[column]?;
        let ratio = mean_variance_ratio(declared.noise_colour, recording, *channel, &end.segment);
        let read = VisitChannel {
            end: value,
            end_less_model: value - end.nominal[column],
            transient_less_model: transient.measured[column]
                .filter(|_| own.len() > 1)
                .map(|value| value - transient.nominal[column]),
            sigma: declared.noise_sigma(*channel) * ratio.sqrt(),
        };
        Some((channel.symbol(), read))
    };
    OUTPUTS.iter().enumerate().filter_map(entry).collect()
}
