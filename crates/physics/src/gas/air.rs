//! Air, dry and moist: gas constant, heat capacity, viscosity, conductivity.
//!
//! Closed forms of the virtual laboratory, in place of the tables of the paper's reference 12. Domain: 250 to 800 K, at
//! pressures of a few bar, where air is a perfect gas. Relative to tabulated dry air the heat capacity is within 1 %, the
//! viscosity within 2 %, the conductivity within 5 % up to 700 K and 7 % at 800 K. Values outside are not clipped.

use mapper_core::EfficiencyDefinition;
use serde::{Deserialize, Serialize};

/// Specific gas constant of dry air, J/(kg K).
pub const GAS_CONSTANT_J_KGK: f64 = 287.05;

/// Ratio of specific heats used where the paper's model holds it constant (orifice, filling of the volume).
pub const HEAT_CAPACITY_RATIO: f64 = 1.4;

/// Isobaric heat capacity `1002.5 + 275e-6 (T - 200)^2`, J/(kg K), for 200..800 K.
#[inline]
pub fn heat_capacity_j_kgk(temperature_k: f64) -> f64 {
    let (at_zero, curvature, zero_k) = CP;
    let above_k = temperature_k - zero_k;
    at_zero + curvature * above_k * above_k
}

/// Dynamic viscosity, Pa s (Sutherland: `1.458e-6 T^1.5 / (T + 110.4)`).
#[inline]
pub fn viscosity_pa_s(temperature_k: f64) -> f64 {
    1.458e-6 * temperature_k * temperature_k.sqrt() / (temperature_k + 110.4)
}

/// Thermal conductivity at 300 K, W/(m K).
pub const CONDUCTIVITY_AT_300_K_W_MK: f64 = 0.02624;

/// Thermal conductivity `0.02624 (T/300)^0.8646`, W/(m K).
#[inline]
pub fn conductivity_w_mk(temperature_k: f64) -> f64 {
    CONDUCTIVITY_AT_300_K_W_MK * ln_conductivity_ratio(temperature_k).exp()
}

/// ln of the thermal conductivity over that at 300 K.
#[inline]
pub fn ln_conductivity_ratio(temperature_k: f64) -> f64 {
    0.8646 * (temperature_k / 300.0).ln()
}

/// Exponent `kappa = R/cp(T)` of the isentropic temperature ratio `PR^kappa`.
#[inline]
pub fn isentropic_exponent(temperature_k: f64) -> f64 {
    GAS_CONSTANT_J_KGK / heat_capacity_j_kgk(temperature_k)
}

/// Air in the cell, an ideal gas with a heat capacity that depends on temperature: viscosity and conductivity are those of dry air (40 g/kg lower them by 2.5 % and 1 %).
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Air {
    /// Water per dry air, kg/kg, 0 to about 0.06.
    pub humidity_kg_kg: f64,
    /// Definition of the efficiency of its compression.
    pub efficiency: EfficiencyDefinition,
}

impl Air {
    /// Dry air.
    pub const DRY: Air = Air { humidity_kg_kg: 0.0, efficiency: EfficiencyDefinition::Enthalpy };
    /// Dry air with the efficiency of the paper's eq. 2.
    pub const PAPER: Air = Air { humidity_kg_kg: 0.0, efficiency: EfficiencyDefinition::KappaOfT1 };

    /// From relative humidity (0..1), temperature (-20 to 50 degC) and pressure, Pa. The pressure of saturated vapour is that of Buck
    /// (Buck Research CR-1A manual, 1996), enhanced by 0.4 % in air.
    ///
    /// ```
    /// use mapper_physics::gas::air::Air;
    /// let air = Air::of_relative_humidity(0.5, 298.15, 101_325.0);
    /// assert!((air.humidity_kg_kg - 0.00993).abs() < 5e-5);
    /// ```
    pub fn of_relative_humidity(relative_ratio: f64, temperature_k: f64, pressure_pa: f64) -> Air {
        let t_c = temperature_k - 273.15;
        let (a, b, c, at_0_pa) =
            if t_c < 0.0 { (23.036, 333.7, 279.82, 611.15) } else { (18.678, 234.5, 257.14, 611.21) };
        let saturated_pa = 1.004 * at_0_pa * ((a - t_c / b) * t_c / (c + t_c)).exp();
        let vapour_pa = (relative_ratio * saturated_pa).min(0.5 * pressure_pa);
        Air { humidity_kg_kg: VAPOUR_MASS_RATIO * vapour_pa / (pressure_pa - vapour_pa), ..Air::DRY }
    }

    /// Specific gas constant, J/(kg K).
    #[inline]
    pub fn gas_constant_j_kgk(self) -> f64 {
        moist_gas_constant_j_kgk(self.humidity_kg_kg)
    }

    /// Isobaric heat capacity, J/(kg K).
    #[inline]
    pub fn heat_capacity_j_kgk(self, temperature_k: f64) -> f64 {
        moist_heat_capacity_ratio(self.humidity_kg_kg) * heat_capacity_j_kgk(temperature_k)
    }

