//! Compressor and turbine maps: how a file was read, the fit, the comparison of two, maps from steady points.

use crate::document::{Describe, Document, Table};
use crate::formatting::{Message, number, range_text};
use crate::point_results::point_warnings::reasons;
use crate::point_results::points::verdict_sentence;
use mapper_core::{
    CompressorMap, EndEvidence, EstimateUncertainty, FittedLine, FittedMap, FittedTurbine, ImportRemark,
    ImportedColumn, ImportedMap, ImportedTurbine, LeftOutLine, MapPoint, PointBudgets, TurbineMap,
    TurbineMapPoint, half_width_95,
};
use mapper_maps::{
    DetectedEnd, LineEnds, MapComparison, MergedMap, PlaceComparison, ReducedTurbinePoint, TurbineComparison,
};
use mapper_numerics::statistics::mean;

impl Describe for ImportedMap {
    fn document(&self) -> Document {
        let map = &self.map;
        let mut document = Document::default();
        add_columns(&mut document, &self.columns, "rpm, kg/s, Pa, K and as fractions");
        let heads = ["corrected rpm", "points", "flow kg/s", "pressure ratio", "efficiency %"];
        let mut lines = Table::new(heads);
        for line in &map.lines {
            let range = |value: fn(&MapPoint) -> Option<f64>, factor, digits| {
                range_text(line.points.iter().filter_map(value), factor, digits)
            };
            lines.row([
                format!("{:.0}", line.speed_corrected_rpm),
                line.points.len().to_string(),
                range(|point| Some(point.flow_corrected_kg_s), 1.0, 4),
                range(|point| Some(point.pressure_ratio), 1.0, 3),
                range(|point| point.eta, 100.0, 1),
            ]);
        }
        document.table(lines);
        document.text(format!("Corrected to {}.", map.reference));
        document.text(match map.efficiency {
            Some(definition) => format!("Efficiency: {}.", definition.description()),
            None => "The file does not name the definition of its efficiency.".to_owned(),
        });
        add_verdicts(&mut document, map);
        self.remarks.iter().for_each(|remark| document.text(remark.message()));
        document
    }
}

fn add_verdicts(document: &mut Document, map: &CompressorMap) {
    let points = || map.lines.iter().flat_map(|line| &line.points).map(|point| &point.identified);
    let reasons = reasons(points());
    if !reasons.is_empty() {
        document.text(verdict_sentence(points()));
        reasons.into_iter().for_each(|reason| document.text(reason));
    }
}

fn add_columns(document: &mut Document, columns: &[ImportedColumn], units: &str) {
    let row = |column: &ImportedColumn| {
        [
            column.heading.clone(),
            column.quantity.to_owned(),
            if column.unit.is_empty() { "none named".to_owned() } else { column.unit.clone() },
            significant(column.low),
            significant(column.high),
        ]
    };
    let heads = ["heading", "quantity", "unit", "from", "to"];
    document.table(Table::new(heads).with_texts([1, 2]).rows(columns.iter().map(row)));
    if !columns.is_empty() {
        document.text(format!("From and to are in {units}."));
    }
}

fn significant(value: f64) -> String {
    let digits = if value.abs() >= 100.0 { 0 } else { 4 };
    format!("{value:.digits$}")
}

