//! Gas mixtures: heat capacity, enthalpy and entropy as functions of temperature and pressure.
//!
//! The heat capacity of the ideal gas is a polynomial in temperature; the dependence on pressure is the second virial coefficient, by
//! Tsonopoulos (AIChE J. 20, 1974), with the mixing rules of Prausnitz without binary parameters, and fitted for water vapour. For pressure ratios
//! up to 5 from 100 kPa efficiencies are within 0.02 points, and specific works within 0.05 %, of CoolProp's real gases and moist air
//! (`tests/tests/all/gases.rs`). Pure gases from 253 to 323 K: N2, O2, Ar 0.03 points and 0.04 %, H2, CO2, CH4 0.06 and 0.07 %.

use super::species::{Species, SpeciesData};
use serde::{Deserialize, Serialize};

/// Molar gas constant, J/(mol K) (SI).
pub const MOLAR_GAS_CONSTANT_J_MOLK: f64 = 8.314_462_618;
/// Powers of T/1000 K in a heat capacity.
const HEAT_CAPACITY_TERMS: usize = 7;

/// Second virial coefficient, m3/mol, in the powers 0, 1, 2, 3 and 8 of 1/T, those of Tsonopoulos.
pub type SecondVirial = [f64; 5];

/// Second virial coefficient of water vapour: IAPWS-95 within 1 cm3/mol from 290 to 1400 K (`benches/gas_properties.py`).
const WATER: SecondVirial = [2.2189313e-5, -0.024108941, -4.8790009, -14_339.179, -3.664_435_2e16];
/// Cross coefficient of water vapour with air: Harvey and Huang (Int. J. Thermophys. 28, 2007) within 0.1 cm3/mol (`benches/gas_properties.py`).
/// The mixing rules give three times as much at 335 K.
const WATER_AND_AIR: SecondVirial = [2.658_144e-5, -0.0050084905, -4.9949763, 455.157_88, -5.076_069e13];

/// Second virial coefficients of a gas: its own, and that with water vapour.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Virials {
    /// Coefficient of the gas itself.
    pub own: SecondVirial,
    /// Cross coefficient of the gas with water vapour.
    pub with_vapour: SecondVirial,
}

/// A gas of fixed composition. Domain: 220 to 1400 K, up to 10 bar.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Gas {
    /// Specific gas constant, J/(kg K).
    pub gas_constant_j_kgk: f64,
    /// Isobaric heat capacity at zero pressure, J/(kg K), in powers of T/1000 K.
    pub heat_capacity: [f64; HEAT_CAPACITY_TERMS],
    /// `None`: a perfect gas.
    pub virials: Option<Virials>,
}

/// Fuels whose burnt gas drives a turbine.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fuel {
    /// Hydrogen atoms per carbon atom; infinite for hydrogen.
    pub hydrogen_carbon_ratio: f64,
}

impl Fuel {
    /// Hydrogen.
    pub const HYDROGEN: Fuel = Fuel { hydrogen_carbon_ratio: f64::INFINITY };
    /// Natural gas (40 CFR 1065.655, table 2).
    pub const NATURAL_GAS: Fuel = Fuel { hydrogen_carbon_ratio: 3.78 };
    /// Diesel fuel and kerosene (40 CFR 1065.655, table 2).
    pub const DIESEL: Fuel = Fuel { hydrogen_carbon_ratio: 1.80 };
}

impl Gas {
    /// Dry air of the closed form `cp = 1002.5 + 275e-6 (T - 200)^2` J/(kg K), used by the virtual laboratory and the paper's model: a
    /// perfect gas.
    pub const CLOSED_FORM_AIR: Gas = Gas {
        gas_constant_j_kgk: 287.05,
        heat_capacity: [1013.5, -110.0, 275.0, 0.0, 0.0, 0.0, 0.0],
        virials: None,
    };

    /// Specific gas constant of [`Gas::air`], J/(kg K).
    pub const AIR_GAS_CONSTANT_J_KGK: f64 = 287.039038;

    /// Mole fractions of dry air (ISO 2533, with the carbon dioxide of 2020).
    const AIR: [(Species, f64); 4] =
        [(Species::N2, 0.780_84), (Species::O2, 0.209_39), (Species::Ar, 0.009_34), (Species::CO2, 0.000_43)];

    /// Dry air as a real gas.
    pub fn air() -> Gas {
        Gas::of_mole_fractions(Gas::AIR)
    }

