//! `boundary:` and `limits:`.

use crate::checking::Check;
use crate::si_values::value_or;
use crate::units::{Duration, Fraction, Kind, Pressure, Quantity, Speed, Temperature, TemperatureDifference};
use mapper_core::{AvoidedRange, Limits};
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::operating_point::reach::FollowOutlet;
use mapper_yaml::{FindingKind, steps};
use schemars::JsonSchema;
use serde::Deserialize;

/// Conditions that the rig and the cell hold constant.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct BoundaryFile {
    /// Compressor inlet total temperature, T1.
    #[schemars(extend("x-min" = "200 K", "x-max" = "400 K"))]
    inlet_temperature: Quantity<Temperature>,
    /// Compressor inlet total pressure, P1.
    #[schemars(extend("x-min" = "20 kPa", "x-max" = "400 kPa"))]
    inlet_pressure: Quantity<Pressure>,
    /// Temperature around the housings; `inlet_temperature` if none is given.
    #[schemars(extend("x-min" = "200 K", "x-max" = "400 K"))]
    ambient_temperature: Option<Quantity<Temperature>>,
    /// Turbine inlet total temperature, T3.
    #[schemars(extend("x-min" = "250 K", "x-max" = "1400 K"), example = &"500 degC")]
    turbine_inlet_temperature: Quantity<Temperature>,
    /// Turbine outlet pressure, P4.
    #[schemars(extend("x-min" = "20 kPa", "x-max" = "400 kPa"), example = &"110 kPa")]
    turbine_outlet_pressure: Quantity<Pressure>,
    /// Oil inlet temperature.
    #[schemars(extend("x-min" = "230 K", "x-max" = "450 K"), example = &"50 degC")]
    oil_temperature: Quantity<Temperature>,
    /// Conditions that follow the outlet temperature of the compressor instead, which is that of the nominal machine in steady state at each point: `[turbine_inlet_temperature, oil_temperature]` for adiabatic mapping. None if it is omitted.
    #[serde(default)]
    #[schemars(extend("uniqueItems" = true, "examples" = [["turbine_inlet_temperature", "oil_temperature"]]))]
    follow_outlet: Vec<FollowerName>,
}

/// Quantities that may follow the compressor outlet temperature.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub(crate) enum FollowerName {
    TurbineInletTemperature,
    OilTemperature,
}

impl BoundaryFile {
    /// The boundary conditions; P3 and valve come from the plan, and are set to no flow and to 1 until then.
    pub(crate) fn conditions(&self) -> BoundaryConditions {
        BoundaryConditions {
            t1_k: self.inlet_temperature.value,
            p1_pa: self.inlet_pressure.value,
            p3_pa: self.turbine_outlet_pressure.value,
            t3_k: self.turbine_inlet_temperature.value,
            p4_pa: self.turbine_outlet_pressure.value,
            oil_temperature_k: self.oil_temperature.value,
            ambient_temperature_k: value_or(self.ambient_temperature, self.inlet_temperature.value),
            valve_opening_ratio: 1.0,
        }
    }

    /// Conditions that follow the outlet temperature instead.
    pub(crate) fn follow_outlet(&self) -> FollowOutlet {
        FollowOutlet {
            turbine_inlet: self.follow_outlet.contains(&FollowerName::TurbineInletTemperature),
            oil: self.follow_outlet.contains(&FollowerName::OilTemperature),
        }
    }
}

