//! A production as text: the spread of its machines at every point, the stand, and outliers.

use crate::formatting::{number, table};
use crate::history::history_text::time;
use mapper_history::{
    DeviationPattern, Drift, MIN_MACHINES_FOR_OUTLIERS, Outlier, Production, ProductionPoint, Spread, Stand,
};

/// Everything, a table and a few sentences for each campaign and method.
pub fn production_text(productions: &[Production]) -> String {
    productions.iter().map(describe_production).collect::<Vec<_>>().join("\n")
}

fn describe_production(production: &Production) -> String {
    let (machines, nights) = (production.machines.len(), production.nights_ms.len());
    let mut text = format!(
        "{} by {}: {machines} machines, {nights} {}, {} runs\n\n",
        production.campaign,
        production.method,
        if nights == 1 { "night" } else { "nights" },
        production.runs
    );
    let heads = [
        "krpm",
        "opening",
        "eta %",
        "machines",
        "nights",
        "rest",
        "h W/(m2 K)",
        "machines %",
        "nights %",
        "rest %",
    ];
    let mut table = table::with_heads(&heads);
    for place in &production.places {
        table.add_row(row(place));
    }
    text.push_str(&format!("{table}\n\n"));
    text.push_str("machines, nights, rest: standard deviations, of efficiency in points, of h in % of it\n");
    if production.places.iter().all(|place| place.eta.as_ref().is_none_or(|eta| eta.machine_sigma.is_none()))
    {
        text.push_str(
            "each machine was measured once: how far machines differ is within the rest; a second night or seed separates them\n",
        );
    }
    if let Some(stand) = &production.stand {
        text.push_str(&of_stand(stand, production));
    }
    text.push_str(&match &production.outliers {
        None => format!("fewer than {MIN_MACHINES_FOR_OUTLIERS} machines: outliers are not determined\n"),
        Some(outliers) if outliers.is_empty() => "no machine is an outlier\n".to_owned(),
        Some(outliers) => {
            let lines: String = outliers.iter().map(describe_outlier).collect();
            format!(
                "{} of {machines} machines stand out; the table is without them:\n{lines}",
                outliers.len()
            )
        }
    });
    text
}

fn row(place: &ProductionPoint) -> Vec<String> {
    let mut row =
        vec![number::number(Some(place.speed_rpm / 1e3), 1), number::four_figures(place.valve_opening_ratio)];
    let sigmas = |spread: &Option<Spread>| {
        let range_of = |read: fn(&Spread) -> Option<f64>| {
            number::number(spread.as_ref().and_then(read).map(|sigma| 100.0 * sigma), 2)
        };
        [
            range_of(|spread| spread.machine_sigma),
            range_of(|spread| spread.night_sigma),
            range_of(|spread| Some(spread.residual_sigma)),
        ]
    };
    row.push(number::number(place.eta.as_ref().map(|eta| 100.0 * eta.mean), 2));
    row.extend(sigmas(&place.eta));
    row.push(number::number(place.h_w_m2k.as_ref().map(|h| h.mean), 0));
    row.extend(sigmas(&place.h_w_m2k));
    row
}

fn of_stand(stand: &Stand, production: &Production) -> String {
    let span = match (production.nights_ms.first(), production.nights_ms.last()) {
        (Some(first), Some(last)) => format!("{} to {}", time(*first, "%Y-%m-%d"), time(*last, "%Y-%m-%d")),
        _ => String::new(),
    };
    let drift = |drift: &Option<Drift>, unit: &str| {
        let Some(Drift { a_day, low, high }) = drift else {
            return format!("too few nights to determine a drift in time ({unit})");
        };
        let clear = if low * high > 0.0 { "drifts by" } else { "does not drift clearly:" };
        format!("{clear} {:+.3} ({:+.3} .. {:+.3}) {unit} a day", 100.0 * a_day, 100.0 * low, 100.0 * high)
    };
    format!(
        "the stand, shared by all machines, {span}:\n  efficiency {}; nights scatter by {:.3} points in addition\n  h {}; nights scatter by {:.3} % in addition\n",
        drift(&stand.eta_drift, "points"),
        100.0 * stand.eta_night_sigma,
        drift(&stand.h_drift, "%"),
        100.0 * stand.h_night_sigma
    )
}

fn describe_outlier(outlier: &Outlier) -> String {
    let shown = match outlier.sign {
        DeviationPattern::EfficiencyEverywhere => {
            format!("efficiency {:+.2} % of it at all speeds", 100.0 * outlier.eta_ratio)
        }
        DeviationPattern::EfficiencyAtLowSpeed => format!(
            "efficiency {:+.2} % of it at the lowest speed, falling as 1/speed^2",
            100.0 * outlier.eta_ratio_at_lowest_speed
        ),
        DeviationPattern::HeatTransfer => format!("h {:+.2} % everywhere", 100.0 * outlier.h_ratio),
    };
    format!(
        "  {}: {shown} ({:.1} robust standard deviations)\n    probable cause: {}\n",
        outlier.machine,
        outlier.sigmas.abs(),
        outlier.sign.causes()
    )
}