impl Message for ImportRemark {
    fn message(&self) -> String {
        match self {
            ImportRemark::NoHeading => {
                "The columns have no headings; taken as rpm, kg/s, pressure ratio and efficiency.".to_owned()
            }
            ImportRemark::FurtherColumns { count } => format!(
                "{count} columns after the efficiency have no headings and were omitted; name them by `--with`, e.g. `--with efficiency=#5`."
            ),
            ImportRemark::UnusedColumns { headings } => format!(
                "Columns that are not used: {}. `--with` selects another column for a quantity, e.g. `--with flow=#5`.",
                headings.iter().map(|heading| format!("`{heading}`")).collect::<Vec<_>>().join(", ")
            ),
            ImportRemark::EfficiencyInPercent => {
                "The efficiencies are taken as percentages, from their size.".to_owned()
            }
            ImportRemark::SpeedOfRowAbove => "Rows without a speed have that of the row above.".to_owned(),
            ImportRemark::FlowUnitAssumed => {
                "The file names no unit of flow; kg/s was taken. If it has lb/s, give `--with flow=lb/s`.".to_owned()
            }
            ImportRemark::SpeedParameterAssumed => {
                "The speeds have no unit; they were taken as rpm/K^0.5, from their size. If they are corrected speeds, give `--with speed=rpm`."
                    .to_owned()
            }
            ImportRemark::DesignSpeed { rpm } => {
                format!("The relative speeds of the file were multiplied by {rpm} rpm.")
            }
            ImportRemark::NoEfficiency => "The file has no efficiencies.".to_owned(),
            ImportRemark::ReducedQuantities { reference } => {
                format!("Reduced speed and flow were corrected to {reference}; give `--reference` for another state.")
            }
            ImportRemark::Measured => {
                "The points are as measured; they were corrected. Their efficiency is the apparent one: it includes heat transfer."
                    .to_owned()
            }
            ImportRemark::ExtrapolatedNodes { count } => {
                format!("{count} extrapolated nodes of a fitted map were omitted.")
            }
            ImportRemark::SurgeLine { points } => {
                format!("The file has a surge line of {points} points; it is that of the map.")
            }
            ImportRemark::SurgeSpeeds { points, left_out } => {
                let rest = match left_out {
                    0 => String::new(),
                    left_out => format!("; {left_out} of them, which no line is near, are left out"),
                };
                format!("The surge line has {points} points without a speed: they have the speeds of the lines that end at their pressure ratios{rest}.")
            }
            ImportRemark::UnusedBlock { title, rows } => {
                format!("Not used: `{title}` with {rows} rows, which are not points of speed lines.")
            }
            ImportRemark::Standstill { rows } => {
                let rows: Vec<String> = rows.iter().map(ToString::to_string).collect();
                format!("The shaft is at standstill in line {}, which is left out.", rows.join(", "))
            }
            ImportRemark::MovedToLineSpeed { points, max_ratio } => format!(
                "{points} points were moved to the mean speed of their line by similarity, at most by {:.1} % of speed.",
                100.0 * max_ratio
            ),
        }
    }
}

impl Describe for MapComparison {
    fn document(&self) -> Document {
        let comparison = self;
        let heads = [
            "corrected rpm",
            "places",
            "flow kg/s",
            "PR",
            "distance %",
            "+/- %",
            "eta points",
            "+/- points",
            "line differs %",
            "eta differs %",
        ];
        let mut table = Table::new(heads);
        let mut lines: Vec<_> = comparison.lines.iter().map(|line| (line, line.differ_ratios())).collect();
        // Where they differ at most places first; of equal ones, in order of speed.
        let most = |ratios: Option<[f64; 2]>| ratios.map_or(-1.0, |[line, eta]| line.max(eta));
        lines.sort_by(|(_, a), (_, b)| most(*b).total_cmp(&most(*a)));
        for (line, ratios) in lines {
            let mean = |value: fn(&PlaceComparison) -> f64| mean(line.places.iter().map(value));
            table.row([
                format!("{:.0}", line.speed_corrected_rpm),
                line.places.len().to_string(),
                number(mean(|p| p.flow_difference_kg_s), 5),
                number(mean(|p| p.pressure_ratio_difference), 4),
                number(mean(|p| 100.0 * p.distance_ratio), 2),
                number(mean(|p| 100.0 * half_width_95(p.distance_standard_error_ratio)), 2),
                number(mean(|p| 100.0 * p.eta_difference), 2),
                number(mean(|p| 100.0 * half_width_95(p.eta_standard_error)), 2),
                number(ratios.map(|[line, _]| 100.0 * line), 0),
                number(ratios.map(|[_, eta]| 100.0 * eta), 0),
            ]);
        }
        let mut document = Document::default();
        document.table(table);
        document.text(format!(
        "Second minus first, means over each line; +/- is the 95 % interval of one place. Over all places: distance {:.2} % rms, efficiency {:+.2} points on average, {:.2} rms; lines differ beyond their \
         uncertainty at {:.0} % of places, efficiencies at {:.0} %.",
        100.0 * comparison.distance_rms_ratio,
        100.0 * comparison.eta_difference_mean,
        100.0 * comparison.eta_difference_rms,
        100.0 * comparison.line_differs_ratio,
        100.0 * comparison.eta_differs_ratio,
    ));
        if !comparison.not_compared_rpm.is_empty() {
            let speeds: Vec<String> = comparison.not_compared_rpm.iter().map(|s| format!("{s:.0}")).collect();
            document.text(format!("Only one of the maps reaches {} rpm: not compared.", speeds.join(", ")));
        }
        document
    }
}