/// Limits that the run must never exceed.
#[derive(Debug, Clone, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct LimitsFile {
    /// Highest shaft speed.
    #[schemars(extend("x-above" = "0 rpm", "x-max" = "1000 krpm"), example = &"180 krpm")]
    speed: Quantity<Speed>,
    /// Lowest and highest allowed setpoint of the turbine inlet pressure, P3.
    turbine_inlet_pressure: PressureRangeFile,
    /// Highest turbine inlet temperature, T3.
    #[schemars(extend("x-min" = "250 K", "x-max" = "1400 K"), example = &"600 degC")]
    turbine_inlet_temperature: Option<Quantity<Temperature>>,
    /// Highest compressor outlet temperature, T2.
    #[schemars(extend("x-min" = "250 K", "x-max" = "800 K"), example = &"250 degC")]
    compressor_outlet_temperature: Option<Quantity<Temperature>>,
    /// Smallest surge margin of points and of the jumps between them: flow over the surge flow at equal corrected speed, minus one. If none is given, 0 %, the surge line, for points and 5 % for jumps; a jump to a closer point has nearly the margin of the point. Use a value below 0 % for a machine that is known to be stable beyond the nominal map's line.
    #[schemars(extend("x-min" = "-50 %", "x-max" = "200 %"), example = &"2 %")]
    surge_margin: Option<Quantity<Fraction>>,
    /// Largest change of the compressor housing within an identification window.
    #[schemars(extend("x-above" = "0 K", "x-max" = "500 K"), example = &"30 K")]
    housing_gradient: Option<Quantity<TemperatureDifference>>,
    /// Largest overshoot of the shaft speed in a jump, relative to the higher of its two targets; 2 % if none is given.
    #[schemars(extend("x-above" = "0 %", "x-max" = "20 %"), example = &"2 %")]
    overshoot: Option<Quantity<Fraction>>,
    /// Shaft speeds that a jump crosses and no step holds: critical speeds, resonances of blades.
    #[serde(default)]
    #[schemars(length(max = 8), extend("examples" = [[{"from": "88 krpm", "to": "92 krpm"}]]))]
    avoid: Vec<AvoidedRangeFile>,
}

/// A range of shaft speeds that no step holds.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct AvoidedRangeFile {
    /// Lowest speed inside.
    #[schemars(extend("x-above" = "0 rpm", "x-max" = "1000 krpm"), example = &"88 krpm")]
    from: Quantity<Speed>,
    /// Highest speed inside.
    #[schemars(extend("x-above" = "0 rpm", "x-max" = "1000 krpm"), example = &"92 krpm")]
    to: Quantity<Speed>,
    /// Longest time inside in a jump; 3 s if none is given. A jump that takes longer is not allowed.
    #[schemars(extend("x-min" = "0.1 s", "x-max" = "10 min"), example = &"3 s")]
    longest: Option<Quantity<Duration>>,
}

/// Lowest and highest pressure.
#[derive(Debug, Clone, Copy, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub(crate) struct PressureRangeFile {
    /// Lowest pressure.
    #[schemars(extend("x-above" = "0 kPa", "x-max" = "2 MPa"), example = &"110 kPa")]
    min: Quantity<Pressure>,
    /// Highest pressure.
    #[schemars(extend("x-above" = "0 kPa", "x-max" = "2 MPa"), example = &"400 kPa")]
    max: Quantity<Pressure>,
    /// Time of the rig from the lowest to the highest pressure; `rig.actuators` can say more about its motion.
    #[schemars(extend("x-above" = "0 s", "x-max" = "24 h"), example = &"10 s")]
    stroke: Option<Quantity<Duration>>,
}

impl From<&LimitsFile> for Limits {
    fn from(file: &LimitsFile) -> Self {
        let p3 = file.turbine_inlet_pressure;
        let range = |file: &AvoidedRangeFile| AvoidedRange {
            from_rpm: file.from.value,
            to_rpm: file.to.value,
            longest_s: value_or(file.longest, AvoidedRange::LONGEST_S),
        };
        Limits {
            speed_max_rpm: file.speed.value,
            p3_min_pa: p3.min.value,
            p3_max_pa: p3.max.value,
            p3_stroke_s: p3.stroke.map(|stroke| stroke.value),
            t3_max_k: file.turbine_inlet_temperature.map(|limit| limit.value),
            t2_max_k: file.compressor_outlet_temperature.map(|limit| limit.value),
            surge_margin_min_ratio: file.surge_margin.map(|limit| limit.value),
            housing_gradient_max_k: file.housing_gradient.map(|limit| limit.value),
            overshoot_max_ratio: file.overshoot.map(|limit| limit.value),
            avoid: file.avoid.iter().map(range).collect::<Vec<_>>().into(),
        }
    }
}

