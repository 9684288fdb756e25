//! Common parts of the pictures.

use crate::reproduction::lab::{JUMPS, Outcome, extremes};
use crate::reproduction::{FigureResult, lab, picture_path};
use mapper_chart::{Axis, Colour, Dash, Line, Marker, Panel, Scatter, palette};
use mapper_numerics::statistics::range;
use mapper_report::{Table, markdown_table};

pub(crate) fn speed_colour(speed_rpm: f64) -> Colour {
    palette::sequential((speed_rpm - 50e3) / 100e3)
}

pub(crate) fn krpm(speed_rpm: f64) -> String {
    format!("{:.0} krpm", speed_rpm / 1e3)
}

pub(crate) fn target_speeds_rpm() -> [f64; 4] {
    let mut speeds = JUMPS.map(|(_, to_rpm)| to_rpm);
    speeds.sort_by(f64::total_cmp);
    speeds
}

/// Points (model, identified) with colour, shape, hollow flag and legend text.
pub(crate) type Series = (Vec<(f64, f64)>, Colour, Marker, bool, String);

/// Identified against model values with the line of equality and, if given, a band of error around it.
fn equality_panel(title: &str, axis: (&str, &str), band: Option<(f64, &str)>, series: Vec<Series>) -> Panel {
    let (low, high) = range(series.iter().flat_map(|(points, ..)| points.iter().map(|(x, _)| *x)));
    let margin = 0.06 * (high - low);
    let ends = [low - margin, high + margin];
    let mut panel = Panel::new(Axis::new(axis.0), Axis::new(axis.1)).title(title);
    panel.add(Line::new(ends.map(|x| (x, x)).to_vec(), palette::INK).width_px(1.0).label("equal"));
    if let Some((by, label)) = band {
        for by in [-by, by] {
            let line = Line::new(ends.map(|x| (x, x + by)).to_vec(), palette::GREY);
            panel.add(line.width_px(1.0).dash(Dash::Dashed).label(label));
        }
    }
    for (points, colour, marker, hollow, label) in series {
        let scatter = Scatter::new(points, colour).marker(marker).label(label);
        panel.add(if hollow { scatter.hollow() } else { scatter });
    }
    panel
}

pub(crate) fn efficiency_pair(outcome: &Outcome) -> Option<(f64, f64)> {
    Some((100.0 * outcome.eta_mean, 100.0 * outcome.point.eta?))
}

/// h in W/(m2 K): model (mean in the window) and identified, for outcomes with a result.
pub(crate) fn h_pair(outcome: &Outcome) -> Option<(f64, f64)> {
    Some((outcome.h_mean_w_m2k, outcome.point.h_w_m2k?))
}

pub(crate) fn efficiency_panel(series: Vec<Series>) -> Panel {
    let axis = ("model efficiency, %", "identified efficiency, %");
    equality_panel("(a) efficiency", axis, Some((1.0, "1 point off")), series)
}

pub(crate) fn h_panel(series: Vec<Series>) -> Panel {
    let axis = ("model h, W/(m2 K)", "identified h, W/(m2 K)");
    equality_panel("(b) heat-transfer coefficient", axis, None, series)
}

pub(crate) fn series_by_speed(
    outcomes: &[Outcome],
    value: fn(&Outcome) -> Option<(f64, f64)>,
    (marker, is_hollow, name): (Marker, bool, &str),
) -> Vec<Series> {
    let series = |speed_rpm: f64| {
        let points = at_speed(outcomes, speed_rpm).filter_map(value).collect();
        (points, speed_colour(speed_rpm), marker, is_hollow, format!("{name}, {}", krpm(speed_rpm)))
    };
    target_speeds_rpm().map(series).to_vec()
}

pub(crate) fn series_by_case<'a>(
    cases: impl Iterator<Item = (&'a Vec<Outcome>, String)>,
    markers: [Marker; 5],
    is_hollow: fn(usize) -> bool,
    value: fn(&Outcome) -> Option<(f64, f64)>,
) -> Vec<Series> {
    cases
        .zip(markers)
        .enumerate()
        .map(|(index, ((outcomes, label), marker))| {
            let points = outcomes.iter().filter_map(value).collect();
            (points, palette::categorical(index), marker, is_hollow(index), label)
        })
        .collect()
}

pub(crate) fn span_at_speed(
    outcomes: &[Outcome],
    speed_rpm: f64,
    value: fn(&Outcome) -> Option<f64>,
    decimals: usize,
) -> String {
    lab::range(extremes(at_speed(outcomes, speed_rpm).map(value)), decimals)
}

pub(crate) fn at_speed(outcomes: &[Outcome], speed_rpm: f64) -> impl Iterator<Item = &Outcome> {
    outcomes.iter().filter(move |o| o.jump.to_rpm == speed_rpm)
}

/// The page, Markdown; it links pictures by [`picture_path`], relative to the page. The same results give the same bytes.
pub fn reproduction_page(results: &[FigureResult]) -> String {
    let figures = results.iter().map(|result| {
        let statements = result.statements.iter();
        let rows = statements.map(|one| [one.paper.clone(), one.here.clone(), one.verdict.to_string()]);
        format!(
            "\n## Figure {}: {}\n\n{}\n\n{}\n![Figure {}]({})\n\n{}",
            result.number,
            result.title,
            result.method,
            markdown_table(&Table::new(["the paper states", "here", ""]).all_texts().rows(rows)),
            result.number,
            picture_path(result),
            markdown_table(
                &Table::new(&result.table.head).all_numbers().rows(result.table.rows.iter().cloned())
            ),
        )
    });
    std::iter::once(HEAD.to_owned()).chain(figures).collect()
}

const HEAD: &str = "# The paper's figures, redone

Generated; do not edit. The command that makes this page and its pictures:

```
mapper reproduce --out docs/validation
```

R. D. Burke and others, dynamic identification of thermodynamic parameters for turbocharger compressor models: the
figures made in simulation (5 to 10), and 2, 11, 12 and 13 as far as simulation can, redone on the virtual laboratory's nominal model. Its
map and air tables are not printed in the paper and are closed forms here, so numbers agree in kind, not in digits. Each
statement of the paper with a number or a trend is next to the result here: *holds*, *partly*, *differs* or *needs a rig*. An efficiency error is identified
minus model value, in points (1 point = 0.01); ranges run over the valve openings.

Errata of the paper followed here: in eq. 2, T1' is missing on the right side; the nRMSE of the heat-transfer coefficient is 3.2 %
(section 5.1, conclusion 2), not the abstract's 1 %; table 1's \"110000 to 50000\" means target 50 krpm from 110 krpm; section 3 exchanges
the changes of c_p and mu.

Deviations: eq. 11 without its ratio of viscosities; k_bh constant at 47.5 W/(m K), the middle of Appendix A's 45 to 50 over the wall's
temperature; the turbine's flow f(N, PR) and efficiency f(m, PR), tables in Appendix A, are [formulas](../reference/model.md#turbine-vgt-fixed).
";

/// One figure as JSON.
pub fn figure_json(result: &FigureResult) -> serde_json::Value {
    serde_json::json!({
        "figure": result.number,
        "title": result.title,
        "picture": picture_path(result),
        "statements": result.statements.iter().map(|statement| serde_json::json!({
            "paper": statement.paper,
            "here": statement.here,
            "verdict": statement.verdict.to_string(),
        })).collect::<Vec<_>>(),
        "head": result.table.head,
        "rows": result.table.rows,
    })
}
