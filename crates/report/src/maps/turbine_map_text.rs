//! Turbine maps as text: how a file was understood, the fit, the comparison of two.

use crate::formatting::number::{number, range_text};
use crate::formatting::table;
use crate::maps::imported_map_text::{columns_text, import_remark_text};
use mapper_core::{FittedTurbine, ImportedTurbine, TurbineMap, TurbineMapPoint, half_width_95};
use mapper_maps::{ReducedTurbinePoint, TurbineComparison};
use std::fmt::Write;

/// The columns, the speed lines, and a sentence for each assumption.
pub fn imported_turbine_text(imported: &ImportedTurbine) -> String {
    let mut text =
        columns_text(&imported.columns, "rpm or rpm/K^0.5, kg/s or kg K^0.5/(s kPa), and as fractions");
    let heads = ["vanes", "rpm/K^0.5", "points", "flow kg K^0.5/(s kPa)", "expansion ratio", "efficiency %"];
    let mut lines = table::with_heads(&heads);
    for line in imported.map.lines() {
        let range = |value: fn(&TurbineMapPoint) -> Option<f64>, factor, digits| {
            range_text(line.iter().filter_map(value), factor, digits)
        };
        lines.add_row(vec![
            number(line.first().and_then(|point| point.vane_position), 3),
            number(line.first().map(|point| point.speed_parameter_rpm_sqrt_k), 0),
            line.len().to_string(),
            range(|point| Some(point.flow_parameter_kg_sqrt_k_s_kpa), 1.0, 5),
            range(|point| Some(point.expansion_ratio), 1.0, 3),
            range(|point| point.efficiency, 100.0, 1),
        ]);
    }
    let _ = writeln!(
        text,
        "{lines}\n\nThe map of a turbine: speed and flow are reduced by the state at its inlet."
    );
    for remark in &imported.remarks {
        let _ = writeln!(text, "{}", import_remark_text(remark));
    }
    text
}

/// A row for each point, with 95 % intervals.
pub fn reduced_turbine_text(points: &[ReducedTurbinePoint], remarks: &[String]) -> String {
    let heads = ["vanes", "rpm/K^0.5", "expansion ratio", "flow", "+/- %", "apparent eff. %", "+/- points"];
    let mut rows = table::with_heads(&heads);
    for ReducedTurbinePoint { point, flow_standard_error, efficiency_standard_error } in points {
        let flow = point.flow_parameter_kg_sqrt_k_s_kpa;
        rows.add_row(vec![
            number(point.vane_position, 3),
            format!("{:.0}", point.speed_parameter_rpm_sqrt_k),
            format!("{:.3}", point.expansion_ratio),
            format!("{flow:.5}"),
            format!("{:.2}", 100.0 * half_width_95(*flow_standard_error) / flow),
            number(point.efficiency.map(|eta| 100.0 * eta), 1),
            number(efficiency_standard_error.map(|error| 100.0 * half_width_95(error)), 2),
        ]);
    }
    let mut text = format!(
        "{rows}\n\nFlow in kg K^0.5/(s kPa). The efficiency is apparent: it is that of T3 and T4, and heat loss between them counts as work, \
         so it is above the adiabatic one.\n"
    );
    for remark in remarks {
        let _ = writeln!(text, "{remark}");
    }
    text
}

/// A row for each line and the error at lines that the fit does not know.
pub fn turbine_fit_text(map: &TurbineMap, fitted: &FittedTurbine) -> String {
    let heads = ["vanes", "rpm/K^0.5", "expansion ratio", "flow", "+/- %", "best efficiency %", "+/- points"];
    let mut rows = table::with_heads(&heads);
    for line in &fitted.lines {
        let measured = || line.nodes.iter().filter(|node| !node.extrapolated);
        let Some((first, last)) = measured().next().zip(measured().next_back()) else { continue };
        let best = measured().max_by(|a, b| {
            a.efficiency.unwrap_or(f64::NEG_INFINITY).total_cmp(&b.efficiency.unwrap_or(f64::NEG_INFINITY))
        });
        let half = best.and_then(|node| Some(node.efficiency_high? - node.efficiency?));
        rows.add_row(vec![
            number(line.vane_position, 3),
            format!("{:.0}", line.speed_parameter_rpm_sqrt_k),
            format!("{:.2} to {:.2}", first.expansion_ratio, last.expansion_ratio),
            format!("{:.5}", last.flow_parameter_kg_sqrt_k_s_kpa),
            format!("{:.1}", 100.0 * (last.flow_high / last.flow_parameter_kg_sqrt_k_s_kpa - 1.0)),
            number(best.and_then(|node| node.efficiency).map(|eta| 100.0 * eta), 1),
            number(half.map(|half| 100.0 * half), 1),
        ]);
    }
    let mut text = format!("{rows}\n\nFlow in kg K^0.5/(s kPa) at the highest measured expansion ratio. ");
    let _ = write!(
        text,
        "{} points. Inner lines that the fit does not know are {:.1} % of flow",
        map.points.len(),
        100.0 * fitted.flow_error_rms_ratio
    );
    let _ = match fitted.efficiency_error_rms {
        Some(rms) => writeln!(text, " and {:.1} points of efficiency from it, rms.", 100.0 * rms),
        None => writeln!(text, " from it, rms."),
    };
    text
}

/// Sentences on the differences between two maps.
pub fn turbine_comparison_text(comparison: &TurbineComparison) -> String {
    let percent = |value: Option<f64>| number(value.map(|value| 100.0 * value), 2);
    let mut rows = table::with_heads(&["", "mean", "rms", "differs at % of points"]);
    for (name, mean, rms, share) in [
        (
            "flow %",
            comparison.flow_difference_mean_ratio,
            comparison.flow_difference_rms_ratio,
            comparison.flow_differs_ratio,
        ),
        (
            "efficiency points",
            comparison.efficiency_difference_mean,
            comparison.efficiency_difference_rms,
            comparison.efficiency_differs_ratio,
        ),
    ] {
        rows.add_row(vec![name.to_owned(), percent(mean), percent(rms), format!("{:.0}", 100.0 * share)]);
    }
    format!(
        "{rows}\n\nSecond minus first at {} points of the second map; {} are beyond the first and were not compared.\n",
        comparison.points.len(),
        comparison.not_compared
    )
}
