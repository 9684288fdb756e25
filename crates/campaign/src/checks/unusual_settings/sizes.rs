//! Checks sizes and masses against those of the reference machine scaled to the wheel.

use crate::campaign::{Campaign, MapSource};
use crate::checks::concern::{Concern, to_mm};
use crate::machine_sizes::{SIZES, Size, similar_machine};
use mapper_physics::compressor_map::characteristic::CompressorCharacteristic;
use mapper_physics::compressor_map::closed_form_map::ClosedFormMap;
use mapper_yaml::{Step, steps};

/// Usual diameters of compressor wheels, m: 20 mm in the smallest passenger cars, 200 mm in locomotives. Ships have larger ones, which are
/// not tested on such gas stands.
const USUAL_WHEEL_DIAMETERS_M: (f64, f64) = (0.02, 0.2);
/// Possible diameters of compressor wheels, m: a tenth of the smallest to ten times the largest usual one. Outside, the unit is wrong.
const POSSIBLE_WHEEL_DIAMETERS_M: (f64, f64) = (0.002, 2.0);
/// Maximum ratio, either way, of a compressor's choke flow to the scaled reference machine's at equal tip speed. Confused units differ by
/// more: lb/min and kg/s by 132, g/s and kg/s by 1000.
const MAX_FLOW_RATIO: f64 = 10.0;
/// Maximum efficiency of a turbine: the best ones reach 0.8 (Baines, Fundamentals of Turbocharging, ch. 5).
const MAX_TURBINE_EFFICIENCY: f64 = 0.85;

pub(crate) fn find_concerns(campaign: &Campaign) -> Vec<Concern> {
    let params = &campaign.machine.params;
    let mut concerns = Vec::new();
    let wheel_m = params.compressor.wheel_diameter_m;
    if !(USUAL_WHEEL_DIAMETERS_M.0..=USUAL_WHEEL_DIAMETERS_M.1).contains(&wheel_m) {
        let is_error = !(POSSIBLE_WHEEL_DIAMETERS_M.0..=POSSIBLE_WHEEL_DIAMETERS_M.1).contains(&wheel_m);
        concerns.push(Concern {
            is_error,
            at: steps!["machine", "geometry", "compressor", "wheel_diameter"].to_vec(),
            message: format!(
                "a compressor wheel of {} mm is unusual: turbochargers have {:.0} to {:.0} mm",
                to_mm(wheel_m),
                1e3 * USUAL_WHEEL_DIAMETERS_M.0,
                1e3 * USUAL_WHEEL_DIAMETERS_M.1
            ),
            remedy: "write its diameter at the exit, with its unit".to_owned(),
        });
        // The other sizes cannot be compared with such a wheel. The map shows whether the wheel is wrong, which would make
        // points of its lines unreachable.
        concerns.extend(check_map_flow(campaign).filter(|_| !is_error));
        return concerns;
    }
    let reference = similar_machine(wheel_m);
    let check_size = |size: &Size| {
        let usual_ratio = size.usual_ratio?;
        let (value, usual) = (size.value(params), size.value(&reference));
        let ((low, high), (by, unit)) = ((usual / usual_ratio, usual * usual_ratio), size.unit);
        (!(low..=high).contains(&value)).then(|| Concern {
            is_error: false,
            at: size.steps(),
            message: format!(
                "the {} is {} {unit}; with a compressor wheel of {} mm {} to {} {unit} would be usual",
                size.name,
                two_digits(by * value),
                to_mm(wheel_m),
                two_digits(by * low),
                two_digits(by * high)
            ),
            remedy: "check the value and its unit, and the wheel's diameter".to_owned(),
        })
    };
    concerns.extend(SIZES.iter().filter_map(check_size));
    concerns.extend(check_map_flow(campaign));
    if params.turbine.peak_efficiency > MAX_TURBINE_EFFICIENCY {
        concerns.push(Concern {
            is_error: false,
            at: steps!["machine", "geometry", "turbine", "peak_efficiency"].to_vec(),
            message: format!(
                "a peak efficiency of {} is above that of any turbine of a turbocharger; the best have {MAX_TURBINE_EFFICIENCY}",
                params.turbine.peak_efficiency
            ),
            remedy: "write the peak efficiency of the turbine, total to static, e.g. 0.75".to_owned(),
        });
    }
    concerns
}

/// Checks the flow of the nominal map: a flow that is impossible for the wheel has a wrong unit.
fn check_map_flow(campaign: &Campaign) -> Option<Concern> {
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
    (factor > MAX_FLOW_RATIO).then(|| {
        let at: &[Step] = &steps!["machine", "map", "file"];
        Concern {
            is_error: true,
            at: at.to_vec(),
            message: format!(
                "the flow of the map `{named}` is about {} times too {direction} for a wheel of {} mm: it is read as {} kg/s at choke and \
                 {:.1} krpm, where {} kg/s would be usual",
                one_digit(factor),
                to_mm(wheel_diameter_m),
                two_digits(found_kg_s),
                speed_rpm / 1e3,
                two_digits(usual_kg_s)
            ),
            remedy: "name the unit in the heading of the flow's column, e.g. `flow [lb/min]`; or correct \
                     `machine.geometry.compressor.wheel_diameter`"
                .to_owned(),
        }
    })
}

/// Rounds to one significant digit.
fn one_digit(value: f64) -> f64 {
    let unit = 10f64.powi(value.log10().floor() as i32);
    (value / unit).round() * unit
}

/// A number with two significant digits.
fn two_digits(value: f64) -> String {
    let digits = (1.0 - value.abs().log10().floor()).max(0.0);
    if digits > 4.0 { format!("{value:.1e}") } else { format!("{value:.*}", digits as usize) }
}
