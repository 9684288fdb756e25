//! Gases by their composition: the species and the properties of their mixtures.

use serde::{Deserialize, Serialize};

/// A species of which a gas can consist, by its formula.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[allow(missing_docs)]
pub enum Species {
    N2,
    O2,
    Ar,
    CO2,
    H2O,
    H2,
    CH4,
}

/// Constants of a species.
#[derive(Debug, Clone, Copy)]
pub(crate) struct SpeciesData {
    pub(crate) molar_mass_kg_mol: f64,
    pub(crate) critical_k: f64,
    pub(crate) critical_pa: f64,
    pub(crate) critical_m3_mol: f64,
    /// Pitzer's acentric factor.
    pub(crate) acentric_factor: f64,
    /// Heat capacity of the ideal gas over the molar gas constant, in powers of T/1000 K.
    pub(crate) heat_capacity: [f64; 7],
}

impl Species {
    /// Every species.
    pub const ALL: [Species; 7] =
        [Species::N2, Species::O2, Species::Ar, Species::CO2, Species::H2O, Species::H2, Species::CH4];

    /// Constants of the species. Masses and critical points are those of CoolProp 8.0; the heat capacities are fitted to its ideal-gas parts from 220 to
    /// 1400 K, within 0.16 % below 650 K and 0.35 % above (`benches/gas_properties.py`).
    pub(crate) fn data(self) -> SpeciesData {
        let (molar_mass_kg_mol, critical_k, critical_pa, critical_mol_m3, acentric_factor, heat_capacity) =
            match self {
                Species::N2 => (
                    28.01348e-3,
                    126.192,
                    3.3958e6,
                    11_183.9,
                    0.0372,
                    [3.3528903, 2.015899, -10.269735, 23.922837, -25.398321, 12.828, -2.5185898],
                ),
                Species::O2 => (
                    31.9988e-3,
                    154.5994,
                    5.0464e6,
                    13_342.19,
                    0.0222,
                    [3.9050402, -4.1804647, 14.115761, -16.936762, 9.0775336, -1.7207649, -0.066538744],
                ),
                Species::Ar => {
                    (39.948e-3, 150.687, 4.863e6, 13_407.43, -0.0022, [2.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
                }
                Species::CO2 => (
                    44.0098e-3,
                    304.1282,
                    7.3773e6,
                    10_624.9,
                    0.2239,
                    [2.3246738, 8.8081238, -4.3285288, -6.8998392, 13.031095, -8.3023345, 1.9007141],
                ),
                Species::H2O => (
                    18.015268e-3,
                    647.096,
                    22.064e6,
                    17_873.7,
                    0.3443,
                    [4.3427988, -3.5317429, 12.480657, -17.133222, 13.449891, -5.5796371, 0.9336891],
                ),
                Species::H2 => (
                    2.01588e-3,
                    33.144_33,
                    1.296_358e6,
                    15_501.88,
                    -0.219,
                    [1.7648514, 14.777206, -50.053439, 86.678939, -80.838403, 38.831064, -7.526478],
                ),
                Species::CH4 => (
                    16.0428e-3,
                    190.564,
                    4.5992e6,
                    10_139.1,
                    0.0114,
                    [6.0942944, -24.461087, 96.478789, -148.60022, 123.45009, -53.839839, 9.6329481],
                ),
            };
        SpeciesData {
            molar_mass_kg_mol,
            critical_k,
            critical_pa,
            critical_m3_mol: 1.0 / critical_mol_m3,
            acentric_factor,
            heat_capacity,
        }
    }
}

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
    /// use mapper_physics::gas::mixture::{Gas, Species};
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
