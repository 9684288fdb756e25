//! Coefficients of the compressor wheel, and the flow at the outlet's probe, at each point.

use crate::document::{Document, Table};
use crate::formatting::{Display, number};
use crate::point_results::points::{at_end, step_name};
use mapper_campaign::Campaign;
use mapper_campaign::units::Kind;
use mapper_core::{Channel, IdentifiedPoint, Recording};
use mapper_physics::gas::air::Air;
use mapper_physics::laws::wheel::{MeasuredPoint, WheelCoefficients, pipe_flow};
use mapper_recording::score::ScoredPoint;

/// The coefficients at an identified point.
pub fn wheel_coefficients(point: &IdentifiedPoint, wheel_diameter_m: f64, air: Air) -> WheelCoefficients {
    let &IdentifiedPoint { speed_rpm, flow_kg_s, t1_k, p1_pa, pressure_ratio, eta, .. } = point;
    let measured = MeasuredPoint { speed_rpm, flow_kg_s, t1_k, p1_pa, pressure_ratio, eta };
    WheelCoefficients::new(&measured, wheel_diameter_m, air)
}

/// The table; `None` if the campaign declares no wheel.
pub(crate) fn wheel_section(
    campaign: &Campaign,
    points: &[ScoredPoint],
    recording: &Recording,
    air: Air,
    display: &Display,
) -> Option<Document> {
    let machine = &campaign.machine;
    let compressor = &machine.params.compressor;
    if !machine.wheel_is_declared {
        return None;
    }
    let has_outlet = machine.assumed.iter().all(|size| size.key != "compressor.outlet_diameter");
    let mut heads =
        vec!["step".to_owned(), "u2 m/s".to_owned(), "Mu2".to_owned(), "phi".to_owned(), "lambda".to_owned()];
    if has_outlet {
        heads.extend([display.head("p2 static", Kind::Pressure), "M2".to_owned()]);
    }
    let mut table = Table::new(heads);
    for point in points.iter().map(|scored| &scored.point) {
        let wheel = wheel_coefficients(point, compressor.wheel_diameter_m, air);
        let mut row = vec![
            step_name(point),
            number(Some(wheel.tip_speed_m_s), 0),
            number(Some(wheel.blade_mach_number), 3),
            number(Some(wheel.flow_coefficient), 4),
            number(wheel.work_coefficient, 3),
        ];
        if has_outlet {
            let marker = recording.steps.iter().find(|marker| marker.index == point.step);
            let t2_k = marker.and_then(|marker| at_end(recording, marker, Channel::T2));
            let flow = t2_k.and_then(|t2_k| {
                let p2_pa = point.pressure_ratio * point.p1_pa;
                pipe_flow(p2_pa, point.flow_kg_s, t2_k, compressor.outlet_diameter_m, air)
            });
            row.push(flow.map_or_else(|| "-".to_owned(), |(static_pa, _)| display.pressure(static_pa)));
            row.push(number(flow.map(|(_, mach_number)| mach_number), 3));
        }
        table.row(row);
    }
    let mut document = Document::default();
    document.text(
        "u2: tip speed. Mu2 = u2/a1, phi = m/(rho1 u2 D2^2), lambda = work/u2^2, with total quantities at the inlet (Casey and Robinson, J. \
         Turbomachinery 135 (2013) 021034). p2 static, M2: pressure and Mach number in the outlet pipe, at the T2 probe.",
    );
    document.table(table);
    Some(document)
}
