//! A table of the virtual lab's steady states becomes the lab's own map.

use mapper_campaign::Campaign;
use mapper_core::{ConvectionLaw, EstimateUncertainty, MapDescription, SharedValue, ThermalModel};
use mapper_formats::FORMATS;
use mapper_physics::gas::pressure_tap::total_to_static_pa;
use mapper_physics::machine::params::BoundaryConditions;
use mapper_physics::simulation::steady::{SteadyState, hold_speed};
use mapper_session::{Existing, MapOut, MapWork, Registry, nominal_model};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

fn campaign_file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../campaigns/turbo_a.yaml")
}

/// The steady states of the campaign's points.
fn steady_states(campaign: &Campaign) -> Vec<SteadyState> {
    let model = nominal_model(campaign).unwrap();
    let held = campaign.points.iter().map(|point| {
        let valve_opening_ratio = point.valve_opening_ratio;
        let boundary = BoundaryConditions { valve_opening_ratio, ..campaign.boundary };
        hold_speed(&model, point.speed_rpm, &boundary).unwrap()
    });
    held.collect()
}

/// A table as a gas stand writes it, with the rows in no order.
fn table(states: &[SteadyState], with_tc: bool, pipe_m: Option<f64>) -> String {
    let mut text =
        "Gas stand 3; steady points\nn [1/min];m_dot [kg/h];p1 [mbar];T1 [°C];p2 [kPa];T2 [°C]".to_owned();
    text.push_str(if with_tc { ";Gehäusetemperatur [°C];note\n" } else { ";note\n" });
    for held in states.iter().rev() {
        let (boundary, outputs) = (&held.boundary, &held.outputs);
        let p2_pa = pipe_m.map_or(held.state.p2_pa, |diameter_m| {
            total_to_static_pa(held.state.p2_pa, outputs.flow_kg_s, outputs.t2_k, diameter_m).unwrap()
        });
        let celsius = |kelvin: f64| format!("{:.6}", kelvin - 273.15).replace('.', ",");
        let decimal = |value: f64| format!("{value:.6}").replace('.', ",");
        let mut cells = vec![
            decimal(held.state.shaft_speed_rpm()),
            decimal(3600.0 * outputs.flow_kg_s),
            decimal(0.01 * boundary.p1_pa),
            celsius(boundary.t1_k),
            decimal(1e-3 * p2_pa),
            celsius(outputs.t2_probe_k),
        ];
        if with_tc {
            cells.push(celsius(held.state.tc_k));
        }
        text.push_str(&format!("{};-\n", cells.join(";")));
    }
    text
}

/// The same table with the turbine's readings in place of Tc; P4 is above the barometer's 98.6 kPa.
fn table_of_both(states: &[SteadyState]) -> String {
    let rows = table(states, false, None);
    let mut lines = rows.lines();
    let (title, heads) = (lines.next().unwrap(), lines.next().unwrap());
    let mut text = format!(
        "{title}\n{heads};m_t [g/s];Druck vor Turbine [bar];p4 [mbar(g)];Barometer [mbar];Temperatur vor Turbine [°C];T4 [°C];Öltemperatur [°C]\n"
    );
    for (row, held) in lines.zip(states.iter().rev()) {
        let (boundary, outputs) = (&held.boundary, &held.outputs);
        let readings = [
            1e3 * outputs.turbine_flow_kg_s,
            1e-5 * boundary.p3_pa,
            0.01 * boundary.p4_pa - 986.0,
            986.0,
            boundary.t3_k - 273.15,
            outputs.turbine.t4_k - 273.15,
            boundary.oil_temperature_k - 273.15,
        ];
        let cells: Vec<String> =
            readings.iter().map(|value| format!("{value:.7}").replace('.', ",")).collect();
        text.push_str(&format!("{row};{}\n", cells.join(";")));
    }
    text
}