    /// Rise of specific enthalpy from one temperature to another, J/kg.
    #[inline]
    pub fn enthalpy_rise_j_kg(self, from_k: f64, to_k: f64) -> f64 {
        moist_heat_capacity_ratio(self.humidity_kg_kg)
            * mean_heat_capacity_j_kgk(from_k, to_k)
            * (to_k - from_k)
    }

    /// Temperature after a rise of specific enthalpy from `from_k`, K: the inverse of [`Air::enthalpy_rise_j_kg`].
    #[inline]
    pub fn heated_k(self, from_k: f64, rise_j_kg: f64) -> f64 {
        let dry_j_kg = rise_j_kg / moist_heat_capacity_ratio(self.humidity_kg_kg);
        let mut to_k = from_k + dry_j_kg / heat_capacity_j_kgk(from_k);
        // Newton: after a rise of 200 K the start is 3 K off, the first step 5e-4 K, the second 1e-11 K.
        for _ in 0..2 {
            let missing_j_kg = dry_j_kg - mean_heat_capacity_j_kgk(from_k, to_k) * (to_k - from_k);
            to_k += missing_j_kg / heat_capacity_j_kgk(to_k);
        }
        to_k
    }

    /// Temperature after isentropic compression from `from_k`, K: `s(T2s) - s(T1) = R ln PR`.
    #[inline]
    pub fn isentropic_k(self, from_k: f64, pressure_ratio: f64) -> f64 {
        let ln_pressure_ratio = pressure_ratio.ln();
        let gas_constant_j_kgk = self.gas_constant_j_kgk() / moist_heat_capacity_ratio(self.humidity_kg_kg);
        let mut ln_ratio = gas_constant_j_kgk / heat_capacity_j_kgk(from_k) * ln_pressure_ratio;
        let mut to_k = from_k * ln_ratio.exp();
        // Newton in ln T: at a pressure ratio of 4 the start is 3e-3 off, the first step 1e-6, the second 1e-13. The exponential of so
        // small a step is its series to third order.
        for _ in 0..2 {
            let missing_j_kgk =
                gas_constant_j_kgk * ln_pressure_ratio - entropy_rise_j_kgk(from_k, to_k, ln_ratio);
            let step = missing_j_kgk / heat_capacity_j_kgk(to_k);
            ln_ratio += step;
            to_k *= 1.0 + step * (1.0 + step * (0.5 + step / 6.0));
        }
        to_k
    }

    /// Exponent `kappa = R/cp(T)` of the isentropic temperature ratio `PR^kappa`.
    #[inline]
    pub fn isentropic_exponent(self, temperature_k: f64) -> f64 {
        self.gas_constant_j_kgk() / self.heat_capacity_j_kgk(temperature_k)
    }

    /// Flow of dry air at the same Mach numbers over the flow of this air: `sqrt(R/R_dry)`. Corrected flows are those of dry air.
    #[inline]
    pub fn dry_flow_ratio(self) -> f64 {
        (self.gas_constant_j_kgk() / GAS_CONSTANT_J_KGK).sqrt()
    }
}

/// Coefficients of [`heat_capacity_j_kgk`]: J/(kg K), J/(kg K3), K.
const CP: (f64, f64, f64) = (1002.5, 275e-6, 200.0);

/// Mean heat capacity of dry air between two temperatures, J/(kg K).
#[inline]
fn mean_heat_capacity_j_kgk(from_k: f64, to_k: f64) -> f64 {
    let (at_zero, curvature, zero_k) = CP;
    let (a, b) = (from_k - zero_k, to_k - zero_k);
    at_zero + curvature / 3.0 * (a * a + a * b + b * b)
}

/// `int cp/T dT` of dry air between two temperatures whose ratio has the logarithm `ln_ratio`, J/(kg K).
#[inline]
fn entropy_rise_j_kgk(from_k: f64, to_k: f64, ln_ratio: f64) -> f64 {
    let (at_zero, curvature, zero_k) = CP;
    (at_zero + curvature * zero_k * zero_k) * ln_ratio
        + curvature * (to_k - from_k) * (0.5 * (to_k + from_k) - 2.0 * zero_k)
}

/// Molar mass of water over that of dry air.
const VAPOUR_MASS_RATIO: f64 = 0.62198;

/// Gas constant of vapour over that of dry air, minus 1.
const VAPOUR_GAS_CONSTANT_EXCESS: f64 = 1.0 / VAPOUR_MASS_RATIO - 1.0;
/// Heat capacity of vapour over that of dry air, minus 1: 0.855 at 300 K to 0.886 at 450 K (IAPWS-95 and Lemmon et al. 2000, ideal gas).
const VAPOUR_HEAT_CAPACITY_EXCESS: f64 = 0.865;

/// Gas constant of air with `humidity_kg_kg` of water per dry air, J/(kg K).
#[inline]
pub fn moist_gas_constant_j_kgk(humidity_kg_kg: f64) -> f64 {
    GAS_CONSTANT_J_KGK * (1.0 + VAPOUR_GAS_CONSTANT_EXCESS * humidity_kg_kg / (1.0 + humidity_kg_kg))
}