impl Describe for MergedMap {
    fn document(&self) -> Document {
        let mut table = Table::new(["corrected rpm", "of the first", "of the second", "left out"]);
        for line in &self.lines {
            table.row([
                format!("{:.0}", line.speed_corrected_rpm),
                line.of_first.to_string(),
                line.of_second.to_string(),
                line.left_out.to_string(),
            ]);
        }
        let mut document = Document::default();
        document.table(table);
        document.text(
            "Points of each line; those of the second map are left out where the first one has its own line.",
        );
        match &self.seam {
            Some(seam) => document.append(seam.document()),
            None => document.text("The maps have no common place, so nothing shows how well they meet."),
        }
        document
    }
}

/// A row for each line and sentences below.
pub fn map_fit(map: &CompressorMap, fitted: &FittedMap) -> Document {
    let heads = [
        "corrected rpm",
        "surge kg/s",
        "surge PR",
        "choke kg/s",
        "best eta %",
        "+/- points",
        "left out: distance %",
        "eta points",
        "",
    ];
    let mut rows = Table::new(heads).with_texts([8]);
    for line in &fitted.lines {
        let left_out = fitted.left_out.iter().find(|l| l.speed_corrected_rpm == line.speed_corrected_rpm);
        // If the line is supported at all, its best efficiency is supported too.
        let supported = line.nodes.iter().any(|n| !n.extrapolated);
        let known = line.nodes.iter().filter(|n| !(supported && n.extrapolated));
        let best = known.max_by(|a, b| a.eta.total_cmp(&b.eta));
        let surge = line.nodes.last();
        rows.row([
            format!("{:.0}", line.speed_corrected_rpm),
            number(surge.map(|n| n.flow_corrected_kg_s), 4),
            number(surge.map(|n| n.pressure_ratio), 3),
            number(choke_flow(line), 4),
            number(best.map(|n| 100.0 * n.eta), 1),
            number(best.map(|n| 100.0 * half_width_95(n.eta_standard_error)), 1),
            number(left_out.map(|l| 100.0 * l.distance_ratio), 2),
            number(left_out.and_then(|l| l.eta).map(|eta| 100.0 * eta), 2),
            match (line.measured, line.nodes.iter().all(|n| n.extrapolated)) {
                (true, _) if left_out.is_some_and(|l| l.outermost) => "outermost".to_owned(),
                (true, _) => "measured".to_owned(),
                (false, true) => "extrapolated".to_owned(),
                (false, false) => "between".to_owned(),
            },
        ]);
    }
    let mut document = Document::default();
    document.table(rows);
    document.text(format!(
        "Corrected to {}. Points lie {:.2} % (distance in flow over the line's largest flow and PR - 1 over its largest) and {:.2} points of \
         efficiency from the fit, rms; whole lines scatter by {:.1} % of flow.",
        map.reference,
        100.0 * fitted.distance_rms_ratio,
        100.0 * fitted.eta_rms,
        100.0 * fitted.line_scatter_ratio
    ));
    for (outermost, name) in [(false, "inner"), (true, "outermost")] {
        let lines = || fitted.left_out.iter().filter(move |l| l.outermost == outermost);
        let count = lines().count();
        if count == 0 {
            continue;
        }
        let mean = |sum: f64| 100.0 * sum / count as f64;
        let eta = || lines().filter_map(|l| l.eta);
        document.text(format!(
            "Left out, {name} lines: distance {:.2} % on average, {:.2} % at worst; efficiency {:.2} points on average, {:.2} at worst (medians of each line's points).",
            mean(lines().map(|l| l.distance_ratio).sum()),
            100.0 * lines().map(|l| l.distance_ratio).fold(0.0, f64::max),
            mean(eta().sum()),
            100.0 * eta().fold(0.0, f64::max),
        ));
    }
    let points = |line: &LeftOutLine| points_of(map, line.speed_corrected_rpm);
    let coverage = |value: fn(&LeftOutLine) -> Option<f64>| {
        let (mut sum, mut count) = (0.0, 0.0);
        for line in fitted.left_out.iter().filter(|l| !l.outermost) {
            if let Some(share) = value(line) {
                (sum, count) = (sum + share * points(line), count + points(line));
            }
        }
        (count > 0.0).then(|| 100.0 * sum / count)
    };
    if let (Some(distance), Some(eta)) = (coverage(|l| l.distance_held_ratio), coverage(|l| l.eta_held_ratio))
    {
        document.text(format!("At inner lines that were left out, the 95 % intervals contain {distance:.0} % of the points' distances and {eta:.0} % of their efficiencies."));
    }
    document.text(match fitted.crossings {
        0 => "No speed lines cross.".to_owned(),
        crossings => format!(
            "{crossings} pair(s) of neighbouring lines cross: do not use the map there; look for a line whose speed is wrong."
        ),
    });
    document
}

