//! The gas of the compressor, dry or moist, and closed forms for dry air: heat capacity, viscosity, conductivity.
//!
//! The closed forms are those of the virtual laboratory, in place of the tables of the paper's reference 12. Domain: 250 to 800 K, at
//! pressures of a few bar, where air is a perfect gas. Relative to tabulated dry air the heat capacity is within 1 %, the
//! viscosity within 2 %, the conductivity within 5 % up to 700 K and 7 % at 800 K. Values outside are not clipped.

use super::mixture::Gas;
use mapper_core::EfficiencyDefinition;
use serde::{Deserialize, Serialize};

/// `base^exponent` for `base` > 0, to a few bits for the exponents of correlations. The library function is exact to the last bit and takes
/// twice as long.
#[inline]
pub(crate) fn power(base: f64, exponent: f64) -> f64 {
    (exponent * base.ln()).exp()
}

/// Specific gas constant of dry air, J/(kg K).
pub const GAS_CONSTANT_J_KGK: f64 = Gas::CLOSED_FORM_AIR.gas_constant_j_kgk;

/// Ratio of specific heats in parts of the paper's model with a constant ratio (orifice, filling of the volume).
pub const HEAT_CAPACITY_RATIO: f64 = 1.4;

/// Isobaric heat capacity `1002.5 + 275e-6 (T - 200)^2`, J/(kg K), for 200..800 K.
#[inline]
pub fn heat_capacity_j_kgk(temperature_k: f64) -> f64 {
    let above_k = temperature_k - 200.0;
    1002.5 + 275e-6 * above_k * above_k
}

/// Dynamic viscosity, Pa s (Sutherland: `1.458e-6 T^1.5 / (T + 110.4)`).
#[inline]
pub fn viscosity_pa_s(temperature_k: f64) -> f64 {
    1.458e-6 * temperature_k * temperature_k.sqrt() / (temperature_k + 110.4)
}

/// Thermal conductivity at 300 K, W/(m K).
pub const CONDUCTIVITY_AT_300_K_W_MK: f64 = 0.02624;

/// ln of the thermal conductivity `0.02624 (T/300)^0.8646` W/(m K) over that at 300 K.
#[inline]
pub fn ln_conductivity_ratio(temperature_k: f64) -> f64 {
    0.8646 * (temperature_k / 300.0).ln()
}

/// Gas at the inlet of a compressor: a dry gas with water vapour. Viscosity and conductivity are those of dry air: 40 g/kg change them by -1.6 to -2.7 %
/// and +0.2 to -1.2 % between 300 and 400 K (CoolProp 7, `HAPropsSI`), h by +1.4 % at all temperatures, which a fitted coefficient absorbs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Air {
    /// The dry gas with its vapour.
    gas: Gas,
    /// Water per dry gas, kg/kg.
    humidity_kg_kg: f64,
    /// Definition of the efficiency of its compression.
    pub efficiency: EfficiencyDefinition,
    /// Pressures before and after compression, Pa; 0: a perfect gas.
    pressures_pa: [f64; 2],
}

impl Default for Air {
    fn default() -> Self {
        Air::DRY
    }
}

impl Air {
    /// Dry air of the closed form.
    pub const DRY: Air = Air {
        gas: Gas::CLOSED_FORM_AIR,
        humidity_kg_kg: 0.0,
        efficiency: EfficiencyDefinition::Enthalpy,
        pressures_pa: [0.0; 2],
    };
    /// [`Air::DRY`] with the efficiency of the paper's eq. 2.
    pub const PAPER: Air = Air { efficiency: EfficiencyDefinition::KappaOfT1, ..Air::DRY };

    /// A dry gas with 0 to about 0.06 kg of water per kg, and the efficiency by enthalpy.
    pub fn new(dry: Gas, humidity_kg_kg: f64) -> Air {
        Air { gas: dry, ..Air::DRY }.with_humidity(humidity_kg_kg)
    }

    /// Sets the humidity, kg/kg.
    #[inline]
    #[must_use]
    pub fn with_humidity(self, humidity_kg_kg: f64) -> Air {
        if humidity_kg_kg == self.humidity_kg_kg {
            return self;
        }
        let vapour_ratio = |humidity: f64| humidity / (1.0 + humidity);
        let (old, new) = (vapour_ratio(self.humidity_kg_kg), vapour_ratio(humidity_kg_kg));
        Air { gas: self.gas.with_vapour((new - old) / (1.0 - old)), humidity_kg_kg, ..self }
    }

