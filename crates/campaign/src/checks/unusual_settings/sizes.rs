//! Checks sizes and masses against those of the reference machine scaled to the wheel.

use crate::campaign::{Campaign, MapSource};
use crate::checks::concern::{Concern, to_mm};
use crate::checks::map_misfit::{find_map_misfit, two_digits};
use crate::machine_sizes::{SIZES, Size, similar_machine};
use mapper_yaml::{Step, steps};

/// Place of the nominal map.
pub(super) const MAP_FILE: [&str; 3] = ["machine", "map", "file"];
/// Place of the wheel.
pub(super) const WHEEL: [&str; 4] = ["machine", "geometry", "compressor", "wheel_diameter"];
/// Usual diameters of compressor wheels, m: 20 mm in the smallest passenger cars, 200 mm in locomotives. Ships have larger ones, which are
/// not tested on such gas stands.
pub const USUAL_WHEEL_DIAMETERS_M: (f64, f64) = (0.02, 0.2);
/// Possible diameters of compressor wheels, m: a tenth of the smallest to ten times the largest usual one. Outside, the unit is wrong.
const POSSIBLE_WHEEL_DIAMETERS_M: (f64, f64) = (0.002, 2.0);
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
            at: WHEEL.map(Step::from).to_vec(),
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
        concerns.extend(check_map(campaign).filter(|_| !is_error));
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
    concerns.extend(check_map(campaign));
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

/// Compares the nominal map with the wheel.
fn check_map(campaign: &Campaign) -> Option<Concern> {
    let MapSource::Table { named, .. } = &campaign.machine.map else { return None };
    let map = campaign.machine.map.table()?.ok()?;
    let misfit = find_map_misfit(&map, campaign.machine.params.compressor.wheel_diameter_m)?;
    Some(Concern {
        is_error: true,
        at: MAP_FILE.map(Step::from).to_vec(),
        message: format!("the map `{named}`: {misfit}"),
        remedy: misfit.remedy().to_owned(),
    })
}
