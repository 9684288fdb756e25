//! Energy balance of a turbocharger over a time span, with its uncertainty.

use mapper_core::{Channel, DeclaredUncertainty, Recording};
use mapper_numerics::statistics::mean;
use mapper_physics::gas::air::Air;
use mapper_physics::gas::mixture::Gas;
use std::collections::BTreeMap;

/// Temperature of the first number of [`OIL`], K. Source: the same table.
const OIL_AT_K: f64 = 300.0;

/// A power, W.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Power {
    /// The power, W.
    pub w: f64,
    /// Standard uncertainty, W.
    pub sigma_w: f64,
}

/// Powers and heat flows from the readings of a time span; `None` if a reading is missing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EnergyBalance {
    /// Rise of the enthalpy of the compressor's air: work and heat.
    pub compressor: Option<Power>,
    /// Drop of the enthalpy of the turbine's gas.
    pub turbine: Option<Power>,
    /// Heat to the oil, bearing friction included.
    pub oil: Option<Power>,
    /// Heat to the cooling water.
    pub water: Option<Power>,
    /// Turbine minus compressor, oil and water: heat to the cell and, until the housings have settled, stored heat. It includes oil and water
    /// if they are not measured.
    pub losses: Option<Power>,
}

/// The readings of the balance.
const INPUTS: [Channel; 16] = [
    Channel::CompressorFlow,
    Channel::T1,
    Channel::T2,
    Channel::TurbineFlow,
    Channel::T3,
    Channel::T4,
    Channel::OilFlow,
    Channel::TOil,
    Channel::TOilOut,
    Channel::WaterFlow,
    Channel::TWater,
    Channel::TWaterOut,
    Channel::P1,
    Channel::P2,
    Channel::P3,
    Channel::P4,
];

/// Heat capacity of engine oil at 300 K, J/(kg K), and its rise, J/(kg K2). Source: Incropera, Fundamentals of Heat and Mass Transfer,
/// table A.5.
const OIL: (f64, f64) = (1909.0, 4.2);
/// Standard uncertainty of the heat capacity of oil, ratio. Bound: different oils differ by some percent.
const OIL_RATIO: f64 = 0.03;
/// Heat capacity of water, J/(kg K). Source: 4178 at 310 K to 4217 at 373 K (the same book, table A.6).
const WATER_J_KGK: f64 = 4190.0;
/// Step of the numerical derivatives, ratio of the standard uncertainty. Bound: the balances are nearly linear over it.
const STEP_RATIO: f64 = 0.1;

/// The gases of compressor and turbine.
#[derive(Debug, Clone, Copy)]
pub struct Gases {
    /// Gas of the compressor.
    pub compressor: Air,
    /// Gas of the turbine.
    pub turbine: Gas,
}

/// The balance of the means over a time span. `declared`: standard uncertainties of the sensors.
pub fn energy_balance(
    recording: &Recording,
    span_s: (f64, f64),
    gases: &Gases,
    declared: &BTreeMap<Channel, DeclaredUncertainty>,
) -> EnergyBalance {
    let mut readings = [f64::NAN; INPUTS.len()];
    let mut sigmas = [0.0; INPUTS.len()];
    for (place, channel) in INPUTS.into_iter().enumerate() {
        let Some(series) = recording.series.get(&channel) else { continue };
        let values = series.slice(span_s.0, span_s.1).1;
        let Some(reading) = mean(values) else { continue };
        readings[place] = reading;
        if let Some(declared) = declared.get(&channel) {
            let noise = declared.noise_sigma / (values.len() as f64).sqrt();
            sigmas[place] = noise.hypot(declared.fixed_sigma(channel, reading));
        }
    }
    let powers = powers_w(&readings, gases, 1.0);
    let mut variances = [0.0; POWERS];
    let mut add_variance = |shifted: [f64; POWERS]| {
        for ((variance, shifted), power) in variances.iter_mut().zip(shifted).zip(powers) {
            *variance += ((shifted - power) / STEP_RATIO).powi(2);
        }
    };
    for (place, sigma) in sigmas.into_iter().enumerate() {
        let mut shifted = readings;
        shifted[place] += STEP_RATIO * sigma;
        add_variance(powers_w(&shifted, gases, 1.0));
    }
    add_variance(powers_w(&readings, gases, 1.0 + STEP_RATIO * OIL_RATIO));
    let power = |place: usize| {
        let (w, variance): (f64, f64) = (powers[place], variances[place]);
        (w.is_finite()).then(|| Power { w, sigma_w: variance.sqrt() })
    };
    EnergyBalance {
        compressor: power(0),
        turbine: power(1),
        oil: power(2),
        water: power(3),
        losses: power(4),
    }
}

/// Number of powers. Source: definition.
const POWERS: usize = 5;

