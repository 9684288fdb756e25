//! A diagnosis as a page for a terminal.

use crate::number::four_figures;
use mapper_core::with_unit;
use mapper_gap::report::{Candidate, Diagnosis, Gap, Next, Verdict};
use mapper_physics::bearing_friction::at_150_krpm;

/// Causes shown.
const CAUSES: usize = 5;
/// Places shown.
const PLACES: usize = 5;

/// The page.
pub fn gap_text(diagnosis: &Diagnosis) -> String {
    let mut text = format!("{}\n", headline(diagnosis));
    if !diagnosis.r#where.is_empty() {
        text += "\nwhere\n";
        for place in diagnosis.r#where.iter().take(PLACES) {
            text += &format!(
                "  {:20} {:>3.0} % of the gap, {:.0} sigma; largest in {}, {} after the jump, {}: {} {}\n",
                place.submodel,
                100.0 * place.share,
                place.sigma,
                place.channel,
                place.phase,
                place.region,
                four_figures(place.size),
                place.unit,
            );
        }
    }
    text += "\nwhich\n";
    for candidate in diagnosis.candidates.iter().take(CAUSES) {
        text += &format!("  {:>5.1} %  {}\n", 100.0 * candidate.probability, cause(candidate));
        for set in &candidate.equivalent {
            text += &format!("           cannot be told apart from {}\n", set.join(" + "));
        }
    }
    text += &format!("  {:>5.1} %  nothing beyond tolerance\n", 100.0 * diagnosis.probability_none);
    text += &format!("  {:>5.1} %  a cause outside the catalogue\n", 100.0 * diagnosis.probability_outside);
    text += &laws(diagnosis);
    text += &how_far(&diagnosis.gap);
    if let Some(next) = &diagnosis.next {
        text += "\nwhat next\n";
        text += &match next {
            Next::Jump { from, to, expected_probability, minutes } => format!(
                "  jump from {:.0} krpm at opening {} to {:.0} krpm at {}: {minutes:.1} min, after which the true cause should reach {:.0} %\n  mapper plan CAMPAIGN --append {:.0}krpm@{} {:.0}krpm@{} --out PLAN puts it after the points\n",
                from.speed_rpm / 1e3,
                from.valve,
                to.speed_rpm / 1e3,
                to.valve,
                100.0 * expected_probability,
                from.speed_rpm / 1e3,
                from.valve,
                to.speed_rpm / 1e3,
                to.valve,
            ),
            Next::Sensor { sensor, reason } => format!("  {sensor}: {reason}\n"),
        };
    }
    if !diagnosis.warnings.is_empty() {
        text += "\nbefore you believe it\n";
        for warning in &diagnosis.warnings {
            text += &format!("  {warning}\n");
        }
    }
    text
}

/// A law less probable than this closes a gap without being its truth.
const NOT_THE_TRUTH: f64 = 0.05;

/// What is missing and by which law.
fn laws(diagnosis: &Diagnosis) -> String {
    let mut text = String::new();
    if let (Some(force), Some(place)) = (diagnosis.forces.first(), diagnosis.r#where.first())
        && force.submodel == place.submodel
    {
        let (low, high) =
            force.steps.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), [value, ..]| {
                (low.min(*value), high.max(*value))
            });
        text += &format!(
            "\nmissing\n  {}: {} .. {} over the steps\n",
            force.force,
            four_figures(low),
            with_unit(four_figures(high), &force.unit)
        );
    }
    for law in &diagnosis.laws {
        text += &format!(
            "\nlaw\n  {}\n  {:.0} %; removes {:.0} % of the gap on held-out steps\n",
            law.sentence,
            100.0 * law.probability,
            100.0 * law.shrink
        );
        if law.probability < NOT_THE_TRUTH {
            text += "  what it leaves is more than noise: its form is not the true one\n";
        }
        for other in &law.equivalent {
            text += &format!("  cannot be told apart from: {other}\n");
        }
        if let Some(file) = &law.rhai {
            text += &format!("  written to {file}: give it with --effect\n");
        }
    }
    text
}

/// One sentence.
pub fn headline(diagnosis: &Diagnosis) -> String {
    let first = diagnosis.candidates.first().map_or_else(String::new, |c| c.effects.join(" + "));
    match diagnosis.verdict {
        Verdict::WithinTolerance => "nothing beyond the declared tolerances is seen".to_owned(),
        Verdict::Explained => format!("{first} explains the gap"),
        Verdict::PartlyExplained => {
            format!("{first} explains most of the gap; what is left is more than tolerance")
        }
        Verdict::Unexplained => "no effect of the catalogue explains the gap".to_owned(),
    }
}

/// A cause with its parameters.
pub fn cause(candidate: &Candidate) -> String {
    let parameters: Vec<String> = candidate
        .parameters
        .iter()
        .map(|(name, e)| {
            format!(
                "{name} = {} ({} .. {}){}",
                with_unit(four_figures(e.value), &e.unit),
                four_figures(e.low),
                four_figures(e.high),
                beside(e.value, &e.unit)
            )
        })
        .collect();
    format!("{}: {}", candidate.effects.join(" + "), parameters.join(", "))
}

/// What engineers judge a parameter by, where its unit says little.
fn beside(value: f64, unit: &str) -> String {
    if unit == "W s2/rad2" { format!(", {}", at_150_krpm(value)) } else { String::new() }
}

fn how_far(gap: &Gap) -> String {
    let mut text = format!(
        "\nhow far, on {} steps that were used neither for selection nor for fitting\n  {:.1} % of the gap removed ({:.1} .. {:.1} %)\n",
        gap.held_out_steps.len(),
        100.0 * gap.shrink,
        100.0 * gap.shrink_low,
        100.0 * gap.shrink_high
    );
    for (channel, row) in &gap.channels {
        // Pascals are many.
        let (scale, unit) = if row.unit == "Pa" { (1e-3, "kPa") } else { (1.0, row.unit.as_str()) };
        text += &format!(
            "  {channel:4} {:>10} -> {:>10} {unit}\n",
            four_figures(scale * row.before),
            four_figures(scale * row.after)
        );
    }
    let largest = |of: fn(&mapper_gap::report::PointGap) -> f64| {
        gap.points
            .iter()
            .map(of)
            .filter(|d| d.is_finite())
            .fold(0.0f64, |most, d| if d.abs() > most.abs() { d } else { most })
    };
    text += &format!(
        "  efficiency changes by up to {:+.2} points, h by up to {:+.0} W/(m2 K)\n",
        100.0 * largest(|p| p.eta_after - p.eta_before),
        largest(|p| p.h_after_w_m2k - p.h_before_w_m2k)
    );
    text
}
