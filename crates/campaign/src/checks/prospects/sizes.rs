//! Checks sizes and masses against those of the reference machine scaled to the wheel.

use crate::campaign::{Campaign, MapSource};
use crate::checks::concern::{Concern, mm};
use crate::machine_sizes::{SIZES, Size, similar_machine};
use mapper_physics::compressor_map::characteristic::CompressorCharacteristic;
use mapper_physics::compressor_map::closed_form_map::ClosedFormMap;
use mapper_yaml::{Step, steps};

/// Range of compressor wheels, m: 20 mm in the smallest passenger cars, 200 mm in locomotives. Ships have larger ones, but
/// no gas stand of this kind is known for them.
const USUAL_WHEELS_M: (f64, f64) = (0.02, 0.2);
/// Range beyond which a wheel is a mistyped unit, m: a tenth of the smallest, and ten times the largest.
const POSSIBLE_WHEELS_M: (f64, f64) = (0.002, 2.0);
/// Factor by which the choke flow of a compressor may differ from that of the reference machine at equal tip speed, scaled to the
/// wheel. The units that are confused are further apart: lb/min and kg/s by 132, g/s and kg/s by 1000.
const FLOW_RATIO: f64 = 10.0;
/// The best turbines of turbochargers reach 0.8 (Baines, Fundamentals of Turbocharging, ch. 5); above this a value was mistyped.
const TURBINE_EFFICIENCY: f64 = 0.85;

pub(crate) fn concerns(campaign: &Campaign) -> Vec<Concern> {
    let params = &campaign.machine.params;
    let mut concerns = Vec::new();
    let wheel_m = params.compressor.wheel_diameter_m;
    if !(USUAL_WHEELS_M.0..=USUAL_WHEELS_M.1).contains(&wheel_m) {
        concerns.push(Concern {
            grave: !(POSSIBLE_WHEELS_M.0..=POSSIBLE_WHEELS_M.1).contains(&wheel_m),
            at: steps!["machine", "geometry", "compressor", "wheel_diameter"].to_vec(),
            message: format!(
                "a compressor wheel of {} mm is not a turbocharger's: they have {:.0} to {:.0} mm",
                mm(wheel_m),
                1e3 * USUAL_WHEELS_M.0,
                1e3 * USUAL_WHEELS_M.1
            ),
            remedy: "write its diameter at the exit, with its unit".to_owned(),
        });
        // Such a wheel cannot serve as a reference for the other sizes.
        return concerns;
    }
    let reference = similar_machine(wheel_m);
    let judged = |size: &Size| {
        let usual_ratio = size.usual_ratio?;
        let (value, usual) = (size.value(params), size.value(&reference));
        let ((low, high), (by, unit)) = ((usual / usual_ratio, usual * usual_ratio), size.unit);
        (!(low..=high).contains(&value)).then(|| Concern {
            grave: false,
            at: size.steps(),
            message: format!(
                "the {} is {} {unit}; with a compressor wheel of {} mm {} to {} {unit} would be usual",
                size.name,
                short(by * value),
                mm(wheel_m),
                short(by * low),
                short(by * high)
            ),
            remedy: "check the value and its unit, and the wheel's diameter".to_owned(),
        })
    };
    concerns.extend(SIZES.iter().filter_map(judged));
    concerns.extend(map_flow(campaign));
    if params.turbine.peak_efficiency > TURBINE_EFFICIENCY {
        concerns.push(Concern {
            grave: false,
            at: steps!["machine", "geometry", "turbine", "peak_efficiency"].to_vec(),
            message: format!(
                "a peak efficiency of {} is more than any turbocharger's turbine has; {TURBINE_EFFICIENCY} would be the best",
                params.turbine.peak_efficiency
            ),
            remedy: "write the turbine's own peak, total to static, e.g. 0.75".to_owned(),
        });
    }
    concerns
}

/// A nominal map with a flow that no compressor of this wheel has: its unit is not the assumed one, and no point would be reached.
fn map_flow(campaign: &Campaign) -> Option<Concern> {
    let MapSource::Table { named, .. } = &campaign.machine.map else { return None };
    let map = campaign.machine.map.table()?.ok()?;
    let speed_rpm = *map.speeds_corrected_rpm().last()?;
    let wheel_diameter_m = campaign.machine.params.compressor.wheel_diameter_m;
    let (found_kg_s, usual_kg_s) = (
        map.choke_flow_corrected_kg_s(speed_rpm),
        ClosedFormMap { wheel_diameter_m }.choke_flow_corrected_kg_s(speed_rpm),
    );
    let ratio = found_kg_s / usual_kg_s;
    let (factor, direction) = if ratio > 1.0 { (ratio, "large") } else { (1.0 / ratio, "small") };
    (factor > FLOW_RATIO).then(|| {
        let at: &[Step] = &steps!["machine", "map", "file"];
        Concern {
            grave: true,
            at: at.to_vec(),
            message: format!(
                "the flow of the map `{named}` is about {} times too {direction} for a wheel of {} mm: it is read as {} kg/s at choke and \
                 {:.1} krpm, where {} kg/s would be usual",
                leading(factor),
                mm(wheel_diameter_m),
                short(found_kg_s),
                speed_rpm / 1e3,
                short(usual_kg_s)
            ),
            remedy: "name the unit in the heading of the flow's column, e.g. `flow [lb/min]`; or correct \
                     `machine.geometry.compressor.wheel_diameter`"
                .to_owned(),
        }
    })
}

/// One significant digit.
fn leading(value: f64) -> f64 {
    let unit = 10f64.powi(value.log10().floor() as i32);
    (value / unit).round() * unit
}

/// Two significant digits.
fn short(value: f64) -> String {
    let digits = (1.0 - value.abs().log10().floor()).max(0.0);
    if digits > 4.0 { format!("{value:.1e}") } else { format!("{value:.*}", digits as usize) }
}
