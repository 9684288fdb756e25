//! Species of a gas mixture.

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