    /// A mixture. The fractions are scaled to a sum of 1; they must not be negative, and one must be above 0.
    ///
    /// ```
    /// use mapper_physics::gas::{mixture::Gas, species::Species};
    /// let nitrogen = Gas::of_mole_fractions([(Species::N2, 1.0)]);
    /// // CoolProp 6: 1.0396 kJ/(kg K) at 300 K, at zero pressure.
    /// assert!((nitrogen.heat_capacity_j_kgk(300.0) / 1039.6 - 1.0).abs() < 5e-4);
    /// ```
    pub fn of_mole_fractions(fractions: impl IntoIterator<Item = (Species, f64)>) -> Gas {
        let parts: Vec<(Species, f64)> = fractions.into_iter().collect();
        let total: f64 = parts.iter().map(|(_, fraction)| fraction).sum();
        let mole_mean = |of: &dyn Fn(Species) -> f64| {
            parts.iter().map(|(species, x)| x * of(*species)).sum::<f64>() / total
        };
        let gas_constant_j_kgk =
            MOLAR_GAS_CONSTANT_J_MOLK / mole_mean(&|species| species.data().molar_mass_kg_mol);
        let with = |other: Species| -> SecondVirial {
            std::array::from_fn(|term| mole_mean(&|species| cross_virial(species, other)[term]))
        };
        let own = std::array::from_fn(|term| mole_mean(&|species| with(species)[term]));
        Gas {
            gas_constant_j_kgk,
            heat_capacity: std::array::from_fn(|power| {
                gas_constant_j_kgk * mole_mean(&|species| species.data().heat_capacity[power])
            }),
            virials: Some(Virials { own, with_vapour: with(Species::H2O) }),
        }
    }

    /// Water vapour.
    pub fn vapour() -> Gas {
        Gas::of_mole_fractions([(Species::H2O, 1.0)])
    }

    /// Products of complete combustion of a fuel in dry air. `air_ratio` is the actual over the stoichiometric amount of air, at least 1.
    pub fn burnt(fuel: Fuel, air_ratio: f64) -> Gas {
        // Per mole of oxygen in the air: carbon and hydrogen of the fuel take 1/air_ratio of it.
        let carbon_oxygen = 1.0 / (1.0 + 0.25 * fuel.hydrogen_carbon_ratio);
        let burnt = 1.0 / air_ratio;
        let air = Gas::AIR.map(|(species, x)| {
            let x = x / Gas::AIR[1].1;
            match species {
                Species::O2 => (species, x * (1.0 - burnt)),
                Species::CO2 => (species, x + carbon_oxygen * burnt),
                _ => (species, x),
            }
        });
        Gas::of_mole_fractions(air.into_iter().chain([(Species::H2O, 2.0 * (1.0 - carbon_oxygen) * burnt)]))
    }

    /// Adds water vapour up to this mass fraction of the mixture; a negative fraction removes vapour.
    pub(crate) fn with_vapour(self, mass_ratio: f64) -> Gas {
        let vapour = Species::H2O.data();
        let vapour_j_kgk = MOLAR_GAS_CONSTANT_J_MOLK / vapour.molar_mass_kg_mol;
        let mix = |gas: f64, vapour: f64| gas + mass_ratio * (vapour - gas);
        let gas_constant_j_kgk = mix(self.gas_constant_j_kgk, vapour_j_kgk);
        let x = mass_ratio * vapour_j_kgk / gas_constant_j_kgk;
        Gas {
            gas_constant_j_kgk,
            heat_capacity: std::array::from_fn(|power| {
                mix(self.heat_capacity[power], vapour_j_kgk * vapour.heat_capacity[power])
            }),
            virials: self.virials.map(|Virials { own, with_vapour }| Virials {
                own: std::array::from_fn(|term| {
                    (1.0 - x) * ((1.0 - x) * own[term] + 2.0 * x * with_vapour[term]) + x * x * WATER[term]
                }),
                with_vapour: std::array::from_fn(|term| (1.0 - x) * with_vapour[term] + x * WATER[term]),
            }),
        }
    }

    /// Isobaric heat capacity at zero pressure, J/(kg K).
    #[inline]
    pub fn heat_capacity_j_kgk(&self, temperature_k: f64) -> f64 {
        let t = 1e-3 * temperature_k;
        self.heat_capacity.iter().rev().fold(0.0, |sum, coefficient| sum * t + coefficient)
    }

    /// Rise of specific enthalpy between two temperatures at zero pressure, J/kg.
    #[inline]
    pub(crate) fn ideal_enthalpy_rise_j_kg(&self, from_k: f64, to_k: f64) -> f64 {
        let at = |temperature_k: f64| {
            let t = 1e-3 * temperature_k;
            let mean = (0..HEAT_CAPACITY_TERMS)
                .rev()
                .fold(0.0, |sum, power| sum * t + self.heat_capacity[power] * INVERSE[power + 1]);
            temperature_k * mean
        };
        at(to_k) - at(from_k)
    }