/// Heat capacity of air with `humidity_kg_kg` of water per dry air over that of dry air.
#[inline]
pub fn moist_heat_capacity_ratio(humidity_kg_kg: f64) -> f64 {
    1.0 + VAPOUR_HEAT_CAPACITY_EXCESS * humidity_kg_kg / (1.0 + humidity_kg_kg)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Tabulated dry air at 1 atm (Incropera, Fundamentals of Heat and Mass Transfer, table A.4). The closed forms
    /// are simple on purpose: they follow the table within 1 % (cp), 2 % (mu) and 5 % (k).
    #[test]
    fn properties_follow_the_tables() {
        for (t_k, cp, mu, k) in [
            (300.0, 1007.0, 184.6e-7, 26.3e-3),
            (400.0, 1014.0, 230.1e-7, 33.8e-3),
            (500.0, 1030.0, 270.1e-7, 40.7e-3),
            (700.0, 1075.0, 338.8e-7, 52.4e-3),
        ] {
            assert!((heat_capacity_j_kgk(t_k) / cp - 1.0).abs() < 0.01, "cp at {t_k} K");
            assert!((viscosity_pa_s(t_k) / mu - 1.0).abs() < 0.02, "mu at {t_k} K");
            assert!((conductivity_w_mk(t_k) / k - 1.0).abs() < 0.05, "k at {t_k} K");
        }
        // The upper end of the domain, same table.
        assert!((heat_capacity_j_kgk(800.0) / 1099.0 - 1.0).abs() < 0.01);
        assert!((viscosity_pa_s(800.0) / 369.8e-7 - 1.0).abs() < 0.025);
        assert!((conductivity_w_mk(800.0) / 57.3e-3 - 1.0).abs() < 0.07);
    }

    /// Humidity ratios of CoolProp 6 (`HAPropsSI('W', ...)`), which models real vapour: within 0.5 %.
    #[test]
    fn relative_humidity_is_that_of_coolprop() {
        for (t_k, p_pa, relative, expected) in [
            (298.15, 101_325.0, 0.5, 0.009_925_74),
            (308.15, 101_325.0, 0.8, 0.029_064_5),
            (273.15, 100e3, 0.9, 0.003_454_21),
            (253.15, 100e3, 0.5, 0.000_322_682),
            (318.15, 95e3, 0.3, 0.019_530_7),
        ] {
            let found = Air::of_relative_humidity(relative, t_k, p_pa).humidity_kg_kg;
            assert!((found / expected - 1.0).abs() < 5e-3, "{found} at {t_k} K");
        }
    }

    /// Ideal gas mixtures of CoolProp 6 (`PropsSI('Cp0mass', ...)` of air and water, molar masses 28.9586 and 18.0153 g/mol).
    #[test]
    fn moist_air_is_the_mixture() {
        for (w, t_k, gas_constant, cp) in [
            (0.02, 300.0, 290.535, 1021.64),
            (0.04, 300.0, 293.823, 1037.86),
            (0.04, 450.0, 293.823, 1055.37),
        ] {
            let air = Air { humidity_kg_kg: w, ..Air::DRY };
            assert!((air.gas_constant_j_kgk() / gas_constant - 1.0).abs() < 5e-4);
            // The heat capacity of dry air is within 8e-4 over this range, that of 4 % of vapour within 2 %.
            assert!((air.heat_capacity_j_kgk(t_k) / cp - 1.0).abs() < 2e-3);
        }
    }

    proptest! {
        /// The two inverses, and the entropy of an isentrope, to rounding.
        #[test]
        fn enthalpy_and_entropy_are_consistent(
            t_k in 250.0..330.0f64, ratio in 0.9..6.0f64, rise_j_kg in -20e3..250e3f64, w in 0.0..0.04f64,
        ) {
            let air = Air { humidity_kg_kg: w, ..Air::DRY };
            let heated_k = air.heated_k(t_k, rise_j_kg);
            prop_assert!((air.enthalpy_rise_j_kg(t_k, heated_k) - rise_j_kg).abs() < 1e-4);
            let end_k = air.isentropic_k(t_k, ratio);
            // Back along the same isentrope. From 550 K the start is 2 % off, the second step of Newton's method 1e-9.
            prop_assert!((air.isentropic_k(end_k, 1.0 / ratio) / t_k - 1.0).abs() < 1e-8);
            // dh = v dp: Simpson's rule over ln p in 2000 parts.
            let part = ratio.ln() / 2000.0;
            let work_j_kg: f64 = (0..2000)
                .map(|i| {
                    let v_dp = |x: f64| air.gas_constant_j_kgk() * air.isentropic_k(t_k, (part * x).exp());
                    let x = f64::from(i);
                    part / 6.0 * (v_dp(x) + 4.0 * v_dp(x + 0.5) + v_dp(x + 1.0))
                })
                .sum();
            prop_assert!((work_j_kg - air.enthalpy_rise_j_kg(t_k, end_k)).abs() < 1e-6 * (1.0 + work_j_kg.abs()));
        }
    }
}
