//! The mesh of a fitted map.

use super::surface::interpolate_between_lines;
use crate::StructuredGrid;
use mapper_core::{FittedMap, FittedNode};

/// Efficiency (fraction) over corrected flow (x, kg/s) and pressure ratio (y) on the supported part of a fitted map, finer in
/// speed than its lines; NaN in extrapolated parts. `None` for fewer than two lines.
pub fn fitted_surface(fitted: &FittedMap) -> Option<StructuredGrid> {
    let speeds: Vec<f64> = fitted.lines.iter().map(|line| line.speed_corrected_rpm).collect();
    let columns = fitted.beta_ratio.len();
    if speeds.len() < 2 || !speeds.windows(2).all(|w| w[1] > w[0]) {
        return None;
    }
    let mut fields: [Vec<Vec<f64>>; 3] = Default::default();
    for column in 0..columns {
        let values: [fn(&FittedNode) -> f64; 3] = [
            |n| n.flow_corrected_kg_s,
            |n| n.pressure_ratio,
            |n| if n.extrapolated { f64::NAN } else { n.eta },
        ];
        for (field, value) in fields.iter_mut().zip(values) {
            let over_speed: Vec<f64> =
                fitted.lines.iter().map(|line| line.nodes.get(column).map_or(f64::NAN, value)).collect();
            field.push(interpolate_between_lines(&speeds, &over_speed));
        }
    }
    let rows = fields[0].first()?.len();
    // The values are computed by columns, but the grid is stored by rows.
    let flat =
        |field: &Vec<Vec<f64>>| (0..rows).flat_map(|r| field.iter().map(move |c| c[r])).collect::<Vec<f64>>();
    StructuredGrid::new(rows, columns, flat(&fields[0]), flat(&fields[1]), flat(&fields[2]))
}