fn points_of(map: &CompressorMap, speed_corrected_rpm: f64) -> f64 {
    let line = map.lines.iter().find(|line| line.speed_corrected_rpm == speed_corrected_rpm);
    line.map_or(0.0, |line| line.points.len() as f64)
}

fn choke_flow(line: &FittedLine) -> Option<f64> {
    line.nodes.iter().map(|n| n.flow_corrected_kg_s).max_by(f64::total_cmp)
}

/// Lines, ends, sources of uncertainty, and remarks.
pub fn reduced_map(
    map: &CompressorMap,
    ends: &[LineEnds],
    budgets: &[PointBudgets],
    remarks: &[String],
) -> Document {
    let heads =
        ["corrected rpm", "points", "best eta %", "+/- points", "surge kg/s", "by", "choke kg/s", "by"];
    let mut lines = Table::new(heads).with_texts([5, 7]);
    for (line, ends) in map.lines.iter().zip(ends) {
        let with_eta = line.points.iter().filter_map(|point| Some((point, point.eta?)));
        let best: Option<(&MapPoint, f64)> = with_eta.max_by(|a, b| a.1.total_cmp(&b.1));
        let width = best
            .and_then(|(point, _)| point.identified.eta_uncertainty)
            .map(|error: EstimateUncertainty| 100.0 * half_width_95(error.combined_standard_error()));
        let flow = |end: &DetectedEnd| number(Some(end.flow_corrected_kg_s), 4);
        lines.row([
            format!("{:.0}", line.speed_corrected_rpm),
            line.points.len().to_string(),
            number(best.map(|(_, eta)| 100.0 * eta), 1),
            number(width, 2),
            flow(&ends.surge),
            evidence_text(ends.surge.by).to_owned(),
            flow(&ends.choke),
            evidence_text(ends.choke.by).to_owned(),
        ]);
    }
    let mut document = Document::default();
    document.table(lines);
    document.text(format!("Corrected to {}.", map.reference));
    add_verdicts(&mut document, map);
    document.table(sources(budgets));
    remarks.iter().for_each(|remark| document.text(remark));
    document
}

fn evidence_text(evidence: EndEvidence) -> &'static str {
    match evidence {
        EndEvidence::Named => "named",
        EndEvidence::ZeroSlope => "zero slope",
        EndEvidence::Efficiency => "eta 58 %",
        EndEvidence::Vertical => "vertical",
        EndEvidence::NotReached => "not reached",
    }
}

