//! Uncommanded changes of test cell and supply: temperatures and pressures wander slowly and smoothly.

use mapper_physics::machine::params::BoundaryConditions;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// A slow sine wave.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Wave {
    amplitude: f64,
    angular_hz: f64,
    phase: f64,
}

impl Wave {
    fn at(&self, t_s: f64) -> f64 {
        self.amplitude * (self.angular_hz * t_s + self.phase).sin()
    }
}

/// Waves of each uncommanded boundary condition, and of the supplies of two commanded ones.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Weather {
    t1_k: Vec<Wave>,
    p1_pa: Vec<Wave>,
    t3_k: Vec<Wave>,
    p4_pa: Vec<Wave>,
    oil_k: Vec<Wave>,
    ambient_k: Vec<Wave>,
    /// Rise of P4 with P3, Pa/Pa: flow resistance of the exhaust.
    p4_by_p3_ratio: f64,
}

/// P3 at which the exhaust's resistance is part of the nominal P4, Pa.
const P3_WITHOUT_RISE_PA: f64 = 150e3;

impl Weather {
    /// Draws the fluctuations of a day from `seed`: inlet and cell within about 1 K over a quarter of an hour and more, oil 2 K, turbine inlet 1 K over
    /// minutes, P1 and P4 some ten to hundred pascal, and an exhaust resistance of up to 8 Pa per kPa of P3.
    pub fn draw(seed: u64) -> Self {
        // A separate random stream: the odd multipliers differ from those of noise and offsets.
        let mut random =
            Pcg64::seed_from_u64(seed.wrapping_mul(0xBF58_476D_1CE4_E5B9) ^ 0x94D0_49BB_1331_11EB);
        let mut waves = |amplitude: f64, [shortest_s, longest_s]: [f64; 2]| {
            (0..2)
                .map(|_| {
                    let period_s = shortest_s * (longest_s / shortest_s).powf(random.random());
                    Wave {
                        amplitude: amplitude * random.random_range(0.3..0.8),
                        angular_hz: 2.0 * std::f64::consts::PI / period_s,
                        phase: random.random_range(0.0..2.0 * std::f64::consts::PI),
                    }
                })
                .collect()
        };
        Weather {
            t1_k: waves(1.0, [900.0, 3600.0]),
            p1_pa: waves(10.0, [200.0, 2000.0]),
            t3_k: waves(1.0, [150.0, 600.0]),
            p4_pa: waves(40.0, [100.0, 1000.0]),
            oil_k: waves(2.0, [600.0, 2000.0]),
            ambient_k: waves(0.3, [900.0, 3600.0]),
            p4_by_p3_ratio: random.random_range(0.0..8e-3),
        }
    }

    /// Whether all values are constant.
    pub fn is_calm(&self) -> bool {
        *self == Weather::default()
    }

    /// Adds the fluctuations at `t_s` to `boundary`.
    pub fn add_to(&self, boundary: BoundaryConditions, t_s: f64) -> BoundaryConditions {
        let sum = |waves: &[Wave]| waves.iter().map(|wave| wave.at(t_s)).sum::<f64>();
        BoundaryConditions {
            t1_k: boundary.t1_k + sum(&self.t1_k),
            p1_pa: boundary.p1_pa + sum(&self.p1_pa),
            t3_k: boundary.t3_k + sum(&self.t3_k),
            p4_pa: boundary.p4_pa
                + sum(&self.p4_pa)
                + self.p4_by_p3_ratio * (boundary.p3_pa - P3_WITHOUT_RISE_PA),
            oil_temperature_k: boundary.oil_temperature_k + sum(&self.oil_k),
            ambient_temperature_k: boundary.ambient_temperature_k + sum(&self.ambient_k),
            ..boundary
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weather_is_slow_small_and_repeatable() {
        let nominal = BoundaryConditions { p3_pa: 150e3, ..Default::default() };
        assert_eq!(Weather::default().add_to(nominal, 100.0), nominal);
        assert!(Weather::default().is_calm() && !Weather::draw(1).is_calm());
        assert_eq!(Weather::draw(3), Weather::draw(3));
        assert_ne!(Weather::draw(3), Weather::draw(4));
        for seed in 0..50 {
            let weather = Weather::draw(seed);
            for i in 0..40 {
                let t_s = f64::from(i) * 50.0;
                let (now, soon) = (weather.add_to(nominal, t_s), weather.add_to(nominal, t_s + 1.0));
                // Two waves of at most 0.8 of the amplitude.
                assert!((now.t1_k - nominal.t1_k).abs() <= 1.6 && (now.t3_k - nominal.t3_k).abs() <= 1.6);
                // The fastest wave of T3 has 150 s: 2 pi/150 of its amplitude in a second, twice.
                assert!((soon.t3_k - now.t3_k).abs() <= 1.6 * 2.0 * std::f64::consts::PI / 150.0);
            }
        }
    }
}
