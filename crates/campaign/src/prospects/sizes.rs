//! Checks sizes and masses against the wheel. Machines are geometrically similar, so that areas grow
//! with the square of the wheel, masses with the cube, inertia with the fifth power. The reference is the machine of Burke et
//! al., Appendix A.

use crate::campaign::Campaign;
use crate::concern::{Concern, mm};
use mapper_physics::params::Params;
use mapper_yaml::{Step, steps};

/// Range of compressor wheels, m: 20 mm in the smallest passenger cars, 200 mm in locomotives. Ships have larger ones, but
/// no gas stand of this kind is known for them.
const USUAL_WHEELS_M: (f64, f64) = (0.02, 0.2);
/// Factors by which lengths, areas and masses, and the inertia may differ from those of the reference machine, scaled to the wheel.
const LENGTH_RATIO: f64 = 4.0;
const AREA_RATIO: f64 = 10.0;
const MASS_RATIO: f64 = 10.0;
const INERTIA_RATIO: f64 = 100.0;
/// The best turbines of turbochargers reach 0.8 (Baines, Fundamentals of Turbocharging, ch. 5); above this a value was mistyped.
const TURBINE_EFFICIENCY: f64 = 0.85;

/// A size, its exponent with the wheel, and its format.
struct Size {
    path: [&'static str; 2],
    name: &'static str,
    of: fn(&Params) -> f64,
    power: i32,
    factor: f64,
    unit: (f64, &'static str),
}

const MM: (f64, &str) = (1e3, "mm");
const M2: (f64, &str) = (1.0, "m^2");
const KG: (f64, &str) = (1.0, "kg");

#[rustfmt::skip]
const SIZES: &[Size] = &[
    Size { path: ["compressor", "internal_area"], name: "internal area of the compressor", of: |p| p.compressor.internal_area_m2, power: 2, factor: AREA_RATIO, unit: M2 },
    Size { path: ["compressor", "outlet_diameter"], name: "outlet of the compressor", of: |p| p.compressor.outlet_diameter_m, power: 1, factor: LENGTH_RATIO, unit: MM },
    Size { path: ["compressor", "housing_mass"], name: "housing of the compressor", of: |p| p.compressor.housing_mass_kg, power: 3, factor: MASS_RATIO, unit: KG },
    Size { path: ["compressor", "external_area"], name: "external area of the compressor", of: |p| p.compressor.external_area_m2, power: 2, factor: AREA_RATIO, unit: M2 },
    Size { path: ["turbine", "internal_area"], name: "internal area of the turbine", of: |p| p.turbine.internal_area_m2, power: 2, factor: AREA_RATIO, unit: M2 },
    Size { path: ["turbine", "inlet_diameter"], name: "inlet of the turbine", of: |p| p.turbine.inlet_diameter_m, power: 1, factor: LENGTH_RATIO, unit: MM },
    Size { path: ["turbine", "wheel_radius"], name: "radius of the turbine's wheel", of: |p| p.turbine.wheel_radius_m, power: 1, factor: LENGTH_RATIO, unit: MM },
    Size { path: ["turbine", "housing_mass"], name: "housing of the turbine", of: |p| p.turbine.housing_mass_kg, power: 3, factor: MASS_RATIO, unit: KG },
    Size { path: ["turbine", "external_area"], name: "external area of the turbine", of: |p| p.turbine.external_area_m2, power: 2, factor: AREA_RATIO, unit: M2 },
    Size { path: ["turbine", "choked_flow"], name: "choked flow of the turbine", of: |p| p.turbine.choked_flow_kg_s, power: 2, factor: AREA_RATIO, unit: (1.0, "kg/s") },
    Size { path: ["bearing", "section_area"], name: "section of the bearing housing", of: |p| p.bearing.section_area_m2, power: 2, factor: AREA_RATIO, unit: M2 },
    Size { path: ["bearing", "length"], name: "length of the bearing housing", of: |p| p.bearing.length_m, power: 1, factor: LENGTH_RATIO, unit: MM },
    Size { path: ["outlet", "valve_area"], name: "area of the valve", of: |p| p.outlet.valve_area_m2, power: 2, factor: AREA_RATIO, unit: M2 },
];

pub(super) fn concerns(campaign: &Campaign) -> Vec<Concern> {
    let (params, measure) = (&campaign.machine.params, Params::default());
    let geometry = |rest: &[&'static str]| -> Vec<Step> {
        let rest = rest.iter().map(|key| Step::from(*key));
        steps!["machine", "geometry"].iter().cloned().chain(rest).collect()
    };
    let mut concerns = Vec::new();
    let wheel_m = params.compressor.wheel_diameter_m;
    if !(USUAL_WHEELS_M.0..=USUAL_WHEELS_M.1).contains(&wheel_m) {
        concerns.push(Concern {
            grave: false,
            at: geometry(&["compressor", "wheel_diameter"]),
            message: format!(
                "a compressor wheel of {} mm is no turbocharger's: they have {:.0} to {:.0} mm",
                mm(wheel_m),
                1e3 * USUAL_WHEELS_M.0,
                1e3 * USUAL_WHEELS_M.1
            ),
            remedy: "write its diameter at the exit, with its unit".to_owned(),
        });
        // Such a wheel cannot serve as a reference for the other sizes.
        return concerns;
    }
    let scale = wheel_m / measure.compressor.wheel_diameter_m;
    let judged = |size: &Size, at: Vec<Step>| {
        let (value, usual) = ((size.of)(params), (size.of)(&measure) * scale.powi(size.power));
        let ((low, high), (by, unit)) = ((usual / size.factor, usual * size.factor), size.unit);
        // Omitted values are those of the paper.
        let written = value != (size.of)(&measure);
        (written && !(low..=high).contains(&value)).then(|| Concern {
            grave: false,
            at,
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
    concerns.extend(SIZES.iter().filter_map(|size| judged(size, geometry(&size.path))));
    let inertia = Size {
        path: ["", ""],
        name: "inertia of shaft and wheels",
        of: |params| params.shaft_inertia_kgm2,
        power: 5,
        factor: INERTIA_RATIO,
        unit: (1.0, "kg m^2"),
    };
    concerns.extend(judged(&inertia, geometry(&["shaft_inertia"])));
    if params.turbine.peak_efficiency > TURBINE_EFFICIENCY {
        concerns.push(Concern {
            grave: false,
            at: geometry(&["turbine", "peak_efficiency"]),
            message: format!(
                "a peak efficiency of {} is more than any turbocharger's turbine has; {TURBINE_EFFICIENCY} would be the best",
                params.turbine.peak_efficiency
            ),
            remedy: "write the turbine's own peak, total to static, e.g. 0.75".to_owned(),
        });
    }
    concerns
}

/// Two significant digits.
fn short(value: f64) -> String {
    let digits = (1.0 - value.abs().log10().floor()).max(0.0);
    if digits > 4.0 { format!("{value:.1e}") } else { format!("{value:.*}", digits as usize) }
}
