//! The sizes of a machine, and their scaling with the compressor's wheel if the campaign does not give them.
//!
//! Machines are assumed to be geometrically similar: lengths scale with the wheel, areas and flows with its square, masses and volumes
//! with the cube, the inertia with the fifth power. Materials and the dimensionless Nusselt laws are equal. The reference is the machine of Burke et
//! al., Appendix A, whose wheel has 52 mm.

use mapper_physics::machine::params::Params;
use mapper_yaml::{Step, Tree};
use serde::Serialize;

/// Maximum ratios, either way, of a size to the scaled reference machine's without a warning: a factor of ten is a wrong unit.
const MAX_LENGTH_RATIO: f64 = 4.0;
const MAX_AREA_RATIO: f64 = 10.0;
const MAX_MASS_RATIO: f64 = 10.0;
const MAX_INERTIA_RATIO: f64 = 100.0;

/// Relative uncertainty of an area that is scaled from the wheel, one standard deviation. Judgement: trims of
/// 45 to 60 in catalogues alone change the inlet's area by a seventh about the mean, and volutes differ more.
const SCALED_AREA_SIGMA_RATIO: f64 = 0.2;

/// Place of the geometry in a campaign.
const GEOMETRY: [&str; 2] = ["machine", "geometry"];

/// A size that the campaign does not give.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct AssumedSize {
    /// Key below `machine.geometry`, e.g. `compressor.internal_area`.
    pub key: String,
    /// Name.
    pub name: &'static str,
    /// Value in `unit`.
    pub value: f64,
    /// Unit; empty for a plain number.
    pub unit: &'static str,
}

/// A size, its exponent with the wheel, and its format.
pub(crate) struct Size {
    /// Keys below `machine.geometry`.
    pub path: &'static [&'static str],
    pub name: &'static str,
    pub field: fn(&mut Params) -> &mut f64,
    pub power: i32,
    /// Maximum usual ratio to the scaled reference; `None` if the size varies freely between machines.
    pub usual_ratio: Option<f64>,
    /// Factor to the unit shown, and the unit.
    pub unit: (f64, &'static str),
}

const MM: (f64, &str) = (1e3, "mm");
const M2: (f64, &str) = (1.0, "m^2");
const KG: (f64, &str) = (1.0, "kg");
const DIMENSIONLESS: (f64, &str) = (1.0, "");

#[rustfmt::skip]
pub(crate) const SIZES: &[Size] = &[
    Size { path: &["compressor", "internal_area"], name: "internal area of the compressor", field: |p| &mut p.compressor.internal_area_m2, power: 2, usual_ratio: Some(MAX_AREA_RATIO), unit: M2 },
    Size { path: &["compressor", "inlet_diameter"], name: "inlet of the compressor", field: |p| &mut p.compressor.inlet_diameter_m, power: 1, usual_ratio: Some(MAX_LENGTH_RATIO), unit: MM },
    Size { path: &["compressor", "outlet_diameter"], name: "outlet of the compressor", field: |p| &mut p.compressor.outlet_diameter_m, power: 1, usual_ratio: Some(MAX_LENGTH_RATIO), unit: MM },
    Size { path: &["compressor", "housing_mass"], name: "housing of the compressor", field: |p| &mut p.compressor.housing_mass_kg, power: 3, usual_ratio: Some(MAX_MASS_RATIO), unit: KG },
    Size { path: &["compressor", "external_area"], name: "external area of the compressor", field: |p| &mut p.compressor.external_area_m2, power: 2, usual_ratio: Some(MAX_AREA_RATIO), unit: M2 },
    Size { path: &["compressor", "nusselt", "coefficient"], name: "coefficient of the compressor's Nusselt law", field: |p| &mut p.compressor.nusselt_coefficient, power: 0, usual_ratio: None, unit: DIMENSIONLESS },
    Size { path: &["compressor", "nusselt", "exponent"], name: "exponent of the compressor's Nusselt law", field: |p| &mut p.compressor.nusselt_exponent, power: 0, usual_ratio: None, unit: DIMENSIONLESS },
    Size { path: &["turbine", "internal_area"], name: "internal area of the turbine", field: |p| &mut p.turbine.internal_area_m2, power: 2, usual_ratio: Some(MAX_AREA_RATIO), unit: M2 },
    Size { path: &["turbine", "inlet_diameter"], name: "inlet of the turbine", field: |p| &mut p.turbine.inlet_diameter_m, power: 1, usual_ratio: Some(MAX_LENGTH_RATIO), unit: MM },
    Size { path: &["turbine", "wheel_radius"], name: "radius of the turbine's wheel", field: |p| &mut p.turbine.wheel_radius_m, power: 1, usual_ratio: Some(MAX_LENGTH_RATIO), unit: MM },
    Size { path: &["turbine", "housing_mass"], name: "housing of the turbine", field: |p| &mut p.turbine.housing_mass_kg, power: 3, usual_ratio: Some(MAX_MASS_RATIO), unit: KG },
    Size { path: &["turbine", "external_area"], name: "external area of the turbine", field: |p| &mut p.turbine.external_area_m2, power: 2, usual_ratio: Some(MAX_AREA_RATIO), unit: M2 },
    Size { path: &["turbine", "choked_flow"], name: "choked flow of the turbine", field: |p| &mut p.turbine.choked_flow_kg_s, power: 2, usual_ratio: Some(MAX_AREA_RATIO), unit: (1.0, "kg/s") },
    Size { path: &["turbine", "nusselt", "coefficient"], name: "coefficient of the turbine's Nusselt law", field: |p| &mut p.turbine.nusselt_coefficient, power: 0, usual_ratio: None, unit: DIMENSIONLESS },
    Size { path: &["turbine", "nusselt", "exponent"], name: "exponent of the turbine's Nusselt law", field: |p| &mut p.turbine.nusselt_exponent, power: 0, usual_ratio: None, unit: DIMENSIONLESS },
    Size { path: &["bearing", "section_area"], name: "section of the bearing housing", field: |p| &mut p.bearing.section_area_m2, power: 2, usual_ratio: Some(MAX_AREA_RATIO), unit: M2 },
    Size { path: &["bearing", "length"], name: "length of the bearing housing", field: |p| &mut p.bearing.length_m, power: 1, usual_ratio: Some(MAX_LENGTH_RATIO), unit: MM },
    // A heat-transfer coefficient times the wetted area.
    Size { path: &["bearing", "oil_conductance"], name: "conductance to the oil", field: |p| &mut p.bearing.oil_conductance_w_k, power: 2, usual_ratio: None, unit: (1.0, "W/K") },
    Size { path: &["shaft_inertia"], name: "inertia of shaft and wheels", field: |p| &mut p.shaft_inertia_kgm2, power: 5, usual_ratio: Some(MAX_INERTIA_RATIO), unit: (1.0, "kg m^2") },
    Size { path: &["outlet", "volume"], name: "volume before the valve", field: |p| &mut p.outlet.volume_m3, power: 3, usual_ratio: None, unit: (1.0, "m^3") },
    Size { path: &["outlet", "valve_area"], name: "area of the valve", field: |p| &mut p.outlet.valve_area_m2, power: 2, usual_ratio: Some(MAX_AREA_RATIO), unit: M2 },
];