/// The powers of compressor, turbine, oil, water, losses, W; NaN if a reading is missing.
fn powers_w(readings: &[f64; INPUTS.len()], gases: &Gases, oil_ratio: f64) -> [f64; POWERS] {
    let &[
        m_c,
        t1_k,
        t2_k,
        m_t,
        t3_k,
        t4_k,
        m_oil,
        oil_k,
        oil_out_k,
        m_water,
        water_k,
        water_out_k,
        p1_pa,
        p2_pa,
        p3_pa,
        p4_pa,
    ] = readings;
    // Without pressures: an ideal gas, 0.07 % off at a pressure ratio of 5.
    let at = |gas: Air, from_pa: f64, to_pa: f64| {
        if (from_pa + to_pa).is_finite() { gas.between(from_pa, to_pa) } else { gas }
    };
    let compressor = m_c * at(gases.compressor, p1_pa, p2_pa).enthalpy_rise_j_kg(t1_k, t2_k);
    let turbine = m_t * at(Air::new(gases.turbine, 0.0), p4_pa, p3_pa).enthalpy_rise_j_kg(t4_k, t3_k);
    let (at_300_k, rise) = OIL;
    let oil_j_kgk = oil_ratio * (at_300_k + rise * (0.5 * (oil_k + oil_out_k) - OIL_AT_K));
    let oil = m_oil * oil_j_kgk * (oil_out_k - oil_k);
    let water = m_water * WATER_J_KGK * (water_out_k - water_k);
    let zero_if_missing = |heat: f64| if heat.is_finite() { heat } else { 0.0 };
    [compressor, turbine, oil, water, turbine - compressor - zero_if_missing(oil) - zero_if_missing(water)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use mapper_core::Series;

    /// 151.670 kJ/kg from 300 K, 100 kPa to 450 K, 300 kPa (CoolProp 7, `PropsSI`, air); an ideal gas is 1.6e-4 off.
    #[test]
    fn enthalpies_are_those_of_the_real_gas() {
        let readings = [
            (Channel::CompressorFlow, 0.1),
            (Channel::T1, 300.0),
            (Channel::T2, 450.0),
            (Channel::P1, 100e3),
            (Channel::P2, 300e3),
        ];
        let gases = Gases { compressor: Air::new(Gas::air(), 0.0), turbine: Gas::CLOSED_FORM_AIR };
        let balance = energy_balance(&recording(&readings), (0.0, 1.0), &gases, &BTreeMap::new());
        assert!((balance.compressor.unwrap().w / 15_167.05 - 1.0).abs() < 1e-4);
    }

    fn recording(readings: &[(Channel, f64)]) -> Recording {
        let mut recording = Recording::default();
        for (channel, value) in readings {
            let series = Series { t_s: vec![0.0, 1.0], values: vec![*value; 2] };
            recording.series.insert(*channel, series);
        }
        recording
    }

    /// Enthalpies of air by Keenan and Kaye (Cengel and Boles, table A-17): 300.19 and 400.98 kJ/kg at 300 and 400 K, 821.95 and 713.27 kJ/kg
    /// at 800 and 700 K; the closed form follows the heat capacity within 1 %.
    #[test]
    fn powers_are_those_of_the_tables() {
        let mut readings = vec![
            (Channel::CompressorFlow, 0.1),
            (Channel::T1, 300.0),
            (Channel::T2, 400.0),
            (Channel::TurbineFlow, 0.1),
            (Channel::T3, 800.0),
            (Channel::T4, 700.0),
        ];
        let declared = BTreeMap::from([(
            Channel::T2,
            DeclaredUncertainty { offset_sigma: 1.0, ..DeclaredUncertainty::default() },
        )]);
        let balance = |readings: &[(Channel, f64)]| {
            let gases = Gases { compressor: Air::DRY, turbine: Gas::CLOSED_FORM_AIR };
            energy_balance(&recording(readings), (0.0, 1.0), &gases, &declared)
        };
        let gas = balance(&readings);
        let (compressor, turbine) = (gas.compressor.unwrap(), gas.turbine.unwrap());
        assert!((compressor.w / 10_079.0 - 1.0).abs() < 0.01, "{compressor:?}");
        assert!((turbine.w / 10_868.0 - 1.0).abs() < 0.01, "{turbine:?}");
        // A kelvin of T2 is m cp.
        assert!((compressor.sigma_w / 101.4 - 1.0).abs() < 0.01 && turbine.sigma_w == 0.0);
        assert_eq!((gas.oil, gas.water), (None, None));
        let losses = gas.losses.unwrap();
        assert!((losses.w - (turbine.w - compressor.w)).abs() < 1e-9);
        assert!((losses.sigma_w - compressor.sigma_w).abs() < 1e-6);

        // 0.02 kg/s of oil from 360 to 370 K take 2.18 kJ/(kg K); the losses fall by this.
        readings.extend([(Channel::OilFlow, 0.02), (Channel::TOil, 360.0), (Channel::TOilOut, 370.0)]);
        let with_oil = balance(&readings);
        let oil = with_oil.oil.unwrap();
        assert!((oil.w / 436.0 - 1.0).abs() < 0.01 && (oil.sigma_w / oil.w - OIL_RATIO).abs() < 1e-6);
        assert!((losses.w - with_oil.losses.unwrap().w - oil.w).abs() < 1e-9);

        readings.retain(|(channel, _)| *channel != Channel::T4);
        let without = balance(&readings);
        assert!(without.turbine.is_none() && without.losses.is_none() && without.compressor.is_some());
    }
}
