//! Gases against CoolProp's equations of state.

use mapper_physics::gas::air::Air;
use mapper_physics::gas::mixture::{Fuel, Gas, Species};
use mapper_physics::laws::compression::apparent_efficiency;
use mapper_tests::python;

fn gas_of(name: &str) -> Air {
    let number = || name.rsplit(' ').next().unwrap().parse::<f64>().unwrap();
    let air =
        [(Species::N2, 0.78084), (Species::O2, 0.20939), (Species::Ar, 0.00934), (Species::CO2, 0.00043)];
    let dry = match name.split(' ').next() {
        Some("hydrogen") => Gas::of_mole_fractions(air.into_iter().chain([(Species::H2, number())])),
        Some("burnt") if name.contains("diesel") => Gas::burnt(Fuel::DIESEL, number()),
        Some("burnt") => Gas::burnt(Fuel::NATURAL_GAS, number()),
        _ => Gas::air(),
    };
    Air::new(dry, if name.starts_with("moist") { number() } else { 0.0 })
}

/// An efficiency of 0.7, by tests/python/compress.py. 0.02 points and 0.05 %: a tenth of what the best gas stands state. Dry, moist, with hydrogen, and burnt; pressure ratios of 1.1 to 5.
#[test]
fn efficiency_and_work_are_those_of_coolprop() {
    let states = python("compress.py", [""; 0]);
    let states = states.as_array().unwrap();
    assert!(states.len() > 80);
    for state in states {
        let of = |key: &str| state[key].as_f64().unwrap();
        let (t1_k, t2_k, p1_pa, p2_pa) = (of("t1_k"), of("t2_k"), of("p1_pa"), of("p2_pa"));
        let air = gas_of(state["gas"].as_str().unwrap()).between(p1_pa, p2_pa);
        let eta = apparent_efficiency(p2_pa / p1_pa, t1_k, t2_k, air);
        let work_j_kg = air.enthalpy_rise_j_kg(t1_k, t2_k);
        assert!((eta - 0.7).abs() < 2e-4, "{eta} of {state}");
        assert!((work_j_kg / of("work_j_kg") - 1.0).abs() < 5e-4, "{work_j_kg} of {state}");
    }
}