fn reduced(text: &str, machine: Option<&Path>, given: &MapDescription) -> MapWork {
    let scratch = tempfile::tempdir().unwrap();
    let file = scratch.path().join("points.csv");
    std::fs::write(&file, text).unwrap();
    let registry = Registry { formats: FORMATS, ..Registry::empty() };
    registry.reduce_points(&file, given, machine, None, None).unwrap()
}

/// The efficiencies of the points by the number of their row.
fn etas(work: &MapWork) -> Vec<f64> {
    let lines = work.json["lines"].as_array().unwrap().iter();
    let points = lines.flat_map(|line| line["points"].as_array().unwrap());
    let mut etas: Vec<(u64, f64)> = points
        .map(|point| (point["identified"]["step"].as_u64().unwrap(), point["eta"].as_f64().unwrap()))
        .collect();
    etas.sort_by_key(|(step, _)| *step);
    etas.into_iter().map(|(_, eta)| eta).collect()
}

#[test]
fn the_labs_steady_states_give_the_labs_map() {
    let file = campaign_file();
    let campaign = mapper_campaign::load(&file).unwrap();
    let states = steady_states(&campaign);
    let given = MapDescription::default();
    let work = reduced(&table(&states, true, None), Some(&file), &given);
    assert_eq!(work.json["method"], "corrected");
    assert_eq!(work.json["lines"].as_array().unwrap().len(), 8, "one line for each speed of the campaign");
    for (eta, held) in etas(&work).iter().zip(states.iter().rev()) {
        // 0.05 points; the table has six decimals.
        assert!((eta - held.outputs.efficiency).abs() < 5e-4, "{eta} {}", held.outputs.efficiency);
    }
    // Every point's interval covers the truth and has its sources.
    let budgets = work.json["budgets"].as_array().unwrap();
    let sources = budgets[0]["eta"]["rows"].as_array().unwrap();
    let named = |name: &str| sources.iter().any(|row| row["source"].as_str() == Some(name));
    assert!(["offset of T2", "gain of m_c", "offset of Tc", "convection law"].iter().all(|name| named(name)));
}

/// T3 and the oil replace a housing temperature: the heat balance of the campaign's machine gives it.
#[test]
fn t3_and_oil_give_the_labs_map_without_tc() {
    let file = campaign_file();
    let states = steady_states(&mapper_campaign::load(&file).unwrap());
    let work = reduced(&table_of_both(&states), Some(&file), &MapDescription::default());
    assert_eq!(work.json["method"], "corrected");
    for (eta, held) in etas(&work).iter().zip(states.iter().rev()) {
        // 0.05 points, as with Tc.
        assert!((eta - held.outputs.efficiency).abs() < 5e-4, "{eta} {}", held.outputs.efficiency);
    }
}

/// The same table has the turbine's points: N/sqrt(T3), m sqrt(T3)/p3, P3/P4, and the enthalpies from T3 to T4.
#[test]
fn the_turbines_points_become_its_map() {
    let states = steady_states(&mapper_campaign::load(&campaign_file()).unwrap());
    let scratch = tempfile::tempdir().unwrap();
    let (file, out) = (scratch.path().join("points.csv"), scratch.path().join("turbine.csv"));
    std::fs::write(&file, table_of_both(&states)).unwrap();
    let registry = Registry { formats: FORMATS, ..Registry::empty() };
    let to = MapOut { path: &out, format: None, existing: Existing::Kept };
    let given = MapDescription::default();
    let work = registry.reduce_turbine_points(&file, &given, Some(&campaign_file()), Some(to)).unwrap();
    let points = work.json["turbine"].as_array().unwrap();
    assert_eq!(points.len(), states.len());
    for (point, held) in points.iter().zip(states.iter().rev()) {
        let of = |key: &str| point[key].as_f64().unwrap();
        let (boundary, outputs) = (&held.boundary, &held.outputs);
        let (ratio, t4_k) = (boundary.p3_pa / boundary.p4_pa, outputs.turbine.t4_k);
        let flow = outputs.turbine_flow_kg_s * boundary.t3_k.sqrt() / (1e-3 * boundary.p3_pa);
        // An expansion is the compression the other way round.
        let eta = 1.0 / by_enthalpy(1.0 / ratio, boundary.t3_k, t4_k, 0.0);
        for (key, expected) in [
            ("speed_parameter_rpm_sqrt_k", held.state.shaft_speed_rpm() / boundary.t3_k.sqrt()),
            ("flow_parameter_kg_sqrt_k_s_kpa", flow),
            ("expansion_ratio", ratio),
            ("efficiency", eta),
        ] {
            assert!((of(key) / expected - 1.0).abs() < 1e-5, "{key}: {} {expected}", of(key));
        }
        assert!((1e-4..0.1).contains(&(of("flow_standard_error") / flow)));
        assert!((1e-4..0.1).contains(&of("efficiency_standard_error")));
    }
    assert_eq!(registry.inspect_turbine(&out, given).unwrap().map.points.len(), states.len());
}

