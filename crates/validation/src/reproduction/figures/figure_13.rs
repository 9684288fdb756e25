//! Figure 13: points visited along speed lines, and by jumps between them.

use crate::reproduction::lab::{OPENINGS, fixed, paper_machine};
use crate::reproduction::picture::target_speeds_rpm;
use crate::reproduction::{FigureResult, ReproduceError, Statement, Table, Verdict};
use mapper_chart::{Axis, Figure, Line, Marker, Panel, Scatter, palette};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::steady::{SteadyState, hold_speed};

/// Order of the speeds in one round of jumps: table 1 jumps between the slowest and the third, the second and the fastest.
const JUMP_ORDER: [usize; 4] = [0, 2, 1, 3];

/// Differences of the housing temperature between successive settled points, K.
fn gradients_k(visits: &[SteadyState]) -> Vec<f64> {
    visits.windows(2).map(|pair| (pair[1].state.tc_k - pair[0].state.tc_k).abs()).collect()
}

pub(crate) fn figure() -> Result<FigureResult, ReproduceError> {
    let machine = paper_machine();
    let settle = |speed_rpm: f64, valve_opening_ratio: f64| {
        let boundary = BoundaryConditions { valve_opening_ratio, ..BoundaryConditions::default() };
        hold_speed(&machine, speed_rpm, &boundary)
    };
    let speeds = target_speeds_rpm();
    // Along each line, to and fro.
    let mut lines = Vec::new();
    for (index, speed_rpm) in speeds.into_iter().enumerate() {
        for place in 0..OPENINGS.len() {
            let place = if index % 2 == 0 { place } else { OPENINGS.len() - 1 - place };
            lines.push(settle(speed_rpm, OPENINGS[place])?);
        }
    }
    let mut jumps = Vec::new();
    for opening in OPENINGS {
        for index in JUMP_ORDER {
            jumps.push(settle(speeds[index], opening)?);
        }
    }
    let (along, between) = (gradients_k(&lines), gradients_k(&jumps));
    let sum = |gradients: &[f64]| gradients.iter().sum::<f64>();
    let mean = |gradients: &[f64]| sum(gradients) / gradients.len() as f64;
    let statements = vec![
        Statement::new(
            "Along speed lines the small changes between points keep the time of thermal stabilisation short (section 6).",
            format!(
                "The settled housing changes by {} K a step along the lines, by {} K a step in jumps.",
                fixed(mean(&along), 1),
                fixed(mean(&between), 1)
            ),
            Verdict::holds_if(mean(&along) < mean(&between)),
        ),
        Statement::new(
            "Jumps between speed lines maximise the thermal gradient between points.",
            format!(
                "Sum over the map {} K in jumps, {} K along the lines. What that is worth to the errors: [orders](orders.md).",
                fixed(sum(&between), 0),
                fixed(sum(&along), 0)
            ),
            Verdict::holds_if(sum(&between) > 2.0 * sum(&along)),
        ),
        Statement::new(
            "Jumps allow a better detection of drift of the measurement.",
            "Of T2 and Tc, but not of pressures and flow: [drift and orders](drift_orders.md).".to_owned(),
            Verdict::Partly,
        ),
        Statement::new(
            "The method takes considerably less time than a full thermal characterisation, and than mapping that waits for stabilisation.",
            "Against mapping that waits: the column `steps, min` of [orders](orders.md). A characterisation by [11] needs several series on a rig."
                .to_owned(),
            Verdict::NeedsRig,
        ),
    ];
    let mut table = Table::new(["order", "steps", "mean gradient, K", "largest gradient, K", "sum, K"]);
    for (name, gradients) in [("(a) speed lines", &along), ("(b) jumps", &between)] {
        table.row([
            name.to_owned(),
            gradients.len().to_string(),
            fixed(mean(gradients), 1),
            fixed(gradients.iter().copied().fold(0.0, f64::max), 1),
            fixed(sum(gradients), 0),
        ]);
    }
    Ok(FigureResult {
        number: "13".to_owned(),
        title: "conventional and proposed order of the points".to_owned(),
        method: "Settled housing temperatures of the paper's machine (figure 11) at the 4 speeds and 5 openings, in both orders."
            .to_owned(),
        statements,
        table,
        svg: picture(&lines, &jumps),
    })
}

fn picture(lines: &[SteadyState], jumps: &[SteadyState]) -> String {
    let panel = |title: &str, visits: &[SteadyState]| {
        let at: Vec<(f64, f64)> =
            visits.iter().map(|s| (s.outputs.flow_corrected_kg_s, s.outputs.pressure_ratio)).collect();
        let mut panel =
            Panel::new(Axis::new("corrected mass flow, kg/s"), Axis::new("pressure ratio")).title(title);
        panel.add(Line::new(at.clone(), palette::GREY).width_px(1.0).arrows());
        panel.add(Scatter::new(at, palette::BLUE).marker(Marker::Circle));
        panel
    };
    Figure::new("Figure 13: orders of the points")
        .panel(panel("(a) conventional", lines))
        .panel(panel("(b) proposed", jumps))
        .to_svg()
}