impl Size {
    /// Place in the campaign.
    pub fn steps(&self) -> Vec<Step> {
        GEOMETRY.iter().chain(self.path).map(|key| Step::from(*key)).collect()
    }

    fn assumed(&self, params: &Params) -> AssumedSize {
        AssumedSize {
            key: self.path.join("."),
            name: self.name,
            value: self.unit.0 * self.value(params),
            unit: self.unit.1,
        }
    }

    /// Value in SI.
    pub fn value(&self, params: &Params) -> f64 {
        *(self.field)(&mut params.clone())
    }
}

/// Wheel diameter over that of the reference machine.
fn wheel_ratio(wheel_diameter_m: f64) -> f64 {
    wheel_diameter_m / Params::default().compressor.wheel_diameter_m
}

/// The reference machine, scaled to a wheel of this exit diameter.
pub fn similar_machine(wheel_diameter_m: f64) -> Params {
    let ratio = wheel_ratio(wheel_diameter_m);
    let mut params = Params::default();
    for size in SIZES {
        *(size.field)(&mut params) *= ratio.powi(size.power);
    }
    params.compressor.wheel_diameter_m = wheel_diameter_m;
    params
}

/// The sizes of [`similar_machine`].
pub fn similar_sizes(wheel_diameter_m: f64) -> Vec<AssumedSize> {
    let params = similar_machine(wheel_diameter_m);
    SIZES.iter().map(|size| size.assumed(&params)).collect()
}

/// Relative uncertainty of the compressor's internal area, one standard deviation: 0 if the campaign gives the area.
pub fn internal_area_sigma_ratio(assumed: &[AssumedSize]) -> f64 {
    let scaled = assumed.iter().any(|size| size.key == "compressor.internal_area");
    if scaled { SCALED_AREA_SIGMA_RATIO } else { 0.0 }
}

/// The sizes that the file does not give.
pub(crate) fn find_assumed_sizes(tree: &Tree, params: &Params) -> Vec<AssumedSize> {
    let left_out = |size: &&Size| tree.get(&size.steps()).is_none();
    SIZES.iter().filter(left_out).map(|size| size.assumed(params)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equal densities: twice the wheel has eight times the mass, and mass times length squared gives the inertia.
    #[test]
    fn a_machine_of_twice_the_wheel_is_similar() {
        let (one, two) = (Params::default(), similar_machine(2.0 * 52e-3));
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-12;
        assert!(near(two.turbine.housing_mass_kg, 8.0 * one.turbine.housing_mass_kg));
        assert!(near(two.shaft_inertia_kgm2, 8.0 * 4.0 * one.shaft_inertia_kgm2));
        let area =
            |params: &Params| params.outlet.valve_area_m2 / params.compressor.outlet_diameter_m.powi(2);
        assert!(near(area(&two), area(&one)));
        assert_eq!(similar_machine(52e-3), one);
    }
}