    /// Sets the definition of the efficiency.
    #[inline]
    #[must_use]
    pub fn with_efficiency(self, efficiency: EfficiencyDefinition) -> Air {
        Air { efficiency, ..self }
    }

    /// Sets the pressures before and after compression, Pa, on which enthalpy and entropy of a real gas depend. Without them the gas is perfect.
    #[inline]
    #[must_use]
    pub fn between(self, from_pa: f64, to_pa: f64) -> Air {
        Air { pressures_pa: [from_pa, to_pa], ..self }
    }

    /// Water per dry gas, kg/kg.
    #[inline]
    pub fn humidity_kg_kg(self) -> f64 {
        self.humidity_kg_kg
    }

    /// Specific gas constant, J/(kg K).
    #[inline]
    pub fn gas_constant_j_kgk(self) -> f64 {
        self.gas.gas_constant_j_kgk
    }

    /// Isobaric heat capacity at zero pressure, J/(kg K).
    #[inline]
    pub fn heat_capacity_j_kgk(self, temperature_k: f64) -> f64 {
        self.gas.heat_capacity_j_kgk(temperature_k)
    }

    /// Rise of specific enthalpy from one temperature to another, J/kg.
    #[inline]
    pub fn enthalpy_rise_j_kg(self, from_k: f64, to_k: f64) -> f64 {
        let [from_pa, to_pa] = self.pressures_pa;
        self.gas.ideal_enthalpy_rise_j_kg(from_k, to_k) + self.gas.departure(to_k, to_pa).enthalpy_j_kg
            - self.gas.departure(from_k, from_pa).enthalpy_j_kg
    }

    /// Temperature after a rise of specific enthalpy from `from_k`, K: the inverse of [`Air::enthalpy_rise_j_kg`].
    #[inline]
    pub fn heated_k(self, from_k: f64, rise_j_kg: f64) -> f64 {
        let to_pa = self.pressures_pa[1];
        let mut to_k = from_k + rise_j_kg / self.heat_capacity_j_kgk(from_k);
        // Newton's method: for a rise of 200 K the error of the start is 3 K, after the first step 5e-4 K, after the second 1e-11 K.
        for _ in 0..2 {
            let residual_j_kg = rise_j_kg - self.enthalpy_rise_j_kg(from_k, to_k);
            to_k += residual_j_kg
                / (self.heat_capacity_j_kgk(to_k) + self.gas.departure(to_k, to_pa).heat_capacity_j_kgk);
        }
        to_k
    }

    /// Temperature after isentropic compression from `from_k`, K: `s(T2s, p2) = s(T1, p1)`.
    #[inline]
    pub fn isentropic_k(self, from_k: f64, pressure_ratio: f64) -> f64 {
        let [from_pa, to_pa] = self.pressures_pa;
        let gas_constant_j_kgk = self.gas.gas_constant_j_kgk;
        let entropy_drop_j_kgk = gas_constant_j_kgk * pressure_ratio.ln();
        let start = self.gas.departure(from_k, from_pa);
        let mut ln_ratio = entropy_drop_j_kgk / self.heat_capacity_j_kgk(from_k);
        let mut to_k = from_k * ln_ratio.exp();
        // Newton's method in ln T: at a pressure ratio of 4 the error of the start is 3e-3, after the first step 1e-6, after the second 1e-13.
        // The exponential of such a small step is its series to third order.
        for _ in 0..2 {
            let end = self.gas.departure(to_k, to_pa);
            let residual_j_kgk = entropy_drop_j_kgk
                - self.gas.ideal_entropy_rise_j_kgk(from_k, to_k, ln_ratio)
                - (end.entropy_j_kgk - start.entropy_j_kgk);
            let step = residual_j_kgk / (self.heat_capacity_j_kgk(to_k) + end.heat_capacity_j_kgk);
            ln_ratio += step;
            to_k *= 1.0 + step * (1.0 + step * (0.5 + step / 6.0));
        }
        to_k
    }

    /// Description of the gas for a report.
    pub fn description(self) -> String {
        let dry = self.with_humidity(0.0).gas;
        let same = |other: Gas| (dry.gas_constant_j_kgk / other.gas_constant_j_kgk - 1.0).abs() < 1e-9;
        let dry = match dry.virials {
            None => "air".to_owned(),
            Some(_) if same(Gas::air()) => "air as a real gas".to_owned(),
            Some(_) => format!("a mixture with R = {:.2} J/(kg K)", dry.gas_constant_j_kgk),
        };
        match self.humidity_kg_kg {
            0.0 => format!("{dry}, taken as dry"),
            water => format!("{dry}, {:.1} g of water per kg of dry gas", 1e3 * water),
        }
    }

