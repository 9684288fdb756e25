//! What follows from a diagnosed gap: a prediction checked, a map without its causes.

use crate::diagnosis::gap_next::next_section;
use crate::diagnosis::gap_text::{cause, headline};
use crate::document::{Document, Table};
use crate::formatting::{display_scale, four_figures, with_margins};
use mapper_core::{Margins, valve_area_text};
use mapper_diagnose::gap::{CorrectedMap, Diagnosis, ForecastCheck, NotCorrected, PointCorrection};

/// The residual of each channel. `seal`: the hash of the prediction.
pub fn forecast_check(check: &ForecastCheck, seal: &str) -> Document {
    let mut document = Document::default();
    document.text(format!("forecast {seal}"));
    document.text(format!(
        "{} values, nothing fitted: residual {:.2} times the noise, {:.1} % within the 95 % band",
        check.values,
        check.ratio,
        100.0 * check.inside
    ));
    let mut table = Table::new(["channel", "rms", "unit", "times the noise", "% within"]).with_texts([2]);
    for (channel, row) in &check.channels {
        let (scale, unit) = display_scale(&row.unit);
        table.row([
            channel.to_string(),
            four_figures(scale * row.rms),
            unit.to_owned(),
            format!("{:.2}", row.ratio),
            format!("{:.1}", 100.0 * row.inside),
        ]);
    }
    document.table(table);
    document
}

pub(crate) fn correction_table(points: &[PointCorrection]) -> Table {
    let value =
        |[eta, low, high]: [f64; 3]| with_margins(100.0 * eta, Margins::new(eta, low, high).scaled(100.0), 1);
    let or_none = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    let row = |point: &PointCorrection| {
        let change = point.before.zip(point.after).map(|(before, after)| 100.0 * (after[0] - before[0]));
        [
            point.step.to_string(),
            format!("{:.1}", point.speed_rpm / 1e3),
            valve_area_text(point.valve),
            or_none(point.before.map(value)),
            or_none(point.after.map(value)),
            or_none(change.map(|change| format!("{change:+.2}"))),
        ]
    };
    let heads = ["step", "krpm", "valve area", "as recorded", "corrected", "change, points"];
    Table::new(heads).caption("Efficiency, %, with its 95 % interval").rows(points.iter().map(row))
}

/// The correction, or the reason against one.
pub fn correction(map: &CorrectedMap, diagnosis: &Diagnosis) -> Document {
    let mut document = Document::default();
    document.strong(headline(diagnosis));
    if let Some(refused) = &map.refused {
        document.text(format!("Nothing was corrected: {}.", refusal(refused)));
        document.list(map.causes.iter().map(cause));
        let largest = map.points.iter().map(|point| point.correction_sigma).fold(0.0, f64::max);
        if largest > 0.0 {
            let source = if diagnosis.is_outside_without_closure() {
                "No closure term is certain enough: the cause may touch every point, and the residual of T2 and the nearest term widen"
            } else {
                "What a correction would change, weighted with its probability, widens"
            };
            document.text(format!(
                "{source} the intervals of all points, by a standard uncertainty of up to {:.2} points.",
                100.0 * largest
            ));
        }
        document.section("Next experiment", next_section(diagnosis));
        return document;
    }
    for (place, cause_of_map) in map.causes.iter().enumerate() {
        let word = if place == 0 { "Corrected for" } else { "or, not distinguished," };
        document.text(format!("{word} {} ({:.0} %)", cause(cause_of_map), 100.0 * cause_of_map.probability));
    }
    document.table(correction_table(&map.points));
    document.text(consequence(&map.points).unwrap_or_default());
    document.text("The corrected map is right if this is the cause. If the machine differs in another way, use the efficiencies as recorded.");
    document
}

fn consequence(points: &[PointCorrection]) -> Option<String> {
    let both = points.iter().filter_map(|point| Some((point, point.before?, point.after?)));
    let changes: Vec<(usize, f64, bool)> = both
        .map(|(point, [before, low, high], [after, ..])| {
            (point.step, before - after, !(low..=high).contains(&after))
        })
        .collect();
    let (step, largest, _) = changes.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
    Some(format!(
        "If ignored, efficiencies are up to {:.2} points too {} (step {step}); {} of {} by more than their interval.",
        100.0 * largest.abs(),
        if *largest > 0.0 { "high" } else { "low" },
        changes.iter().filter(|(.., is_outside)| *is_outside).count(),
        changes.len()
    ))
}

fn refusal(refused: &NotCorrected) -> String {
    let needed = 100.0 * CorrectedMap::NEEDED_PROBABILITY;
    match refused {
        NotCorrected::NoCause => "the diagnosis names no cause of its library".to_owned(),
        NotCorrected::OfTheMachine => {
            "the cause belongs to the machine itself, and its efficiency as recorded is the true one"
                .to_owned()
        }
        NotCorrected::NotClosed { gap_reduction } => format!(
            "the closure term removes {:.0} % of the gap on held-out steps, and {:.0} % are needed",
            100.0 * gap_reduction,
            100.0 * CorrectedMap::NEEDED_GAP_REDUCTION
        ),
        NotCorrected::Improbable { probability } => {
            format!(
                "the open causes have {:.0} % together, and {needed:.0} % are needed",
                100.0 * probability
            )
        }
        NotCorrected::Undetermined => "the recording does not determine how large the causes are".to_owned(),
        NotCorrected::Ambiguous { step, difference, half_interval } => format!(
            "the recording does not distinguish these causes, and at step {step} their corrections differ by {:.2} points where the interval is \
             +/- {:.2}",
            100.0 * difference,
            100.0 * half_interval
        ),
    }
}
