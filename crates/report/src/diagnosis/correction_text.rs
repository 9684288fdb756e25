//! A map before and after its correction for the causes of a gap, for a terminal.

use crate::diagnosis::gap_next::next_text;
use crate::diagnosis::gap_text::{cause, headline};
use crate::formatting::table::{COLUMNS, with_heads};
use crate::formatting::wrapped::wrapped;
use mapper_diagnose::gap::{CorrectedMap, Diagnosis, NEEDED_PROBABILITY, NotCorrected, PointCorrection};

/// What the table before and after shows.
pub(crate) const CORRECTION_CAPTION: &str = "Efficiency, %, with its 95 % interval";
/// Its columns.
pub(crate) const CORRECTION_HEADS: [&str; 6] =
    ["step", "krpm", "valve", "as recorded", "corrected", "change, points"];

/// Rows of the table before and after, one a point.
pub(crate) fn correction_rows(points: &[PointCorrection]) -> Vec<[String; 6]> {
    let value = |[eta, low, high]: [f64; 3]| format!("{:.1} +/- {:.1}", 100.0 * eta, 50.0 * (high - low));
    let or_none = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    let row = |point: &PointCorrection| {
        let change = point.before.zip(point.after).map(|(before, after)| 100.0 * (after[0] - before[0]));
        [
            point.step.to_string(),
            format!("{:.1}", point.speed_rpm / 1e3),
            format!("{:.3}", point.valve),
            or_none(point.before.map(value)),
            or_none(point.after.map(value)),
            or_none(change.map(|change| format!("{change:+.2}"))),
        ]
    };
    points.iter().map(row).collect()
}

/// The text, in lines of a terminal.
pub fn correction_text(map: &CorrectedMap, diagnosis: &Diagnosis) -> String {
    let line = |line: &str| {
        if line.chars().count() > COLUMNS { wrapped(line, COLUMNS, 0) } else { format!("{line}\n") }
    };
    build_text(map, diagnosis).lines().map(line).collect()
}

fn build_text(map: &CorrectedMap, diagnosis: &Diagnosis) -> String {
    let mut text = format!("{}\n\n", headline(diagnosis));
    if let Some(refused) = &map.refused {
        text += &format!("Nothing was corrected: {}.\n", refusal(refused));
        for cause_of_map in &map.causes {
            text += &format!("  {}\n", cause(cause_of_map));
        }
        let largest = map.points.iter().map(|point| point.correction_sigma).fold(0.0, f64::max);
        if largest > 0.0 {
            let source = if diagnosis.is_outside_without_closure() {
                "No closure term describes the cause: it may touch every point, and the residual of T2 widens"
            } else {
                "What a correction would change, weighted with its probability, widens"
            };
            text += &format!(
                "{source} the intervals of all points, by a standard uncertainty of up to {:.2} points.\n",
                100.0 * largest
            );
        }
        if diagnosis.probable_closure_term().is_some() {
            text += "A closure term was found: write it with `mapper gap diagnose --closure-terms DIR`, and correct with `--effect`.\n";
        }
        return text + next_text(diagnosis).as_str();
    }
    for (place, cause_of_map) in map.causes.iter().enumerate() {
        let word = if place == 0 { "Corrected for" } else { "or, not distinguished," };
        text += &format!("{word} {} ({:.0} %)\n", cause(cause_of_map), 100.0 * cause_of_map.probability);
    }
    text += &format!("\n{CORRECTION_CAPTION}\n");
    let mut table = with_heads(&CORRECTION_HEADS);
    for row in correction_rows(&map.points) {
        table.add_row(row);
    }
    text += &format!("{table}\n");
    text += &consequence(&map.points);
    text += "The corrected map rests on this cause: if the machine differs in another way, the efficiencies as recorded are as likely.\n";
    text
}

/// What happens to those who use the map as recorded.
fn consequence(points: &[PointCorrection]) -> String {
    let both = points.iter().filter_map(|point| Some((point, point.before?, point.after?)));
    let changes: Vec<(usize, f64, bool)> = both
        .map(|(point, [before, low, high], [after, ..])| {
            (point.step, before - after, !(low..=high).contains(&after))
        })
        .collect();
    let Some((step, largest, _)) = changes.iter().max_by(|a, b| a.1.abs().total_cmp(&b.1.abs())) else {
        return String::new();
    };
    format!(
        "\nIf ignored, efficiencies are up to {:.2} points too {} (step {step}); {} of {} by more than their interval.\n",
        100.0 * largest.abs(),
        if *largest > 0.0 { "high" } else { "low" },
        changes.iter().filter(|(.., is_outside)| *is_outside).count(),
        changes.len()
    )
}

fn refusal(refused: &NotCorrected) -> String {
    let needed = 100.0 * NEEDED_PROBABILITY;
    match refused {
        NotCorrected::NoCause => "the diagnosis names no cause of its library".to_owned(),
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