/// (h(T2s) - h(T1))/(h(T2) - h(T1)) with s(T2s) - s(T1) = R ln PR, of air whose cp is 1002.5 + 275e-6 (T - 200)^2, with a mass fraction of water.
fn by_enthalpy(ratio: f64, t1_k: f64, t2_k: f64, water: f64) -> f64 {
    let enthalpy = |t_k: f64| 1002.5 * t_k + 275e-6 / 3.0 * (t_k - 200.0).powi(3);
    let entropy = |t_k: f64| (1002.5 + 275e-6 * 4e4) * t_k.ln() + 275e-6 * (0.5 * t_k * t_k - 400.0 * t_k);
    let gas_constant = 287.05 * (1.0 + (1.0 / 0.62198 - 1.0) * water) / (1.0 + 0.865 * water);
    let (mut low_k, mut high_k) = (0.5 * t1_k, 2.0 * t1_k);
    while high_k - low_k > 1e-9 {
        let middle_k = 0.5 * (low_k + high_k);
        let is_low = entropy(middle_k) - entropy(t1_k) < gas_constant * ratio.ln();
        if is_low { low_k = middle_k } else { high_k = middle_k }
    }
    (enthalpy(low_k) - enthalpy(t1_k)) / (enthalpy(t2_k) - enthalpy(t1_k))
}

#[test]
fn without_the_housing_they_give_the_conventional_map() {
    let file = campaign_file();
    let campaign = mapper_campaign::load(&file).unwrap();
    let states = steady_states(&campaign);
    let given =
        MapDescription { reference: Some(mapper_core::ReferenceState::SAE), ..MapDescription::default() };
    for machine in [Some(file.as_path()), None] {
        let work = reduced(&table(&states, false, None), machine, &given);
        assert_eq!(work.json["method"], "steady");
        for (eta, held) in etas(&work).iter().zip(states.iter().rev()) {
            let ratio = held.state.p2_pa / held.boundary.p1_pa;
            let (t1_k, t2_k) = (held.boundary.t1_k, held.outputs.t2_probe_k);
            // The mixture of dry air and the campaign's humidity; without a campaign the air is dry.
            let water = campaign.machine.params.compressor.humidity_kg_kg;
            let water = if machine.is_some() { water / (1.0 + water) } else { 0.0 };
            let apparent = by_enthalpy(ratio, t1_k, t2_k, water);
            // The vapour's heat capacity is not quite in proportion to that of air. Without a campaign the air is a real gas, which
            // tests/tests/all/gases.rs judges: up to 0.06 points off.
            let tolerance = if machine.is_some() { 1e-4 } else { 8e-4 };
            assert!((eta - apparent).abs() < tolerance, "{eta} {apparent}");
        }
    }
}

#[test]
fn static_pressures_are_converted_first() {
    let file = campaign_file();
    let states = steady_states(&mapper_campaign::load(&file).unwrap());
    let mut given = MapDescription::default();
    given.static_taps.outlet_diameter_m = Some(0.035);
    let work = reduced(&table(&states, true, Some(0.035)), Some(&file), &given);
    for (eta, held) in etas(&work).iter().zip(states.iter().rev()) {
        assert!((eta - held.outputs.efficiency).abs() < 5e-4, "{eta} {}", held.outputs.efficiency);
    }
}