fn sources(budgets: &[PointBudgets]) -> Table {
    let rows = || budgets.iter().filter_map(|point| point.eta.as_ref()).flat_map(|budget| &budget.rows);
    let mut names: Vec<&str> = Vec::new();
    for row in rows().filter(|row| row.contribution != 0.0) {
        if !names.contains(&row.source.as_str()) {
            names.push(&row.source);
        }
    }
    let heads = ["source", "median, points", "largest, points"];
    let caption = "Uncertainty of the efficiency by source, one standard deviation";
    let mut table = Table::new(heads).caption(caption);
    for name in names {
        let mut sizes: Vec<f64> =
            rows().filter(|row| row.source == name).map(|row| 100.0 * row.contribution.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let cell = |size: Option<&f64>| number(size.copied(), 3);
        table.row([name.to_owned(), cell(sizes.get(sizes.len() / 2)), cell(sizes.last())]);
    }
    table
}

impl Describe for ImportedTurbine {
    fn document(&self) -> Document {
        let mut document = Document::default();
        add_columns(
            &mut document,
            &self.columns,
            "rpm or rpm/K^0.5, kg/s or kg K^0.5/(s kPa), and as fractions",
        );
        let heads =
            ["vanes", "rpm/K^0.5", "points", "flow kg K^0.5/(s kPa)", "expansion ratio", "efficiency %"];
        let mut lines = Table::new(heads);
        for line in self.map.lines() {
            let range = |value: fn(&TurbineMapPoint) -> Option<f64>, factor, digits| {
                range_text(line.iter().filter_map(value), factor, digits)
            };
            lines.row([
                number(line.first().and_then(|point| point.vane_position), 3),
                number(line.first().map(|point| point.speed_parameter_rpm_sqrt_k), 0),
                line.len().to_string(),
                range(|point| Some(point.flow_parameter_kg_sqrt_k_s_kpa), 1.0, 5),
                range(|point| Some(point.expansion_ratio), 1.0, 3),
                range(|point| point.efficiency, 100.0, 1),
            ]);
        }
        document.table(lines);
        document.text("The map of a turbine: speed and flow are reduced by the state at its inlet.");
        self.remarks.iter().for_each(|remark| document.text(remark.message()));
        document
    }
}

/// A row for each point, with 95 % intervals.
pub fn reduced_turbine(points: &[ReducedTurbinePoint], remarks: &[String]) -> Document {
    let heads = ["vanes", "rpm/K^0.5", "expansion ratio", "flow", "+/- %", "apparent eff. %", "+/- points"];
    let mut rows = Table::new(heads);
    for ReducedTurbinePoint { point, flow_standard_error, efficiency_standard_error } in points {
        let flow = point.flow_parameter_kg_sqrt_k_s_kpa;
        rows.row([
            number(point.vane_position, 3),
            format!("{:.0}", point.speed_parameter_rpm_sqrt_k),
            format!("{:.3}", point.expansion_ratio),
            format!("{flow:.5}"),
            format!("{:.2}", 100.0 * half_width_95(*flow_standard_error) / flow),
            number(point.efficiency.map(|eta| 100.0 * eta), 1),
            number(efficiency_standard_error.map(|error| 100.0 * half_width_95(error)), 2),
        ]);
    }
    let mut document = Document::default();
    document.table(rows);
    document.text(
        "Flow in kg K^0.5/(s kPa). The efficiency is apparent: it is that of T3 and T4, and heat loss between them counts as work, \
         so it is above the adiabatic one.",
    );
    remarks.iter().for_each(|remark| document.text(remark));
    document
}

/// A row for each line and the error at lines that the fit does not know.
pub fn turbine_fit(map: &TurbineMap, fitted: &FittedTurbine) -> Document {
    let heads = ["vanes", "rpm/K^0.5", "expansion ratio", "flow", "+/- %", "best efficiency %", "+/- points"];
    let mut rows = Table::new(heads);
    for line in &fitted.lines {
        let measured = || line.nodes.iter().filter(|node| !node.extrapolated);
        let Some((first, last)) = measured().next().zip(measured().next_back()) else { continue };
        let best = measured().max_by(|a, b| {
            a.efficiency.unwrap_or(f64::NEG_INFINITY).total_cmp(&b.efficiency.unwrap_or(f64::NEG_INFINITY))
        });
        let half = best.and_then(|node| Some(node.efficiency_high? - node.efficiency?));
        rows.row([
            number(line.vane_position, 3),
            format!("{:.0}", line.speed_parameter_rpm_sqrt_k),
            format!("{:.2} to {:.2}", first.expansion_ratio, last.expansion_ratio),
            format!("{:.5}", last.flow_parameter_kg_sqrt_k_s_kpa),
            format!("{:.1}", 100.0 * (last.flow_high / last.flow_parameter_kg_sqrt_k_s_kpa - 1.0)),
            number(best.and_then(|node| node.efficiency).map(|eta| 100.0 * eta), 1),
            number(half.map(|half| 100.0 * half), 1),
        ]);
    }
    let efficiency = fitted
        .efficiency_error_rms
        .map_or_else(String::new, |rms| format!(" and {:.1} points of efficiency", 100.0 * rms));
    let mut document = Document::default();
    document.table(rows);
    document.text(format!(
        "Flow in kg K^0.5/(s kPa) at the highest measured expansion ratio. {} points. Inner lines that the fit does not know are {:.1} % of \
         flow{efficiency} from it, rms.",
        map.points.len(),
        100.0 * fitted.flow_error_rms_ratio
    ));
    document
}

impl Describe for TurbineComparison {
    fn document(&self) -> Document {
        let comparison = self;
        let percent = |value: Option<f64>| number(value.map(|value| 100.0 * value), 2);
        let mut rows = Table::new(["", "mean", "rms", "differs at % of points"]);
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
            rows.row([name.to_owned(), percent(mean), percent(rms), format!("{:.0}", 100.0 * share)]);
        }
        let mut document = Document::default();
        document.table(rows);
        document.text(format!("Second minus first at {} points of the second map; {} are beyond the first and were not compared.",
        comparison.points.len(),
        comparison.not_compared
    ));
        document
    }
}