/// Checks that the limits leave a valid range and contain the boundary conditions.
pub(crate) fn check(check: &mut Check<'_>) {
    let low = check.quantity(Kind::Pressure, &steps!["limits", "turbine_inlet_pressure", "min"]);
    let high_path = steps!["limits", "turbine_inlet_pressure", "max"];
    let high = check.quantity(Kind::Pressure, &high_path);
    if let (Some((low_pa, low)), Some((high_pa, high))) = (low, high)
        && low_pa >= high_pa
    {
        let message = format!("`{high}` is not above the lowest pressure, `{low}`");
        check.note(FindingKind::Conflict, &high_path, message, "`max` must be above `min`");
    }
    let is_range = low.zip(high).is_none_or(|((low_pa, _), (high_pa, _))| low_pa < high_pa);
    let outlet = check.quantity(Kind::Pressure, &steps!["boundary", "turbine_outlet_pressure"]);
    if let (Some((outlet_pa, outlet)), Some((high_pa, high))) = (outlet, high)
        && outlet_pa >= high_pa
        && is_range
    {
        let message =
            format!("`{high}` is not above the turbine outlet pressure, `{outlet}`: the turbine never turns");
        let remedy = "raise it, or lower `boundary.turbine_outlet_pressure`";
        check.note(FindingKind::Conflict, &high_path, message, remedy);
    }
    let setpoint_path = steps!["boundary", "turbine_inlet_temperature"];
    let setpoint = check.quantity(Kind::Temperature, &setpoint_path);
    let limit = check.quantity(Kind::Temperature, &steps!["limits", "turbine_inlet_temperature"]);
    if let (Some((setpoint_k, setpoint)), Some((limit_k, limit))) = (setpoint, limit)
        && setpoint_k > limit_k
    {
        let message = format!("`{setpoint}` is above `limits.turbine_inlet_temperature`, `{limit}`");
        check.note(FindingKind::Conflict, &setpoint_path, message, "lower it, or raise the limit");
    }
    check_avoided(check);
}

/// Checks that the speeds to avoid are ranges below the limit of speed, and do not overlap.
fn check_avoided(check: &mut Check<'_>) {
    let limit = check.quantity(Kind::Speed, &steps!["limits", "speed"]);
    let mut before: Vec<(f64, f64)> = Vec::new();
    for index in 0..check.count(&steps!["limits", "avoid"]) {
        let path = |key: &'static str| steps!["limits", "avoid", index, key];
        let ends = check.quantity(Kind::Speed, &path("from")).zip(check.quantity(Kind::Speed, &path("to")));
        let Some(((from_rpm, from), (to_rpm, to))) = ends else { continue };
        let (message, remedy) = if from_rpm >= to_rpm {
            (format!("`{to}` is not above `from`, `{from}`"), "`to` must be above `from`; exchange the two")
        } else if let Some((_, limit)) = limit.filter(|(limit_rpm, _)| to_rpm > *limit_rpm) {
            let message = format!("`{to}` is above `limits.speed`, `{limit}`");
            (message, "end the range at the limit, or remove it: the shaft never goes there")
        } else if let Some((low_rpm, high_rpm)) =
            before.iter().find(|(low_rpm, high_rpm)| from_rpm <= *high_rpm && to_rpm >= *low_rpm)
        {
            let (low, high) = (low_rpm / 1e3, high_rpm / 1e3);
            let message = format!("{from} to {to} overlaps the range {low} to {high} krpm");
            (message, "write the two as one range")
        } else {
            before.push((from_rpm, to_rpm));
            continue;
        };
        check.note(FindingKind::Conflict, &path("to"), message, remedy);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_key_lands_in_its_own_field() {
        let text = "{speed: 180 krpm, turbine_inlet_pressure: {min: 110 kPa, max: 4 bar, stroke: 10 s}, turbine_inlet_temperature: 600 degC, compressor_outlet_temperature: 200 degC, surge_margin: -5 %, housing_gradient: 30 K, overshoot: 3 %, avoid: [{from: 88 krpm, to: 92 krpm}, {from: 40 krpm, to: 41 krpm, longest: 5 s}]}";
        let limits = Limits::from(&crate::testing::any::<LimitsFile>(text).unwrap());
        let near =
            |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-9 * expected.abs();
        assert!(near(Some(limits.speed_max_rpm), 180e3) && near(limits.p3_stroke_s, 10.0));
        assert!(near(Some(limits.p3_min_pa), 110e3) && near(Some(limits.p3_max_pa), 400e3));
        assert!(near(limits.t3_max_k, 873.15) && near(limits.t2_max_k, 473.15));
        assert!(near(limits.surge_margin_min_ratio, -0.05) && near(limits.housing_gradient_max_k, 30.0));
        assert!(near(limits.overshoot_max_ratio, 0.03));
        let range = |from_rpm, to_rpm, longest_s| AvoidedRange { from_rpm, to_rpm, longest_s };
        let avoid: Vec<_> = limits.avoid.iter().collect();
        assert_eq!(avoid, [range(88e3, 92e3, AvoidedRange::LONGEST_S), range(40e3, 41e3, 5.0)]);
        assert!(near(limits.p3_slew_max_pa_s(), 29e3), "290 kPa in 10 s");
    }
}