#[test]
fn ends_of_lines_come_from_the_rows_or_from_the_slope() {
    let file = campaign_file();
    let states = steady_states(&mapper_campaign::load(&file).unwrap());
    let text = table(&states, true, None);
    // The last row is the first point of the campaign, in the slowest line.
    let text = format!("{}Pumpgrenze\n", text.trim_end().strip_suffix('-').unwrap());
    let work = reduced(&text, Some(&file), &MapDescription::default());
    let ends = work.json["ends"].as_array().unwrap();
    assert_eq!(ends.len(), 8);
    let named = ends.iter().filter(|end| end["surge"]["by"] == "named").count();
    assert_eq!(named, 1);
    let marked = work.json.to_string().matches("surge_end").count();
    assert!(marked >= 1);
}

/// A run directory: the law that its recording gave takes the place of the declared one, with its own uncertainty.
#[test]
fn the_thermal_model_of_a_run_removes_the_heat() {
    let file = campaign_file();
    let campaign = mapper_campaign::load(&file).unwrap();
    let states = steady_states(&campaign);
    let run = tempfile::tempdir().unwrap();
    std::fs::copy(&file, run.path().join("campaign.yaml")).unwrap();
    let compressor = campaign.machine.params.compressor;
    let reduced_with = |coefficient: f64, standard_error: f64| {
        let shared = |value: f64, noise_standard_error: f64| SharedValue {
            uncertainty: EstimateUncertainty { noise_standard_error, bias_standard_error: 0.0 },
            ..SharedValue::assumed(value)
        };
        let thermal = ThermalModel {
            convection: Some(ConvectionLaw {
                diameter_m: compressor.outlet_diameter_m,
                coefficient: shared(coefficient, standard_error),
                exponent: shared(compressor.nusselt_exponent, 0.0),
                reynolds_reference: 1e5,
                reynolds_range: (3e4, 3e5),
                deviation_ratio: 0.0,
            }),
            internal_area_m2: compressor.internal_area_m2,
            alpha_area_ratio: shared(compressor.alpha_area_ratio, 0.0),
            inlet: None,
            housing: None,
            probe_diameter_m: shared(0.0, 0.0),
            heating_cooling_ratio: shared(1.0, 0.0),
            offsets: BTreeMap::new(),
            entangled: Vec::new(),
            doubts: Vec::new(),
        };
        let points = serde_json::json!({"points": [], "thermal": thermal}).to_string();
        std::fs::write(run.path().join("points.json"), points).unwrap();
        reduced(&table(&states, true, None), Some(run.path()), &MapDescription::default())
    };
    let of_law = |work: &MapWork| {
        let rows = work.json["budgets"][0]["eta"]["rows"].as_array().unwrap().clone();
        let row = rows.iter().find(|row| row["source"] == "convection law").cloned();
        row.map(|row| row["standard_uncertainty"].as_f64().unwrap())
    };
    let own = reduced_with(compressor.nusselt_coefficient, 0.02 * compressor.nusselt_coefficient);
    assert!((of_law(&own).unwrap() - 0.02).abs() < 1e-12);
    for (eta, held) in etas(&own).iter().zip(states.iter().rev()) {
        assert!((eta - held.outputs.efficiency).abs() < 5e-4, "{eta} {}", held.outputs.efficiency);
    }
    // Without convection what is left is the conventional efficiency.
    let none = reduced_with(1e-12, 0.0);
    let apparent = reduced(&table(&states, false, None), Some(run.path()), &MapDescription::default());
    for (eta, apparent) in etas(&none).iter().zip(etas(&apparent)) {
        assert!((eta - apparent).abs() < 1e-6, "{eta} {apparent}");
    }
}