    /// `int cp/T dT` at zero pressure between two temperatures whose ratio has the logarithm `ln_ratio`, J/(kg K).
    #[inline]
    pub(crate) fn ideal_entropy_rise_j_kgk(&self, from_k: f64, to_k: f64, ln_ratio: f64) -> f64 {
        let at = |temperature_k: f64| {
            let t = 1e-3 * temperature_k;
            (1..HEAT_CAPACITY_TERMS)
                .rev()
                .fold(0.0, |sum, power| (sum + self.heat_capacity[power] * INVERSE[power]) * t)
        };
        self.heat_capacity[0] * ln_ratio + at(to_k) - at(from_k)
    }

    /// Departure from the perfect gas at a pressure: enthalpy in J/kg, entropy and heat capacity in J/(kg K).
    #[inline]
    pub(crate) fn departure(&self, temperature_k: f64, pressure_pa: f64) -> Departure {
        let Some(Virials { own: [b0, b1, b2, b3, b8], .. }) = self.virials else {
            return Departure::default();
        };
        let per_kg = pressure_pa * self.gas_constant_j_kgk / MOLAR_GAS_CONSTANT_J_MOLK;
        let x = 1.0 / temperature_k;
        let b8 = b8 * x * (x * x) * (x * x);
        Departure {
            // (B - T dB/dT) p, -dB/dT p and -T d2B/dT2 p.
            enthalpy_j_kg: per_kg * (b0 + x * (2.0 * b1 + x * (3.0 * b2 + x * (4.0 * b3 + 9.0 * b8)))),
            entropy_j_kgk: per_kg * x * x * (b1 + x * (2.0 * b2 + x * (3.0 * b3 + 8.0 * b8))),
            heat_capacity_j_kgk: -per_kg * x * x * (2.0 * b1 + x * (6.0 * b2 + x * (12.0 * b3 + 72.0 * b8))),
        }
    }
}

/// 1/n.
const INVERSE: [f64; HEAT_CAPACITY_TERMS + 1] =
    [0.0, 1.0, 1.0 / 2.0, 1.0 / 3.0, 1.0 / 4.0, 1.0 / 5.0, 1.0 / 6.0, 1.0 / 7.0];

/// Effect of pressure on a real gas, to first order.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Departure {
    pub(crate) enthalpy_j_kg: f64,
    pub(crate) entropy_j_kgk: f64,
    pub(crate) heat_capacity_j_kgk: f64,
}

/// Second virial coefficient of a pair of species. For pairs without fitted coefficients that of Tsonopoulos and Prausnitz, whose term in Tr^-8
/// matters for water only.
fn cross_virial(one: Species, other: Species) -> SecondVirial {
    let in_air = |species: Species| matches!(species, Species::N2 | Species::O2 | Species::Ar);
    match (one, other) {
        (Species::H2O, Species::H2O) => return WATER,
        (Species::H2O, air) | (air, Species::H2O) if in_air(air) => return WATER_AND_AIR,
        _ => {}
    }
    let (one, other) = (&one.data(), &other.data());
    let critical_k = (one.critical_k * other.critical_k).sqrt();
    let volume_m3_mol = (0.5 * (one.critical_m3_mol.cbrt() + other.critical_m3_mol.cbrt())).powi(3);
    let compressibility = |data: &SpeciesData| {
        data.critical_pa * data.critical_m3_mol / (MOLAR_GAS_CONSTANT_J_MOLK * data.critical_k)
    };
    // R Tc/pc.
    let scale_m3_mol = volume_m3_mol / (0.5 * (compressibility(one) + compressibility(other)));
    let acentric_factor = 0.5 * (one.acentric_factor + other.acentric_factor);
    let terms = [
        0.1445 + 0.0637 * acentric_factor,
        -0.330,
        -0.1385 + 0.331 * acentric_factor,
        -0.0121 - 0.423 * acentric_factor,
        0.0,
    ];
    let mut scale = scale_m3_mol;
    terms.map(|term| {
        let coefficient = scale * term;
        scale *= critical_k;
        coefficient
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_constant_of_air_is_that_of_its_composition() {
        assert!((Gas::air().gas_constant_j_kgk - Gas::AIR_GAS_CONSTANT_J_KGK).abs() < 1e-6);
    }
}