    /// Exponent `kappa = R/cp(T)` of the isentropic temperature ratio `PR^kappa`.
    #[inline]
    pub fn isentropic_exponent(self, temperature_k: f64) -> f64 {
        self.gas_constant_j_kgk() / self.heat_capacity_j_kgk(temperature_k)
    }

    /// Flow of dry air at the same Mach numbers, over the flow of this gas: `sqrt(R/R_dry)`. Dry air is real or of the closed form like this
    /// gas. Corrected flows are those of dry air.
    #[inline]
    pub fn dry_flow_ratio(self) -> f64 {
        let dry_j_kgk =
            if self.gas.virials.is_some() { Gas::AIR_GAS_CONSTANT_J_KGK } else { GAS_CONSTANT_J_KGK };
        (self.gas_constant_j_kgk() / dry_j_kgk).sqrt()
    }

    /// h of this gas over that of dry air at the same flow: the root of the Prandtl number.
    #[inline]
    pub fn h_ratio(self, temperature_k: f64) -> f64 {
        (self.heat_capacity_j_kgk(temperature_k) / heat_capacity_j_kgk(temperature_k)).cbrt()
    }
}

/// Molar mass of water over that of dry air.
const VAPOUR_MASS_RATIO: f64 = 0.62198;

/// Water per dry gas, kg/kg, of a relative humidity (0..1) at a temperature (-20 to 50 degC) and a pressure, Pa. The pressure of saturated
/// vapour is that of Buck (Buck Research CR-1A manual, 1996), enhanced by 0.4 % in air.
///
/// ```
/// use mapper_physics::gas::air::humidity_kg_kg;
/// assert!((humidity_kg_kg(0.5, 298.15, 101_325.0) - 0.00993).abs() < 5e-5);
/// ```
pub fn humidity_kg_kg(relative_ratio: f64, temperature_k: f64, pressure_pa: f64) -> f64 {
    let t_c = temperature_k - 273.15;
    let (a, b, c, at_0_pa) =
        if t_c < 0.0 { (23.036, 333.7, 279.82, 611.15) } else { (18.678, 234.5, 257.14, 611.21) };
    let saturated_pa = 1.004 * at_0_pa * ((a - t_c / b) * t_c / (c + t_c)).exp();
    let vapour_pa = (relative_ratio * saturated_pa).min(0.5 * pressure_pa);
    VAPOUR_MASS_RATIO * vapour_pa / (pressure_pa - vapour_pa)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn it_is_the_librarys(base in 1e-6..10.0f64, exponent in -3.0..3.0f64) {
            // The logarithm's rounding error, times an exponent of 40 at most, appears in the result.
            prop_assert!((power(base, exponent) / base.powf(exponent) - 1.0).abs() < 1e-14);
        }
    }

    /// Tabulated dry air at 1 atm (Incropera, Fundamentals of Heat and Mass Transfer, table A.4). The closed forms
    /// are simple on purpose: they follow the table within 1 % (cp), 2 % (mu) and 5 % (k).
    #[test]
    fn properties_follow_the_tables() {
        let conductivity_w_mk = |t_k: f64| CONDUCTIVITY_AT_300_K_W_MK * ln_conductivity_ratio(t_k).exp();
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
            let found = humidity_kg_kg(relative, t_k, p_pa);
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
            let air = Air::DRY.with_humidity(w);
            assert!((air.gas_constant_j_kgk() / gas_constant - 1.0).abs() < 5e-4);
            // The heat capacity of dry air is within 8e-4 over this range, that of 4 % of vapour within 2 %.
            assert!((air.heat_capacity_j_kgk(t_k) / cp - 1.0).abs() < 2e-3);
        }
    }

    proptest! {
        /// Monotone; the two inverses, and the entropy of an isentrope, to rounding.
        #[test]
        fn enthalpy_and_entropy_are_consistent(
            t_k in 250.0..330.0f64, ratio in 0.9..6.0f64, rise_j_kg in -20e3..250e3f64, w in 0.0..0.04f64,
        ) {
            let air = Air::DRY.with_humidity(w);
            let heated_k = air.heated_k(t_k, rise_j_kg);
            prop_assert!((air.enthalpy_rise_j_kg(t_k, heated_k) - rise_j_kg).abs() < 1e-4);
            let end_k = air.isentropic_k(t_k, ratio);
            prop_assert!(air.isentropic_k(t_k, 1.001 * ratio) > end_k);
            prop_assert!(air.enthalpy_rise_j_kg(t_k, heated_k + 0.1) > rise_j_kg);
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
